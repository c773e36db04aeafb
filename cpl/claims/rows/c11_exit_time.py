"""Row 11: a conformal policy quickly leaves regimes in which its uncertainty is wrong."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import at_least, found
from cpl.claims.verdict import Finding
from cpl.rng import stream
from cpl.stats import interval

__all__ = ["CLAIM"]

_QUICK = 9.7  # [s] half of the 19.4 s that pi_speed lasts at 20-40 in Table I
_RESAMPLES = 2_000


def _decide(read: Reader) -> Finding:
    streams = read("exit_time")
    by_pair = [streams["exit"][streams["pair"] == pair] for pair in np.unique(streams["pair"])]
    rng, groups = stream(0, "claims", "exit time"), len(by_pair)
    drawn = [
        _late(np.concatenate([by_pair[k] for k in rng.integers(groups, size=groups)]))
        for _ in range(_RESAMPLES)
    ]
    late = interval(_late(streams["exit"]), drawn, groups=groups)
    return found(
        [at_least("99th percentile", late, _QUICK, below=True)], n=len(streams), shown=late
    )


def _late(exits: np.ndarray) -> float:
    return float(np.quantile(exits, 0.99))


CLAIM = Claim(
    row=11,
    claim="a conformal policy quickly leaves regimes in which its uncertainty is wrong",
    where="Section VI",
    rule=(
        "99th percentile of the time until q >= s after a step shift; below 9.7 s, half "
        "of the 19.4 s that pi_speed lasts at 20-40 in Table I"
    ),
    formula=r"P_{99}(\text{exit time})<9.7\,\mathrm{s}",
    unit="s",
    margin="none: 9.7 s is the level, half of the 19.4 s that pi_speed lasts at 20-40 in Table I",
    revised=(
        "The first rule compared with a bound of the theory, which no data can exceed. "
        "Now quick means less than half of what the fast policy survives, and the "
        "percentile has an interval."
    ),
    chapter="switch",
    decide=_decide,
)
