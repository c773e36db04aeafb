"""Row 29: the 42 cells of Table I."""

from dataclasses import replace

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import at_least, found
from cpl.claims.rows._table1 import cells_of, driven
from cpl.claims.verdict import Finding
from cpl.policies.table1 import MARGINS, PRINTED, SWITCH, Cells
from cpl.stats import Estimate, interval

__all__ = ["CLAIM"]

_MOST = 0.9  # of the cells must be the same


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    same = _share(cells)
    return found([at_least("share of the cells", same, _MOST)], n=driven(source), shown=same)


def _share(cells: Cells) -> Estimate:
    """Estimate the share of the 42 means that are the printed ones, within 2 s and 1 m/s."""
    off = [
        np.abs(np.append(cells.resampled(name, row, top), cells.value(name, row, top)) - printed)
        <= MARGINS[name]
        for (policy, top), cell in PRINTED.items()
        for row in [SWITCH if policy == SWITCH else policy]
        for name, printed in zip(MARGINS, (cell.duration_s, cell.speed_mps), strict=True)
    ]
    shares = np.mean(off, axis=0)
    found = interval(float(shares[-1]), shares[:-1], groups=cells.groups)
    return replace(found, low=max(found.low, 0.0), high=min(found.high, 1.0))


CLAIM = Claim(
    row=29,
    claim="the 42 cells of Table I",
    where="Table I",
    paper_value="42 cells",
    rule="share of the 42 means within 2 s and 1 m/s of the printed ones; above 90 %",
    formula=r"|\bar x_{ij}-x_{ij}^{\mathrm{printed}}|\le m,\quad 42\ \text{cells}",
    unit="1",
    margin="0.9 is the level: nine cells of ten within 2 s and 1 m/s",
    revised=(
        "The ends counted open cells as no and as yes, which is no interval. The share of"
        " means within the margins is now resampled over seeds."
    ),
    chapter="table1",
    decide=_decide,
)
