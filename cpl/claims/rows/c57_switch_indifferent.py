"""Row 57: under the paper's switch, no rule of the family helps."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._family import MARGIN, finding, members, significant
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("gate_family")
    found = members(source, "switch")
    better = significant(found, -1)
    large = {name for name in better if found[name].value <= -MARGIN}
    if large:
        verdict = Verdict.FAILS
    elif better:
        verdict = Verdict.IN_PART
    elif all(estimate.low > -MARGIN for estimate in found.values()):
        verdict = Verdict.HOLDS
    else:
        verdict = Verdict.UNDECIDED
    best = min(found.values(), key=lambda estimate: estimate.value)
    return finding(verdict, best, source, "switch")


CLAIM = Claim(
    row=57,
    claim="under the paper's switch no rule of the family is better than no quantile",
    where="this book, The family",
    rule="crash rate of the switch (persistence, q_safe .6, road 20-40) with each member, minus "
    "that of the switch without a quantile whose q_safe gives the same pooled mean speed: holds "
    "if none is below 0 after Holm's correction and all intervals lie above -.03, in part if some "
    "are below 0 but by less than .03, fails if one is below -.03; shown is the least",
    formula=r"c_{\mathrm{none}}(\bar v)-c_k(\bar v)\le0\quad\forall k",
    unit="1",
    margin=f"{MARGIN:g}: a difference that one would drive differently for",
    chapter="family",
    ours=True,
    decide=_decide,
)
