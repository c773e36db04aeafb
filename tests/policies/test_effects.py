"""Effects on block sums made by hand."""

import numpy as np
import pandas as pd
import pytest

from cpl.policies.effects import beside, contrast, difference, over_pairs
from cpl.policies.measures import SUMS


def rows(method, *, duration, crash=0.5, speed=25.0, pairs=4, blocks=5, level=0, noise=0.0):
    """Ten episodes a block, each of the duration."""
    rng = np.random.default_rng(7)
    found = []
    for pair in range(pairs):
        for block in range(blocks):
            sums = dict.fromkeys(SUMS, 1.0)
            steps = 10 * (duration + noise * rng.normal())
            sums |= {
                "episodes": 10.0, "steps": steps, "crashes": 10 * crash,
                "speed_sum": speed * steps,
            }  # fmt: skip
            labels = {"method": method, "level": level, "pair": pair, "block": block}
            found.append({**labels, **sums})
    return pd.DataFrame(found)


def test_a_difference_of_sums_made_by_hand():
    table = pd.concat([rows("a", duration=30.0), rows("b", duration=24.0)])
    found = difference(table, {"method": "a"}, {"method": "b"}, "duration_s")
    assert found.value == pytest.approx(6.0)
    assert found.low == pytest.approx(6.0)
    assert found.n == 4


def test_a_contrast_adds_up_and_is_uncertain_where_the_pairs_differ():
    table = pd.concat(
        [rows(n, duration=d, noise=1.0) for n, d in zip("abcd", (30, 24, 20, 19), strict=True)]
    )
    terms = [(w, {"method": n}) for w, n in zip((1.0, -1.0, -1.0, 1.0), "abcd", strict=True)]
    found = contrast(table, terms, "duration_s")
    # All have the same noise, so it falls out; one by one it does not.
    assert found.value == pytest.approx(5.0)
    alone = contrast(table, terms[:1], "duration_s")
    assert alone.high - alone.low > 0.1


def test_pairs_that_only_one_has_driven_are_left_out():
    table = pd.concat([rows("a", duration=30.0, pairs=6), rows("b", duration=24.0, pairs=3)])
    assert difference(table, {"method": "a"}, {"method": "b"}, "duration_s").n == 3


def test_a_point_below_the_curve_at_its_own_speed():
    curve = [
        rows("switch", duration=20.0, crash=c, speed=v, level=k)
        for k, (c, v) in enumerate([(0.4, 24.0), (0.8, 32.0)])
    ]
    ends = [rows("safe", duration=40.0, crash=0.0, speed=20.0)]
    table = pd.concat([*curve, *ends, rows("gate", duration=25.0, crash=0.5, speed=28.0)])
    found = beside(table, {"method": "gate"}, {"method": "switch"}, ends=[{"method": "safe"}])
    assert found.value == pytest.approx(0.5 - 0.6)
    slow = pd.concat([*curve, *ends, rows("gate", duration=25.0, crash=0.1, speed=22.0)])
    found = beside(slow, {"method": "gate"}, {"method": "switch"}, ends=[{"method": "safe"}])
    assert found.value == pytest.approx(0.1 - 0.2)


def test_one_pair_has_no_interval():
    assert over_pairs(pd.Series([2.0])).high == np.inf
    assert over_pairs(pd.Series([2.0, np.nan, 4.0])).value == 3.0
