"""Row 51: looking ahead with the ego car's own model pays, without any quantile."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import CRASH
from cpl.claims.rows._gate import beside, changing, crashes_less
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]

_CONSTANT = 3.0  # [m]


def _decide(read: Reader) -> Finding:
    table = changing(read("gate_controls"))
    own = table.where((table["method"] == "constant") & (table["value"] == _CONSTANT))
    caps = table.where(np.isin(table["method"], ["speed cap", "pi_speed"]))
    # Without a cap is a cap that nobody reaches.
    points = np.where(caps["method"] == "speed cap", caps["value"], np.inf)
    fewer = crashes_less(beside(own, caps, points))
    return found(
        [Condition(name="crashes less than under a cap", effect=fewer, margin=CRASH.value)],
        n=own.total("episodes"),
    )


CLAIM = Claim(
    row=51,
    claim="looking ahead with the ego car's own model pays, without any quantile",
    where="this book, Where the quantile earns its place",
    rule=(
        "how much less often the gate with a constant margin of 3 m crashes over the "
        "changing stream than pi_speed under a speed cap at the same pooled mean speed"
    ),
    formula=r"c_{\mathrm{cap}}(\bar v)-c_{\mathrm{gate}}(\bar v)>0",
    unit="1",
    margin=str(CRASH),
    revised="A margin; the sign is turned, so that fewer crashes are positive.",
    chapter="earns",
    ours=True,
    decide=_decide,
)
