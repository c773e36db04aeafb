"""Rows 54 to 57 on invented tables in which one can see what is true."""

import numpy as np
import pandas as pd
import pytest

from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.claims.rows.c54_any_tracker import PROMISING
from cpl.claims.verdict import Verdict
from cpl.conformal.family import MEMBERS

RIVALS = ("quantile", "EWMA tuned")


def table(above, gaps=None):
    """Return a table in which a method lies ``above[method]`` over a straight curve of constants.

    Crash shares are .2 at 20 m/s and .4 at 30; everybody else drives at 25.
    """
    rng, rows = np.random.default_rng(0), []
    for setting in ("gate", "switch"):
        for pair in range(5):
            for stream in range(8):
                shift = 0.01 * rng.normal()
                for value, speed, share in ((1.0, 30.0, 0.4), (5.0, 20.0, 0.2)):
                    rows.append(
                        (setting, pair, stream, "constant", value, share + shift, speed, 0.05)
                    )
                for name in (*MEMBERS, *RIVALS):
                    share = 0.3 + above.get(name, 0.0) + shift + 0.004 * rng.normal()
                    miss = 0.05 + (gaps or {}).get(name, 0.0)
                    rows.append((setting, pair, stream, name, 0.0, share, 25.0, miss))
    names = ["setting", "pair", "stream", "method", "value", "share", "speed", "miss"]
    made = pd.DataFrame(rows, columns=names).assign(world="in", episodes=1000, steps=1000)
    made["crashes"] = 1000 * made.pop("share")
    made["speed_sum"] = 1000 * made.pop("speed")
    made["scored"], made["missed"] = 1000, 1000 * made.pop("miss")
    return made


def verdict(row, made):
    found = claims()[row].decide(lambda _: Source(table=made, parameters={"alpha": 0.05}))
    assert found.low <= found.value <= found.high
    return found.verdict


@pytest.mark.parametrize(
    ("above", "expected"),
    [
        (dict.fromkeys(PROMISING, -0.05), Verdict.HOLDS),
        (dict.fromkeys(PROMISING[:4], -0.05), Verdict.IN_PART),
        ({}, Verdict.FAILS),
        (dict.fromkeys(PROMISING, 0.05), Verdict.FAILS),
    ],
)
def test_any_tracker(above, expected):
    assert verdict(54, table(above)) == expected


@pytest.mark.parametrize(
    ("above", "expected"),
    [
        ({}, Verdict.HOLDS),
        (dict.fromkeys(("quantile", "EWMA tuned", "ewma", "rolling"), -0.1), Verdict.HOLDS),
        ({"quantile": -0.1}, Verdict.FAILS),
        ({"rolling": 0.03}, Verdict.UNDECIDED),
    ],
)
def test_plain_rivals(above, expected):
    assert verdict(55, table(above)) == expected


def test_coverage_ranks():
    gaps = {name: 0.01 * k for k, name in enumerate(MEMBERS)}
    assert verdict(56, table(gaps, gaps)) == Verdict.HOLDS
    assert verdict(56, table({name: -gap for name, gap in gaps.items()}, gaps)) == Verdict.FAILS


@pytest.mark.parametrize(
    ("above", "expected"),
    [
        ({}, Verdict.HOLDS),
        (dict.fromkeys(MEMBERS, 0.1), Verdict.HOLDS),
        ({"kt": -0.02}, Verdict.IN_PART),
        ({"kt": -0.05}, Verdict.FAILS),
    ],
)
def test_the_switch(above, expected):
    assert verdict(57, table(above)) == expected
