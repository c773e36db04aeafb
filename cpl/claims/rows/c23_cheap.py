"""Row 23: it adds almost no computation."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._forecast import multiples, time_and_operations
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]

_SMALL = 0.01  # "almost no" computation


def _decide(read: Reader) -> Finding:
    shares = multiples(read("forecast_cost"), "update, compiled")
    return time_and_operations(shares, [share < _SMALL for share in shares])


CLAIM = Claim(
    row=23,
    claim="it adds almost no computation",
    where="Section IV-F",
    rule="time of the quantile's update as a share of the predictor's forward pass, both compiled, "
    "and its operations; below 1 % each",
    formula=r"t_{\mathrm{update}}\ll t_{\mathrm{forward}}",
    unit="1",
    margin=(
        "0.01: almost no is below one per cent; operations are counted, time was taken "
        "once on one machine"
    ),
    chapter="forecast",
    decide=_decide,
)
