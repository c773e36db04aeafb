"""Row 8: a two-sided guarantee exists."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._theory import certified, counted, decided
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    settings = read("windows")
    below, n = settings.total("lower"), settings.total("windows")
    fine = below + read("pathwise").total("below") == 0 and certified(
        read, "window bound is strict and two-sided", "lower worst case is attained"
    )
    return counted(decided(fine, n, 1_000_000), below, n, seeds=1)


CLAIM = Claim(
    row=8,
    claim="a two-sided guarantee exists",
    where="Section III-A, after Theorem 1",
    rule="share of windows below alpha W - B/eta - 1; 0 in at least 1e6, and proved",
    formula=r"\alpha W-\frac B\eta-1\le\sum\mathrm{err}_t\le\alpha W+\frac B\eta+1",
    unit="1",
    margin="none: one exception refutes it",
    chapter="theory",
    decide=_decide,
)
