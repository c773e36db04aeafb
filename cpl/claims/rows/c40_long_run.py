"""Row 40: RL policies satisfy the conditions of the guarantee in practice."""

from dataclasses import replace

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import at_least, found
from cpl.claims.rows._table1 import cells_of
from cpl.claims.verdict import Finding
from cpl.policies.table1 import CARRIED

__all__ = ["CLAIM"]

_NEAR = 0.01  # [-] how near to alpha an error rate must be, as in row 27


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    alpha, top = (float(source.parameters[name]) for name in ("alpha", "top_speed_mps"))
    rows = source.where(np.isin(source["policy"].astype(str), CARRIED)).table
    rates = {name: cells.estimate("error_rate", name, top) for name in CARRIED}
    made = found(
        [at_least(name, rate, alpha + _NEAR, below=True) for name, rate in rates.items()],
        n=int(rows["scored"].to_numpy().sum()),
        shown=max(rates.values(), key=lambda rate: rate.value),
    )
    return replace(made, flags=("q is carried over",))


CLAIM = Claim(
    row=40,
    claim="RL policies satisfy the conditions of the guarantee in practice",
    where="Section I",
    rule="greatest long-run error rate of an agent; each at most alpha plus 0.01",
    formula=r"\frac1T\sum_t\mathrm{err}_t\le\alpha",
    unit="1",
    margin=f"{_NEAR:g}: how near to alpha row 27 calls alpha",
    revised=(
        "The first rule added the slack of a bound that no data can exceed. The error "
        "rate is now held against alpha itself."
    ),
    chapter="table1",
    decide=_decide,
)
