"""Row 45: medium path: better in distribution, because the predictor is poor there."""

from cpl.claims.claim import HARDWARE, Claim, Reader
from cpl.claims.rows._twin import AS, NOT, OPEN, combined, entry, number, side
from cpl.claims.verdict import Leaning

__all__ = ["CLAIM"]


def _in_the_twin(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    inside = entry(logs, 45, "start_end_m", "rectangle", "in")
    auc = {
        shape: entry(logs, 45, "auc", shape, "in") for shape in ("triangle", "rectangle", "hexagon")
    }
    brier = entry(logs, 45, "brier", "rectangle", "in")
    here, others = auc["rectangle"], [auc["triangle"], auc["hexagon"]]
    poor = OPEN
    if here.high < min(each.low for each in others):
        poor = AS
    elif here.low > min(each.high for each in others):
        poor = NOT
    text = (
        f"difference in distribution {number(inside, 'm')}; AUC of the predictor there "
        f"{here.value:.3f}, on the triangle {auc['triangle'].value:.3f}, on the hexagon "
        f"{auc['hexagon'].value:.3f}; Brier score there {brier.value:.3f}"
    )
    return Leaning(leans=combined([side(inside, below=0.0), poor]), text=text)


CLAIM = Claim(
    row=45,
    claim="medium path: better in distribution, because the predictor is poor there",
    where="Section V-D",
    rule="AUC and Brier score of the predictor on each path",
    formula=r"\Delta e_{\mathrm{in}}>0",
    unit="m",
    margin="none: only the robot decides",
    chapter="run_it",
    flags=(HARDWARE,),
    in_the_twin=_in_the_twin,
)
