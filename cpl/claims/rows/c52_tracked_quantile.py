"""Row 52: the tracked quantile of the look-ahead's error pays where the world changes unnoticed."""

from dataclasses import replace

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._gate import beside, changing, decided
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    table = changing(read("gate_stream"))
    own = table.where(table["method"] == "quantile")
    constants = table.where(table["method"] == "constant")
    found = decided(beside(own, constants, constants["value"]), own)
    mixed = beside(own, constants, constants["value"], mixtures=True)
    if found.verdict is Verdict.HOLDS and mixed.high >= 0:
        return replace(found, flags=("not beside mixtures of constants",))
    return found


CLAIM = Claim(
    row=52,
    claim="the tracked quantile of the look-ahead's error pays where the world changes unnoticed",
    where="this book, Where the quantile earns its place",
    rule="crash rate of the gate with the quantile over the changing stream, minus that of the "
    "best constant margin at the same pooled mean speed; the interval must lie below 0",
    chapter="earns",
    ours=True,
    decide=_decide,
)
