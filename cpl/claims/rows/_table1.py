"""What the rules about Table I share, from episodes of ten training seeds.

The switch of the table is the one at the threshold 0.3, which a commented line of the paper's
source gives and whose numbers agree with the printed ones; where the claim is about the switch as
such (row 34), the threshold chosen on validation seeds has to agree.
"""

from functools import lru_cache

import numpy as np

from cpl.claims.claim import Reader, Source
from cpl.claims.verdict import Finding, Verdict
from cpl.policies.table1 import ROWS, Cells, tabulate
from cpl.stats import Estimate

__all__ = ["LEVEL", "SHIFTED", "TOPS", "cells_of", "driven", "finding"]

TOPS = (30.0, 40.0, 50.0)  # [m/s] of the three ranges
SHIFTED = (40.0, 50.0)  # [m/s] of those beyond training
LEVEL = 0.05


def cells_of(read: Reader) -> tuple[Source, Cells]:
    """Return the episodes, and the table that they make."""
    source = read("table1")
    return source, _tabulated(source)


@lru_cache(maxsize=2)
def _tabulated(source: Source) -> Cells:
    return tabulate(source.table)


@lru_cache(maxsize=2)
def driven(source: Source) -> int:
    """Count the episodes of the table's own rows."""
    return int(np.isin(source["policy"].astype(str), ROWS).sum())


def finding(verdict: Verdict, estimate: Estimate, source: Source) -> Finding:
    """Return a finding that rests on one estimate from the table's episodes."""
    return Finding.of(verdict, estimate, n=driven(source))
