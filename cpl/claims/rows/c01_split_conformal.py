"""Row 1: split conformal prediction covers with probability at least 1 - alpha."""

import numpy as np
from scipy import stats as sp

from cpl.claims.claim import Claim, Reader, Source
from cpl.claims.verdict import Finding, Verdict
from cpl.stats import split_conformal_law, split_conformal_rank

__all__ = ["CLAIM"]

_SE = 4.0  # [standard errors] how far chance may go
_TAIL = 2 * sp.norm.sf(_SE)  # the same as a two-sided probability


def _decide(read: Reader) -> Finding:
    source = read("split_conformal")
    alpha, n = source.parameters["alpha"], source.parameters["n"]
    target = split_conformal_rank(n, alpha) / (n + 1)
    kinds = {kind: source.where(source["kind"] == kind) for kind in sorted(set(source["kind"]))}
    fine = {"independent", "shared level", "urn", "ties"} <= kinds.keys()
    for kind, part in kinds.items():
        draws = part.total("draws")
        off = part.total("covered") / draws - target
        allowed = _SE * np.sqrt(target * (1 - target) / draws)
        # With ties more is covered, never less.
        fine &= draws >= 100_000 and (off >= -allowed if kind == "ties" else abs(off) <= allowed)
        fine &= kind in ("urn", "ties") or _follows_beta(part, n, alpha)
    # The coverage given the calibration scores is less noisy than counting covered test scores.
    exact = source.where((source["kind"] == "independent") | (source["kind"] == "shared level"))
    mean = float(exact["coverage_sum"].sum() / exact.total("draws"))
    error = split_conformal_law(n, alpha).std() / np.sqrt(exact.total("draws"))
    half = float(sp.norm.ppf(0.975) * error)
    return Finding(
        verdict=Verdict.HOLDS if fine else Verdict.FAILS,
        value=mean,
        low=mean - half,
        high=mean + half,
        n=source.total("draws"),
        n_seeds=1,
    )


def _follows_beta(part: Source, n: int, alpha: float) -> bool:
    """Compare mean, variance and shape of the coverage with the Beta law, from sums."""
    law, draws = split_conformal_law(n, alpha), part.total("draws")
    mean, variance, excess = (float(moment) for moment in law.stats(moments="mvk"))
    average = part["coverage_sum"].sum() / draws
    spread = part["coverage_sumsq"].sum() / draws - average**2
    cells = [part.total(name) for name in part.table.columns if name.startswith("pit_")]
    return bool(
        abs(average - mean) <= _SE * np.sqrt(variance / draws)
        and abs(spread - variance) <= _SE * variance * np.sqrt((excess + 2) / draws)
        and sum(cells) == draws
        and sp.chisquare(cells).pvalue >= _TAIL
    )


CLAIM = Claim(
    row=1,
    claim="split conformal prediction covers with probability at least 1 - alpha",
    where="Section I",
    paper_value=">= 1 - alpha",
    rule="mean coverage over calibration sets; in 1e5 draws of each kind mean, variance and shape "
    "meet the Beta law within 4 standard errors, and ties only add",
    formula=r"P(s_{n+1}\le s_{(k)})\ge 1-\alpha",
    unit="1",
    margin="four standard errors of the mean, of the variance and of the shape: what chance does",
    chapter="promise",
    decide=_decide,
)
