"""Row 9: Corollary: an eventually safe policy has error rate at most alpha + o(1)."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._theory import certified, counted, decided
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    processes = read("eventually_safe")
    broken, safe = processes.total("violations"), processes.total("safe")
    bounded = processes.where(processes["condition"] == "bounded")
    unbounded = processes.where(processes["condition"] == "unbounded")
    fine = (
        broken == 0
        and bool((processes["ratio"] < 1).all())
        and bounded.total("safe") == bounded.total("processes") > 0
        and bool((unbounded["unsafe_broken"] > 0).all())  # else nothing would depend on safety
        and certified(
            read,
            "window bound under an eventually safe policy",
            "bounded scores are eventually safe",
        )
    )
    return counted(decided(fine, safe, 1_000), broken, safe, seeds=0)


CLAIM = Claim(
    row=9,
    claim="Corollary: an eventually safe policy has error rate at most alpha + o(1)",
    where="Section III-B, Corollary 1",
    paper_value="alpha + o(1)",
    rule="share of safe processes that leave the finite bound; 0 of all small decision processes "
    "(bounded scores need no assumption), and unsafe ones do leave it",
    formula=r"\frac1T\sum_{t\le T}\mathrm{err}_t\le\alpha+o(1)",
    unit="1",
    margin="none: one exception refutes it",
    chapter="stretching",
    decide=_decide,
)
