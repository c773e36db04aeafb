"""Every rule about effects, on tables that make it hold, fail and stay open.

The published tables are changed, so that a rule is tried on what it really reads. Rows 29 to 41 and
54 to 57 are tried on tables made by hand, in test_rules_table1.py, test_rules_listening.py and
test_family.py; rows that count exceptions in test_ledger.py.
"""

import numpy as np
import pytest

from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.store import read_published

HOLDS, FAILS, OPEN, NONE = "holds", "does not hold", "undecided", "no difference"


def same(table):
    return table


def sign(table):
    """Return +1 for half of the pairs and -1 for the others."""
    return np.where(table["pair"] % 2 == 0, 1.0, -1.0)


def counted(share, **where):
    """Let some quantity be a share of what was counted, the same or another for each pair."""

    def change(table):
        fits = np.logical_and.reduce([table[name] == value for name, value in where.items()])
        wanted = share(table) if callable(share) else share
        return table.assign(value=np.where(fits, wanted * table["n"], table["value"]))

    return change


def times(factor, **where):
    def change(table):
        fits = np.logical_and.reduce([table[name] == value for name, value in where.items()])
        by = factor(table) if callable(factor) else factor
        return table.assign(value=np.where(fits, by * table["value"], table["value"]))

    return change


def faster(by, column="method"):
    """Let the conformal switch be faster, everything else equal."""

    def change(table):
        more = by(table) if callable(by) else by
        more = np.where(table[column] == "conformal", more, 0.0)
        return table.assign(
            speed_sum=table["speed_sum"] + more * table["steps"],
            episode_speed_sum=table["episode_speed_sum"] + more * table["episodes"],
        )

    return change


def late(slope):
    """Let the return rise with the steps in the second half of a training."""

    def change(table):
        by = slope(table) if callable(slope) else slope
        after = (table["step"] - 100_000) / 100_000
        value = np.where(after > 0, 10.0 + by * after, table["episode_return"])
        return table.assign(episode_return=value)

    return change


def loss(growth):
    def change(table):
        fits = (table["quantity"] == "validation_loss") & (table["subject"] == "plain")
        by = growth(table) if callable(growth) else growth
        return table.assign(
            value=np.where(fits, table["value"] * np.exp(by * table["epoch"]), table["value"])
        )

    return change


def safe(crashed, exchange=None):
    """Set the crashes of the safe policy, and let it change places with the fast one in some."""

    def change(table):
        turned = np.zeros(len(table), bool) if exchange is None else exchange(table)
        swap = {"safe": "speed", "speed": "safe"}
        method = np.where(turned, table["method"].replace(swap), table["method"])
        crashes = np.where(method == "safe", crashed(table) * table["episodes"], table["crashes"])
        return table.assign(method=method, crashes=crashes)

    return change


def gate(method, crashes):
    def change(table):
        mine = table["method"] == method
        return table.assign(crashes=np.where(mine, crashes(table), table["crashes"]))

    return change


def ranked(table, order):
    """Let frozen crash the more often, the further a world stands in an order."""
    place = {world: k for k, world in enumerate(order)}
    more = table["world"].astype(str).map(place).to_numpy()
    return table.assign(crashes=np.where(table["method"] == "frozen", more, 0))


def by_coverage():
    windows = read_published("gate_diagnostic", "paper")[0]
    road = windows[windows["log"] == "road"]
    missing = (road["nominal"] - road["coverage"]).groupby(road["part"].astype(str)).mean()
    return list(missing.sort_values().index)


def as_control(table):
    """Let the controls be the switch itself."""
    own = table[table["control"] == "conformal"]
    rest = table[~table["control"].isin(["donor", "mean profile"])]
    copies = [own.assign(control=name) for name in ("donor", "mean profile")]
    return type(table)(np.concatenate([rest, *copies]), columns=table.columns).astype(table.dtypes)


CASES = [
    (10, "switch_choice", HOLDS, lambda t: t.assign(floor_missed=0)),
    (10, "switch_choice", FAILS, lambda t: t.assign(floor_missed=t["floor_scored"])),
    (10, "switch_choice", OPEN,
     lambda t: t.assign(floor_missed=t["floor_scored"] * (0.1 + 0.1 * sign(t)))),
    (11, "exit_time", HOLDS, lambda t: t.assign(exit=3)),
    (11, "exit_time", FAILS, lambda t: t.assign(exit=t["exit"] + 100)),
    (11, "exit_time", OPEN, lambda t: t.assign(exit=10 + 8 * (t["pair"] == 3))),
    (12, "coverage_episodes", HOLDS, same),
    (12, "coverage_episodes", FAILS, times(-1, quantity="paired q")),
    (12, "coverage_episodes", NONE, times(0.05, quantity="paired q")),
    (12, "coverage_episodes", OPEN, times(sign, quantity="paired q")),
    (13, "forecasts", HOLDS, same),
    (13, "forecasts", FAILS, times(3, quantity="coverage_raw")),
    (13, "forecasts", OPEN, lambda t: t.assign(
        value=np.where(t["quantity"] == "coverage_raw", 0.85 + 0.2 * sign(t), t["value"]))),
    (14, "switch_ablation", HOLDS, same),
    (14, "switch_ablation", FAILS, lambda t: t.assign(alpha=1 - t["alpha"])),
    (14, "switch_ablation", OPEN, lambda t: t.assign(
        speed_sum=t["speed_sum"] + 40 * sign(t) * t["alpha"] * t["steps"],
        crashes=t["crashes"] + 40 * sign(t) * t["alpha"] * t["distance_km"])),
    (17, "base_policies", HOLDS, late(0.0)),
    (17, "base_policies", FAILS, late(5.0)),
    (17, "base_policies", OPEN, late(lambda t: 5 * sign(t))),
    (18, "forecasts", HOLDS, same),
    (18, "forecasts", FAILS, loss(0.05)),
    (18, "forecasts", OPEN, loss(lambda t: 0.05 * sign(t))),
    (19, "coverage_episodes", HOLDS, same),
    (19, "coverage_episodes", FAILS, times(0.05, quantity="too fast", driver="switch")),
    (19, "coverage_episodes", OPEN, times(lambda t: 0.18 * (1 + sign(t)), quantity="too fast",
                                          driver="switch")),
    (20, "pareto", HOLDS, faster(12.0)),
    (20, "pareto", FAILS, faster(-12.0)),
    (20, "pareto", OPEN, faster(lambda t: 12 * sign(t))),
    (21, "pareto", HOLDS, faster(20.0)),
    (21, "pareto", FAILS, faster(-20.0)),
    (21, "pareto", OPEN, faster(lambda t: 20 * sign(t))),
    (22, "pareto", HOLDS, faster(lambda t: -20 * t["value"])),
    (22, "pareto", FAILS, faster(lambda t: 20 * t["value"])),
    (22, "pareto", OPEN, faster(lambda t: 20 * sign(t) * t["value"])),
    (26, "pareto", HOLDS, safe(lambda t: 0.0)),
    (26, "pareto", FAILS, safe(lambda t: 1.0, lambda t: t["pair"] >= 0)),
    (26, "pareto", OPEN, safe(lambda t: 0.1 + 0.1 * sign(t), lambda t: sign(t) > 0)),
    (27, "coverage_episodes", HOLDS, counted(0.1, quantity="miss")),
    (27, "coverage_episodes", FAILS, counted(0.3, quantity="miss")),
    (27, "coverage_episodes", OPEN, counted(lambda t: 0.1 + 0.05 * sign(t), quantity="miss")),
    (28, "coverage_episodes", HOLDS, counted(0.9, quantity="window")),
    (28, "coverage_episodes", FAILS, counted(0.2, quantity="window")),
    (28, "coverage_episodes", NONE, counted(0.6, quantity="window")),
    (28, "coverage_episodes", OPEN, counted(lambda t: 0.6 + 0.3 * sign(t), quantity="window")),
    (51, "gate_controls", HOLDS, same),
    (51, "gate_controls", FAILS, gate("constant", lambda t: t["episodes"])),
    (51, "gate_controls", OPEN, gate("constant", lambda t: t["episodes"] * (t["pair"] == 1))),
    (52, "gate_stream", HOLDS, gate("quantile", lambda t: 0 * t["crashes"])),
    (52, "gate_stream", FAILS, gate("quantile", lambda t: 3 * t["crashes"])),
    (52, "gate_stream", OPEN, gate("quantile", lambda t: (1 + sign(t)) * t["crashes"])),
    (53, "gate_stream", HOLDS, lambda t: ranked(t, by_coverage())),
    (53, "gate_stream", FAILS, lambda t: ranked(t, by_coverage()[::-1])),
    (53, "gate_diagnostic", OPEN, lambda t: t.assign(coverage=0.9)),
    (58, "controls", HOLDS, as_control),
    (58, "controls", FAILS, faster(12.0, "control")),
    (58, "controls", OPEN, faster(lambda t: 12 * sign(t), "control")),
]  # fmt: skip

ELSEWHERE = {*range(29, 42), *range(54, 58)}
EXACT = {*range(1, 10), 15, 16, 23, 24, 25, 50}


def reader(changed, change):
    def read(experiment):
        table, manifest = read_published(experiment, "paper")
        table = change(table).reset_index(drop=True) if experiment == changed else table
        return Source(table=table, parameters=manifest.parameters)

    return read


def test_every_rule_is_tried_both_ways_and_open():
    tried = {row for row, *_ in CASES}
    assert tried | ELSEWHERE | EXACT == {row for row, claim in claims().items() if claim.decide}
    for row in tried:
        assert {expected for r, _, expected, _ in CASES if r == row} >= {HOLDS, FAILS, OPEN}


@pytest.mark.parametrize(("row", "experiment", "expected", "change"), CASES)
def test_a_rule_can_say_everything(row, experiment, expected, change):
    assert claims()[row].decide(reader(experiment, change)).verdict == expected
