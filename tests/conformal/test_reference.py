from fractions import Fraction

import numpy as np
import pytest

from cpl.conformal import Fixed, RunningMax, TrailingMax, TrailingRange, track
from cpl.conformal.reference import follow, running_maximum, trailing_maximum, trailing_range


@pytest.mark.parametrize("delay", [1, 2, 5])
@pytest.mark.parametrize(
    ("eta", "rule"),
    [
        (0.25, Fixed(eta=0.25)),
        (running_maximum(0.5), RunningMax(c=0.5)),
        (trailing_maximum(0.5, 3), TrailingMax(c=0.5, window=3)),
        (trailing_range(0.5, 4), TrailingRange(lr=0.5, window=4)),
    ],
    ids=["fixed", "running maximum", "trailing maximum", "trailing range"],
)
def test_the_exact_and_the_compiled_tracker_agree(eta, rule, delay):
    # Scores in eighths, alpha = 1/8: no sum is rounded, so they agree to the last bit.
    scores = np.random.default_rng(4).integers(0, 9, 60) / 8
    q, err = track(scores, rule, alpha=0.125, delay=delay)
    path = follow(scores, alpha=0.125, eta=eta, delay=delay)
    assert [float(x) for x in path.q[:-1]] == q.tolist()
    assert list(path.err) == err.tolist()
    assert path.error_rate == err.mean()


def test_a_path_is_a_table():
    table = follow([0.5, 0.75], alpha=0.25, eta=1).as_table()
    assert table.to_dict("list") == {
        "t": [0, 1],
        "score": [0.5, 0.75],
        "q": [0.0, 0.75],
        "err": [True, False],
    }


def test_clipping():
    up = follow([1, 1, 1], alpha=0.25, eta=1, keep_within=(0, Fraction(1, 2)))
    assert up.q == (0, Fraction(1, 2), Fraction(1, 2), Fraction(1, 2))
    free = follow([0, 0], alpha=0.25, eta=1, compare_within=(0, 1))
    assert (free.q[-1], free.err) == (Fraction(-1, 2), (False, False))
