"""Exhaustive search against brute force, the bounds against the search."""

from fractions import Fraction
from itertools import product

import pytest

from cpl.conformal.reference import follow
from cpl.conformal.search import (
    highest_quantile_eventually_safe,
    search_windows,
    sweep_eventually_safe,
    sweep_windows,
)


def brute_force(alpha, ratio, T, delay):
    """Return the most and fewest misses of windows in all paths of T scores (0, mid points, B)."""
    # Any score between q and B acts like B or 0; two values are enough for every choice.
    most, least = [0] * T, list(range(1, T + 1))
    first_most, first_least = [0] * T, list(range(1, T + 1))
    for moves in product((0, 1), repeat=T):
        err = follow([m * ratio for m in moves], alpha=alpha, eta=1, delay=delay).err
        for W in range(1, T + 1):
            counts = [sum(err[i : i + W]) for i in range(T - W + 1)]
            most[W - 1] = max(most[W - 1], *counts)
            least[W - 1] = min(least[W - 1], *counts)
            first_most[W - 1] = max(first_most[W - 1], counts[0])
            first_least[W - 1] = min(first_least[W - 1], counts[0])
    return most, least, first_most, first_least


@pytest.mark.parametrize("delay", [1, 2, 3])
@pytest.mark.parametrize(
    ("alpha", "ratio"), [("1/2", "1"), ("1/3", "1/2"), ("3/4", "4/3"), ("1/10", "17/20")]
)
def test_the_search_agrees_with_brute_force(alpha, ratio, delay):
    T = 9
    found = search_windows(Fraction(alpha), 1, Fraction(ratio), T, delay=delay)
    most, least, first_most, first_least = brute_force(Fraction(alpha), Fraction(ratio), T, delay)
    assert list(found.most_from_start) == first_most
    assert list(found.least_from_start) == first_least
    # A window may begin later than brute force can see, so only short ones must agree.
    for W in range(1, T + 1):
        assert found.most[W - 1] >= most[W - 1]
        assert found.least[W - 1] <= least[W - 1]
    assert found.most[:4] == tuple(most[:4])


@pytest.fixture(scope="module")
def swept():
    return sweep_windows()


def test_the_exact_worst_case_is_exact_everywhere(swept):
    assert len(swept) > 13_920
    assert swept.holds.all()
    assert swept.attained.all()


def test_the_printed_theorem_is_violated_often(swept):
    violated = swept[~swept.printed_holds]
    assert 0.1 < len(violated) / len(swept) < 0.3
    assert (violated.alpha != Fraction(1, 10)).any()


def test_the_printed_theorem_survives_at_the_papers_settings(swept):
    whole = swept.ratio.map(lambda r: r.denominator == 1)
    unit = swept.alpha.map(lambda a: a.numerator == 1)
    assert swept[whole & unit].printed_holds.all()
    assert not swept[whole & ~unit].printed_holds.all()
    assert not swept[~whole & (swept.alpha == Fraction(1, 10))].printed_holds.all()


def test_with_delay_the_bounds_hold_and_are_attained_where_promised():
    late = sweep_windows(W_max=30, delays=(2, 3))
    assert len(late) > 10_000
    assert late.holds.all()
    assert late[late.promised].attained.all()
    assert not late[~late.promised].attained.all()
    # Without the delay term the bound is false.
    assert (late.most >= late.alpha * late.W + late.ratio + 1).any()


@pytest.mark.oracle
def test_a_longer_sweep_with_more_delay():
    late = sweep_windows(W_max=150, delays=(1, 2, 3, 4, 5))
    assert len(late) > 130_000
    assert late.holds.all()
    assert late[late.promised].attained.all()


def test_eventually_safe_policies_stay_below_their_ceiling():
    table = sweep_eventually_safe()
    assert len(table) > 246
    assert table.holds.all()
    # Both ceilings are approached: somewhere the highest point is one lattice step below.
    assert (table.high - table.at_the_end).min() <= Fraction(1, 20)
    assert (table.high_going_on - table.going_on).min() <= Fraction(1, 20)


def test_the_end_of_a_run_may_cut_a_block_short():
    setting = {"alpha": Fraction(1, 10), "eta": 1, "q_floor": 1}
    cut = highest_quantile_eventually_safe(**setting, K=4, misses=0)
    assert cut.at_the_end == Fraction(9, 10) * 5
    assert cut.going_on == Fraction(9, 5)
    with pytest.raises(ValueError, match=r"misses must be < alpha K = 2/5, got 1"):
        highest_quantile_eventually_safe(**setting, K=4, misses=1)
