"""Row 4: Theorem 1: in every window the error rate is at most alpha + (B + eta) / (eta W)."""

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.rows._theory import certified, counted, erratum
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    settings = read("windows")
    windows, printed = settings.total("windows"), settings.total("printed")
    true = settings.total("corrected", "beyond_exact") == 0 and certified(
        read, "window bound is strict and two-sided", "telescoping equality"
    )
    example = settings.where(settings["origin"] == "counterexample")
    false = example.total("printed") > 0 and certified(read, "printed window of Theorem 1 fails")
    return counted(erratum(false, true, windows, 1_000_000), printed, windows, seeds=1)


CLAIM = Claim(
    row=4,
    claim="Theorem 1: in every window the error rate is at most alpha + (B + eta) / (eta W)",
    where="Section III-A, Theorem 1",
    paper_value="all W and T0",
    rule="share of windows that break the printed form (W + 1 terms); the corrected form (W terms) "
    "must hold in at least 1e6 windows and be proved, the counterexample be found",
    formula=r"\frac1W\sum_{t=T_0+1}^{T_0+W}\mathrm{err}_t\le\alpha+\frac{B+\eta}{\eta W}",
    unit="1",
    margin="none: one exception refutes it",
    chapter="theory",
    flags=(INCONSISTENT,),
    decide=_decide,
)
