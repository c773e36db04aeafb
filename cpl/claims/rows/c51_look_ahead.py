"""Row 51: looking ahead with the ego car's own model pays, without any quantile."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._gate import beside, changing, decided
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]

_CONSTANT = 3.0  # [m]


def _decide(read: Reader) -> Finding:
    table = changing(read("gate_controls"))
    own = table.where((table["method"] == "constant") & (table["value"] == _CONSTANT))
    caps = table.where(np.isin(table["method"], ["speed cap", "pi_speed"]))
    # Without a cap is a cap that nobody reaches.
    points = np.where(caps["method"] == "speed cap", caps["value"], np.inf)
    return decided(beside(own, caps, points), own)


CLAIM = Claim(
    row=51,
    claim="looking ahead with the ego car's own model pays, without any quantile",
    where="this book, Where the quantile earns its place",
    rule="crash rate of the gate with a constant margin of 3 m over the changing stream, minus "
    "that of pi_speed under a speed cap at the same pooled mean speed; the interval must lie "
    "below 0",
    chapter="earns",
    ours=True,
    decide=_decide,
)
