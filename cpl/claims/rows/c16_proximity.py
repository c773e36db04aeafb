"""Row 16: l_tilde = 2 / (1 + exp(0.1 l)) lies in [0, 1]."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    grid = read("proximity")
    l_tilde = grid["l_tilde"][np.argsort(grid["l_m"])]
    inside = bool((l_tilde > 0).all() and (l_tilde <= 1).all() and l_tilde[0] == 1)
    falls = bool((np.diff(l_tilde) < 0).all())
    return Finding(
        verdict=Verdict.HOLDS if inside and falls else Verdict.FAILS,
        value=float(l_tilde.max()),
        low=float(l_tilde.min()),
        high=float(l_tilde.max()),
        n=len(grid),
        n_seeds=0,
    )


CLAIM = Claim(
    row=16,
    claim="l_tilde = 2 / (1 + exp(0.1 l)) lies in [0, 1]",
    where="Section IV-C",
    paper_value="[0, 1]",
    rule="least and greatest l_tilde; all in (0, 1] and strictly decreasing in distance",
    formula=r"\tilde\ell=\frac{2}{1+e^{0.1\ell}}\in[0,1]",
    unit="1",
    margin="none: one exception refutes it",
    chapter="drive",
    decide=_decide,
)
