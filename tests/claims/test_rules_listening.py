"""What the rules about listening say of small tables made by hand, and of spoilt ones."""

import pandas as pd
import pytest

from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.claims.rows.c39_small_in_training import RETRAINED
from cpl.policies.measures import SUMS

PAIRS = range(4)


def inside(gain, spread=0.001):
    rows = [
        {"pair": pair, "agent": agent, "question": "risk", "of": of, "value": value, "n": 1000}
        for pair in PAIRS
        for agent in ("rl", "rl_2")
        for of, value in (("q", 0.02), ("q and q l_hat", 0.02 + gain + spread * pair))
    ]
    return Source(table=pd.DataFrame(rows), parameters={})


def driven(durations, spread=0.1):
    rows = []
    for road in (*RETRAINED, "noise"):
        for method, duration in durations.items():
            for pair in PAIRS:
                for block in range(3):
                    steps = 10 * (
                        duration
                        + spread * (pair - 1.5) * (method == "wide")
                        + 0.15 * (method == "wide")
                    )
                    sums = {**dict.fromkeys(SUMS, 1.0), "episodes": 10, "steps": steps}
                    labels = {"road": road, "method": method, "doing": "natural", "level": 0}
                    rows.append({**labels, "pair": pair, "block": block, **sums})
    return Source(table=pd.DataFrame(rows), parameters={})


def verdict(row, source):
    return str(claims()[row].decide(lambda name: source).verdict)


@pytest.mark.parametrize(
    ("gain", "expected"), [(0.1, "holds"), (-0.1, "does not hold"), (-0.0015, "no difference")]
)
def test_row_37_follows_what_the_product_adds(gain, expected):
    assert verdict(37, inside(gain)) == expected


def test_seeds_that_disagree_leave_both_rows_open():
    assert verdict(37, inside(-0.15, spread=0.1)) == "undecided"
    far = {"wide": 24.0, "wide_nq": 20.0, "rl": 24.0, "rl_nq": 20.0}
    assert verdict(39, driven(far, spread=3.0)) == "undecided"


def test_row_37_looks_at_rl_2_and_counts_moments_once():
    source = inside(0.1)
    source.table.loc[source.table["agent"] == "rl", "value"] = 99.0
    found = claims()[37].decide(lambda name: source)
    assert found.value == pytest.approx(0.1015)
    assert (found.n, found.n_seeds) == (4000, 4)


@pytest.mark.parametrize(
    ("wide", "expected"), [(30.0, "holds"), (19.0, "does not hold"), (23.9, "no difference")]
)
def test_row_39_is_the_gain_from_q_beyond_the_one_of_the_narrow_training(wide, expected):
    # The narrow training gains 4 s from q, the wide one `wide` - 20.
    source = driven({"wide": wide, "wide_nq": 20.0, "rl": 24.0, "rl_nq": 20.0})
    assert verdict(39, source) == expected


def test_row_39_counts_the_episodes_of_its_own_roads():
    source = driven({"wide": 30.0, "wide_nq": 20.0, "rl": 24.0, "rl_nq": 20.0, "gate": 1.0})
    found = claims()[39].decide(lambda name: source)
    assert found.value == pytest.approx(6.15)
    assert found.n == 2 * 4 * 4 * 3 * 10
