"""Row 41: a hand-set threshold makes tuning hard."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._table1 import TOPS, cells_of, finding
from cpl.claims.verdict import Finding, rule_r
from cpl.stats import interval

__all__ = ["CLAIM"]

_BESIDE = ("switch above", "switch below")


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    if cells.groups < 2:
        raise ValueError(f"the spread between training seeds needs two, got {cells.groups!r}")
    conditions, changes = [], []
    for top in TOPS:
        values = {
            name: (cells.value("duration_s", name, top), cells.resampled("duration_s", name, top))
            for name in ("switch", "switch above", "switch below")
        }
        change, drawn = (
            max(abs(values[side][0] - values["switch"][0]) for side in _BESIDE),
            np.max([np.abs(values[side][1] - values["switch"][1]) for side in _BESIDE], axis=0),
        )
        spread = float(np.std(cells.by_pair("duration_s", "switch", top), ddof=1))
        changes.append(interval(change, drawn, groups=cells.groups))
        conditions.append(interval(change - spread, drawn, groups=cells.groups))
    verdict = rule_r(conditions, [None] * len(conditions))
    return finding(verdict, max(changes, key=lambda change: change.value), source)


CLAIM = Claim(
    row=41,
    claim="a hand-set threshold makes tuning hard",
    where="Section I",
    rule="greatest change of duration when q_safe moves by 0.1; beyond the spread over training "
    "seeds in three ranges",
    chapter="table1",
    decide=_decide,
)
