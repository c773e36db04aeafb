"""Row 54: a tracked quantile pays under the look-ahead, whichever rule tracks it."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._family import finding, members, significant
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM", "PROMISING"]

PROMISING = (
    "aci", "cop", "decaying", "eci", "fixed", "kt", "pi", "pid", "running_max", "sf_ogd", "up_ocp",
)  # fmt: skip
"""The members with a guarantee for the share of errors on bounded scores."""

_WORTH = 0.01  # [-] of crash share: a gain below is none


def _decide(read: Reader) -> Finding:
    source = read("gate_family")
    found = members(source, "gate", PROMISING)
    better, worse = significant(found, -1), significant(found, 1)
    if len(better) == len(found):
        verdict = Verdict.HOLDS
    elif worse or any(estimate.low > -_WORTH for estimate in found.values()):
        verdict = Verdict.IN_PART if better else Verdict.FAILS
    else:
        verdict = Verdict.IN_PART if better else Verdict.UNDECIDED
    worst = max(found.values(), key=lambda estimate: estimate.value)
    return finding(verdict, worst, source, "gate")


CLAIM = Claim(
    row=54,
    claim="whichever rule with a guarantee tracks it, the quantile of the look-ahead's error pays",
    where="this book, The family",
    rule="crash rate of the gate with each of the eleven members that promise a share of errors, "
    "minus that of the best constant at the same pooled mean speed, over the changing stream: "
    "holds if all are below 0 after Holm's correction, in part if some are, fails if none is and "
    "some member is above 0 after the correction or its interval lies above -.01; shown is the "
    "largest",
    formula=r"c_{\mathrm{constant}}(\bar v)-c_k(\bar v)>0\quad\forall k",
    unit="1",
    margin=f"{_WORTH:g}: a crash in a hundred episodes, fixed with the rule",
    chapter="family",
    ours=True,
    decide=_decide,
)
