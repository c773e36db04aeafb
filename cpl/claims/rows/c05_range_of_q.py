"""Row 5: the quantile stays in [-(1 - alpha) eta, B + alpha eta]."""

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.rows._theory import certified, counted, erratum
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    settings = read("quantile_range")
    inside = (settings["q_min"] >= settings["low"]) & (settings["q_max"] < settings["high"])
    true = bool(inside.all()) and not settings["leaves"].any()
    prompt = settings.where(settings["delay"] == 1)  # the paper's own setting
    too_low, too_high = prompt["leaves_printed_low"], prompt["leaves_printed_high"]
    true = true and certified(read, "range of the quantile")
    false = bool(too_low.any() and too_high.any()) and certified(
        read, "printed upper end of the range fails", "printed lower end of the range fails"
    )
    left, n = int((too_low | too_high).sum()), len(prompt)
    return counted(erratum(false, true, n, 100), left, n, seeds=1)


CLAIM = Claim(
    row=5,
    claim="the quantile stays in [-(1 - alpha) eta, B + alpha eta]",
    where="Section III-A, proof of Theorem 1",
    paper_value="[-(1 - alpha) eta, B + alpha eta]",
    rule="share of settings that leave the printed range; the corrected range [-alpha eta, "
    "B + (1 - alpha) eta) must hold in all and be proved",
    formula=r"q_t\in[-(1-\alpha)\eta,\;B+\alpha\eta]",
    unit="1",
    margin="none: one exception refutes it",
    chapter="theory",
    flags=(INCONSISTENT,),
    decide=_decide,
)
