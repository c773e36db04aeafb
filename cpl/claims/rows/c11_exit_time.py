"""Row 11: a conformal policy quickly leaves regimes in which its uncertainty is wrong."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    streams = read("exit_time")
    late = streams["exit"] > streams["allowed"]
    n = len(streams)
    verdict = Verdict.FAILS if late.any() else Verdict.HOLDS if n >= 100 else Verdict.UNDECIDED
    p99 = float(np.quantile(streams["exit"], 0.99))
    seeds = len(np.unique(streams["pair"]))
    return Finding(verdict=verdict, value=p99, n=n, n_seeds=seeds)


CLAIM = Claim(
    row=11,
    claim="a conformal policy quickly leaves regimes in which its uncertainty is wrong",
    where="Section VI",
    rule="99th percentile of the time until q >= s after a step shift; at most the theory's",
    chapter="switch",
    decide=_decide,
)
