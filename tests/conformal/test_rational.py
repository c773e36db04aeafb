from fractions import Fraction

import numpy as np
import pytest

from cpl.conformal.rational import count, level, like, positive, rational


@pytest.mark.parametrize(
    ("value", "exact"),
    [
        (0.1, Fraction(1, 10)),
        (np.float64(0.1), Fraction(1, 10)),
        (np.float32(0.1), Fraction(1, 10)),
        (1e-9, Fraction(1, 10**9)),
        (np.int64(3), Fraction(3)),
        (Fraction(1, 3), Fraction(1, 3)),
    ],
)
def test_numbers_are_read_as_they_print(value, exact):
    assert rational(value) == exact


@pytest.mark.parametrize("value", [True, float("nan"), float("inf"), "a lot", None])
def test_what_is_no_finite_number_is_refused_by_name(value):
    with pytest.raises(ValueError, match=f"eta must be .*{value}"):
        rational(value, "eta")


@pytest.mark.parametrize("alpha", [0, 1, -0.1, 2])
def test_a_level_lies_strictly_between_0_and_1(alpha):
    with pytest.raises(ValueError, match=rf"alpha must lie in \(0, 1\), got {alpha}"):
        level(alpha)


def test_positive_and_count_name_argument_and_value():
    with pytest.raises(ValueError, match=r"eta must be > 0, got 0"):
        positive(0, "eta")
    for wrong in (0, 1.5, True):
        with pytest.raises(ValueError, match=f"W must be an integer >= 1, got {wrong}"):
            count(wrong, "W")
    assert count(np.int64(3), "W") == 3


def test_results_are_of_the_kind_of_the_inputs():
    assert isinstance(like(Fraction(1, 2), 1, Fraction(1, 3)), Fraction)
    assert isinstance(like(Fraction(1, 2), 1, 0.3), float)
