"""Row 55: moving averages and rolling quantiles, which promise nothing, do as well."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._family import MARGIN, finding, versus
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]

_RIVALS = ("EWMA tuned", "ewma", "rolling")


def _decide(read: Reader) -> Finding:
    source = read("gate_family")
    found = [versus(source, rival, "quantile") for rival in _RIVALS]
    if all(estimate.low > -MARGIN and estimate.high < MARGIN for estimate in found):
        verdict = Verdict.HOLDS
    elif any(estimate.low > MARGIN or estimate.high < -MARGIN for estimate in found):
        verdict = Verdict.FAILS
    else:
        verdict = Verdict.UNDECIDED
    farthest = max(found, key=lambda estimate: abs(estimate.value))
    return finding(verdict, farthest, source, "gate")


CLAIM = Claim(
    row=55,
    claim="moving averages and a rolling quantile, which promise nothing, serve the gate as well",
    where="this book, The family",
    rule="crash rate at equal speed (as in row 54) of the gate with an EWMA tuned to the same "
    "coverage in distribution, with one that is not, and with a rolling quantile, minus that with "
    "the headline's tracked quantile: holds if all three intervals lie within +-.03, fails if one "
    "lies wholly outside; shown is the one farthest from 0",
    formula=r"|c_k(\bar v)-c_{\mathrm{quantile}}(\bar v)|<m",
    unit="1",
    margin=f"{MARGIN:g}: a difference that one would drive differently for",
    chapter="family",
    ours=True,
    decide=_decide,
)
