"""Row 56: who keeps its coverage in every world lets its gate crash less."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats as sp

from cpl.claims.claim import Claim, Reader, Source
from cpl.claims.rows._family import finding, of_method
from cpl.claims.rows._gate import weights_of
from cpl.claims.verdict import Finding, Verdict
from cpl.conformal.family import MEMBERS
from cpl.stats import interval, sums
from cpl.stats.fronts import at_levels
from cpl.stats.matched import ratio

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("gate_family")
    table = source.where(source["setting"] == "gate")
    alpha = float(source.parameters["alpha"])
    constants = table.where(table["method"] == "constant")
    speeds, crashes = _points(constants, constants["value"])
    gaps, excess = [], []
    for name in MEMBERS:
        own = of_method(table, name)
        missed, scored = _summed(own, "missed", own["world"]), _summed(own, "scored", own["world"])
        gaps.append(np.abs(missed / np.maximum(scored, 1.0) - alpha).mean(axis=1))
        mine, share = _points(own, np.zeros(len(own)))
        excess.append((share - at_levels(speeds, crashes, mine))[:, 0])
    ranked = np.array(
        [_rank(*both) for both in zip(np.array(gaps).T, np.array(excess).T, strict=True)]
    )
    estimate = interval(float(ranked[0]), ranked[1:], groups=len(np.unique(table["pair"])))
    estimate = replace(estimate, low=max(estimate.low, -1.0), high=min(estimate.high, 1.0))
    verdict = (
        Verdict.HOLDS if estimate.low > 0
        else Verdict.FAILS if estimate.high <= 0 or estimate.high < _HALF
        else Verdict.UNDECIDED
    )  # fmt: skip
    return finding(verdict, estimate, source, "gate")


_HALF = 0.3  # [-] rank correlation: less would not help to choose


def _summed(own: Source, column: str, point: NDArray[np.generic]) -> NDArray[np.float64]:
    """Sum a column over pairs and streams, first as it is and then in every resample."""
    each = ratio(own[column], own[column], own["pair"], own["stream"], point).over
    total, drawn = sums(each, weights_of(each))
    return np.concatenate([total[None], drawn])


def _points(
    own: Source, point: NDArray[np.generic]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    steps, episodes = (_summed(own, name, point) for name in ("steps", "episodes"))
    return _summed(own, "speed_sum", point) / steps, _summed(own, "crashes", point) / episodes


def _rank(a: NDArray[np.floating], b: NDArray[np.floating]) -> float:
    """Rank correlation; 0 where one of the two does not vary."""
    ranked = sp.rankdata(a), sp.rankdata(b)
    if min(np.std(part) for part in ranked) == 0:
        return 0.0
    return float(np.corrcoef(*ranked)[0, 1])


CLAIM = Claim(
    row=56,
    claim="the better a rule keeps its coverage in every world, the less often its gate crashes",
    where="this book, The family",
    rule="rank correlation over all members of the mean distance, world by world, of the error "
    "rate from alpha, and of the crash rate at equal speed (as in row 54): holds if the interval "
    "lies above 0, fails if it lies below .3",
    formula=r"\rho\bigl(\overline{|C_w-\alpha|},\,c(\bar v)\bigr)>0",
    unit="1",
    margin=f"{_HALF:g}: a smaller correlation would not help to choose",
    chapter="family",
    ours=True,
    decide=_decide,
)
