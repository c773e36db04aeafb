"""What the rules about Table I say of episodes made by hand, and of spoilt ones."""

import numpy as np
import pandas as pd
import pytest

from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.conformal.bounds import running_maximum_bound
from cpl.policies.table1 import CARRIED, PRINTED, ROWS, SWITCH

PAIRS, SEEDS, TOPS = range(5), np.arange(60), (30.0, 40.0, 50.0)
PLAIN = {"slow": (40.0, 20.0), "safe": (39.9, 20.5), "switch": (38.0, 26.0),
         "switch above": (33.0, 27.0), "switch below": (39.0, 24.5)}  # fmt: skip


def episodes():
    """The printed table, with a little chance in it."""
    rng = np.random.default_rng(1)
    parts = []
    for top in TOPS:
        means = {name: PRINTED[name, top][::2] for name in ROWS} | PLAIN
        if top == 40.0:
            means |= dict.fromkeys(CARRIED, (20.0, 33.0))
        luck = rng.normal(0, 1, len(SEEDS))
        for name, (duration, speed) in means.items():
            for pair in PAIRS:
                steps = duration + 0.2 * luck + rng.normal(0, 0.2) + 0.02 * (pair - 2)
                q = 0.1 if name == "rl_1" else 0.15
                scored = 500.0 if name in CARRIED else 20.0
                parts.append(
                    pd.DataFrame(
                        {
                            "pair": pair, "top_mps": top, "policy": name, "seed": SEEDS,
                            "steps": steps, "crashed": steps < 39, "speed_sum": speed * steps,
                            "last_speed": speed, "distance_m": speed * steps, "q_sum": q * steps,
                            "q_steps": steps, "scored": scored, "missed": 0.1 * scored,
                            "fast_steps": 0.0 if top == 30.0 else (q - 0.05) * steps,
                            "as_speed": name == "speed",
                        }
                    )
                )  # fmt: skip
    return pd.concat(parts, ignore_index=True)


TABLE = episodes()
TOLD = {"alpha": 0.1, "share": 0.1, "top_speed_mps": 40.0}
EXPECTED = {
    29: "holds", 30: "holds", 31: "holds in part", 32: "holds", 33: "holds", 34: "holds",
    35: "holds in part", 36: "holds", 38: "does not hold", 40: "holds", 41: "holds",
}  # fmt: skip


def verdict(row, change=lambda table: table):
    source = Source(table=change(TABLE.copy()), parameters=TOLD)
    return str(claims()[row].decide(lambda name: source).verdict)


def scaled(column, factor, **chosen):
    """Return a function that scales a column where others have the named values."""

    def change(table):
        fits = np.logical_and.reduce(
            [table[name].isin(np.atleast_1d(value)) for name, value in chosen.items()]
        )
        value = table[column].to_numpy(np.float64)
        columns = {column: np.where(fits, factor * value, value)}
        if column == "steps":  # at the same speed
            for name in ("speed_sum", "distance_m"):
                columns[name] = table[name] * columns[column] / value
        return table.assign(**columns)

    return change


def alike(table):
    same = (table["policy"] == "rl_1") & (table["top_mps"] == 50.0)
    return table.assign(as_speed=table["as_speed"] | same)


def apart(table):
    """Let training seeds differ by more than thresholds do."""
    switches = table["policy"].isin(PLAIN) & table["policy"].str.startswith("switch")
    return table.assign(steps=table["steps"] * (1 + 0.25 * (table["pair"] - 2) * switches))


MUTATIONS = [
    (29, scaled("steps", 0.7, policy=ROWS[:3]), "does not hold"),
    (30, scaled("steps", 0.8, policy=SWITCH, top_mps=30.0), "holds in part"),
    (30, scaled("steps", 0.3, policy=SWITCH), "does not hold"),
    (31, scaled("steps", 1.3, policy="rl", top_mps=(30.0, 50.0)), "holds in part"),
    (31, scaled("steps", 0.5, policy="rl"), "does not hold"),
    (32, scaled("steps", 0.8, policy="rl"), "holds in part"),
    (32, scaled("steps", 0.5, policy="rl"), "does not hold"),
    (33, scaled("steps", 2.0, policy="rl"), "does not hold"),
    (33, scaled("steps", 2.0, policy="rl", top_mps=50.0), "holds in part"),
    (34, scaled("steps", 0.6, policy=(SWITCH, "switch")), "does not hold"),
    (34, scaled("steps", 0.6, policy="switch"), "holds in part"),
    (35, scaled("steps", 0.5, policy="rl_nq"), "holds"),
    (35, scaled("steps", 0.5, policy="rl"), "does not hold"),
    (36, scaled("q_sum", 3.0, policy="rl_1"), "holds in part"),
    (36, lambda table: scaled("q_sum", 3.0, policy="rl_1")(
        scaled("fast_steps", 3.0, policy="rl_1")(table)), "does not hold"),
    (38, alike, "holds"),
    (40, scaled("missed", 9.0, policy=CARRIED), "does not hold"),
    (40, scaled("missed", 9.0, policy=CARRIED[0]), "holds in part"),
    (41, lambda table: apart(table), "does not hold"),
]  # fmt: skip


def test_the_slack_of_the_long_run_is_the_bound_s():
    rate = 0.1 + running_maximum_bound(0.1, 0.1, B=1.0) / (500 * len(SEEDS))
    at = [scaled("missed", factor * rate / 0.1, policy=CARRIED) for factor in (0.999, 1.001)]
    assert [verdict(40, change) for change in at] == ["holds", "does not hold"]


def test_every_rule_has_a_mutation():
    assert set(EXPECTED) == {row for row, *_ in MUTATIONS}


@pytest.mark.parametrize("row", EXPECTED)
def test_the_rules_on_a_table_made_by_hand(row):
    assert verdict(row) == EXPECTED[row]


@pytest.mark.parametrize(("row", "change", "expected"), MUTATIONS)
def test_a_spoilt_table_changes_the_verdict(row, change, expected):
    assert verdict(row, change) == expected
