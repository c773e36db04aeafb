"""What the rules about the forecast say of small tables made by hand, and of spoilt ones."""

import numpy as np
import pandas as pd
import pytest

from cpl.claims._ledger import claims
from cpl.claims.claim import Source

PAIRS = range(4)


def forecasts():
    rows = []

    def row(pair, subject, quantity, value, **where):
        where = {"top_speed_mps": np.nan, "policy": "", "epoch": 0, **where}
        told = {"pair": pair, "subject": subject, "quantity": quantity, "value": value}
        rows.append({**told, **where, "n": 100})

    for pair in PAIRS:
        row(pair, "plain", "parameters", 24_705)
        for epoch in range(1, 8):
            loss = 0.004 + 0.003 * np.exp(-2 * epoch) + 1e-7 * pair
            row(pair, "plain", "validation_loss", loss, epoch=epoch)
        for top in (30.0, 40.0):
            for subject in ("dropout", "ensemble", "hau", "certificates"):
                value = (0.95 if top == 30.0 else 0.7) + 0.001 * pair
                row(pair, subject, "coverage_raw", value, top_speed_mps=top, policy="both")
    return Source(table=pd.DataFrame(rows), parameters={"rollouts": 30_000})


def episodes():
    rows = []
    for pair in PAIRS:
        for driver in ("safe", "speed", "switch"):
            for carry in (False, True):
                same = {"pair": pair, "driver": driver, "rule": "P, running maximum"}
                same |= {"carry": carry, "top_speed_mps": 30.0}
                miss = (0.13 if not carry else 0.1) * 30_000 + 10 * pair
                rows.append(
                    {**same, "quantity": "miss", "group": "all", "value": miss, "n": 30_000}
                )
                near = {"quantity": "miss", "group": "near", "value": 50.0, "n": 100}
                rows.append({**same, **near})
                good = {"quantity": "window", "group": "all", "value": 6_500.0 + pair, "n": 10_000}
                rows.append({**same, **good})
            fast = {"quantity": "too fast", "group": "", "n": 1_000}
            for top, share in ((30.0, 0.0), (40.0, 0.3)):
                value = 1_000 * share + 10 * pair if top == 40.0 else 0.0
                plain = {"pair": pair, "driver": driver, "rule": "", "carry": False}
                rows.append({**plain, "top_speed_mps": top, **fast, "value": value})
            gap = {"quantity": "paired q", "group": "all", "value": 5.0 + pair, "n": 100}
            rows.append({
                "pair": pair, "driver": driver, "rule": "", "carry": False, "top_speed_mps": 40.0,
                **gap,
            })  # fmt: skip
    return Source(table=pd.DataFrame(rows), parameters={"alpha": 0.1, "window": 5})


def cost():
    rows = {
        "method": ["conformal", "none", "ensemble", "update", "update, compiled"],
        "parameters": [24_705, 24_705, 123_525, 0, 0],
        "operations": [48_896, 48_896, 244_480, 6, 6],
        "weights_changed": [0, 0, 123_525, 0, 0],
        "seconds": [2e-6, 2e-6, 1e-5, 5e-7, 5e-9],
    }
    return Source(table=pd.DataFrame(rows), parameters={})


MADE = {
    "forecasts": forecasts(),
    "coverage_episodes": episodes(),
    "forecast_cost": cost(),
}
EXPECTED = {
    12: "holds", 13: "holds", 18: "holds", 19: "holds", 23: "holds", 24: "holds", 25: "holds",
    27: "holds in part", 28: "holds",
}  # fmt: skip


def verdict(row, changed=None, change=None, **parameters):
    def read(experiment):
        source = MADE[experiment]
        table = change(source.table) if experiment == changed else source.table
        return Source(table=table, parameters={**source.parameters, **parameters})

    return str(claims()[row].decide(read).verdict)


def where(**chosen):
    """Return a function that scales `value` by a factor in the rows that are chosen."""

    def scale(factor):
        def change(table):
            fits = np.logical_and.reduce([table[k] == v for k, v in chosen.items()])
            return table.assign(value=np.where(fits, factor * table["value"], table["value"]))

        return change

    return scale


MUTATIONS = [
    (12, "coverage_episodes", where(quantity="paired q")(-1), "does not hold"),
    (12, "coverage_episodes", where(quantity="paired q", driver="speed")(-1), "holds in part"),
    (13, "forecasts", where(quantity="coverage_raw", subject="hau")(1.4), "holds in part"),
    (13, "forecasts", where(quantity="coverage_raw")(1.4), "does not hold"),
    (18, "forecasts", where(quantity="validation_loss", epoch=7)(0.7), "does not hold"),
    (18, "forecasts", where(quantity="parameters")(2), "does not hold"),
    (19, "coverage_episodes", where(quantity="too fast", driver="switch")(0.05), "does not hold"),
    (19, "coverage_episodes", where(quantity="too fast", driver="switch")(3.3), "does not hold"),
    (23, "forecast_cost", lambda t: t.assign(seconds=t.seconds.where(t.seconds > 1e-7, 1e-6)),
     "holds in part"),
    (24, "forecast_cost", lambda t: t.assign(seconds=t.seconds.where(t.seconds < 9e-6, 7e-6)),
     "holds in part"),
    (25, "forecast_cost", lambda t: t.assign(weights_changed=1), "does not hold"),
    (27, "coverage_episodes", where(quantity="miss", carry=True)(2), "does not hold"),
    (27, "coverage_episodes", where(quantity="miss", carry=False)(0.77), "holds"),
    (28, "coverage_episodes", where(quantity="window")(0.8), "does not hold"),
    (28, "coverage_episodes", where(quantity="window", carry=False)(0.8), "holds in part"),
]  # fmt: skip


def test_every_rule_has_a_mutation():
    assert set(EXPECTED) == {row for row, *_ in MUTATIONS}


@pytest.mark.parametrize("row", EXPECTED)
def test_the_rules_on_tables_made_by_hand(row):
    assert verdict(row) == EXPECTED[row]


@pytest.mark.parametrize(("row", "experiment", "change", "expected"), MUTATIONS)
def test_a_spoilt_table_changes_the_verdict(row, experiment, change, expected):
    assert verdict(row, experiment, change) == expected != EXPECTED[row]


def test_fewer_rollouts_than_the_papers_do_not_do():
    assert verdict(18, rollouts=3_000) == "does not hold"


def test_too_few_steps_decide_nothing():
    few = where(quantity="miss", carry=False)(0.77)

    def shrunk(table):
        return few(table).assign(value=lambda t: t.value / 10, n=lambda t: t.n // 10)

    assert verdict(27, "coverage_episodes", shrunk) == "undecided"
