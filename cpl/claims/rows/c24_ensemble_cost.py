"""Row 24: ensembles cost five times the computation."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._forecast import multiples, time_and_operations
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]

_FIVE = (4.5, 5.5)  # "five times"


def _decide(read: Reader) -> Finding:
    low, high = _FIVE
    ratios = multiples(read("forecast_cost"), "ensemble")
    return time_and_operations(ratios, [low <= ratio <= high for ratio in ratios])


CLAIM = Claim(
    row=24,
    claim="ensembles cost five times the computation",
    where="Section IV-F",
    paper_value="5",
    rule="ratio of time and of operations, ensemble to single predictor; between 4.5 and 5.5",
    formula=r"t_{\mathrm{ensemble}}=5\,t_{\mathrm{forward}}",
    unit="1",
    margin=(
        "0.5: between 4.5 and 5.5 is five; operations are counted, time was taken "
        "once on one machine"
    ),
    chapter="forecast",
    decide=_decide,
)
