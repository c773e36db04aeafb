"""Row 2: the average error tends to alpha for any sequence of data."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._theory import counted, decided
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    paths = read("pathwise")
    final = paths.where(paths["T"] == paths["T"].max())
    sequences, broken = final.total("sequences"), paths.total("above", "below")
    within = np.maximum(abs(paths["largest"]), abs(paths["smallest"])) < paths["bound"]
    near = abs(final["mean_error"] - final["alpha"]) < final["bound"] / final["T"]
    fine = broken == 0 and bool(within.all()) and bool(near.all())
    return counted(decided(fine, sequences, 10_000), min(broken, sequences), sequences, seeds=1)


CLAIM = Claim(
    row=2,
    claim="the average error tends to alpha for any sequence of data",
    where="Section I",
    paper_value="alpha + o(1)",
    rule="share of sequences that leave the finite bound at any horizon; 0 of at least 1e4 random "
    "and adversarial ones",
    formula=r"\frac1T\sum_{t\le T}\mathrm{err}_t\to\alpha",
    unit="1",
    margin="none: one exception refutes it",
    chapter="theory",
    decide=_decide,
)
