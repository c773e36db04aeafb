"""Row 39: RL fails because q is small during training."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.verdict import Finding, rule_r
from cpl.policies.effects import contrast

__all__ = ["CLAIM", "RETRAINED"]

RETRAINED = ("20-40", "20-50")  # roads on which the quantile is large


def _decide(read: Reader) -> Finding:
    source = read("beyond")
    natural = source.where(source["doing"] == "natural").table
    found = [
        contrast(
            natural,
            [
                (sign, {"road": road, "method": name})
                for sign, name in ((1.0, "wide"), (-1.0, "wide_nq"), (-1.0, "rl"), (1.0, "rl_nq"))
            ],
            "duration_s",
        )
        for road in RETRAINED
    ]
    least = min(found, key=lambda estimate: estimate.value)
    compared = np.isin(natural["method"], ["wide", "wide_nq", "rl", "rl_nq"])
    compared &= np.isin(natural["road"], RETRAINED)
    return Finding.of(
        rule_r(found, [None] * len(found)),
        least,
        n=int(natural["episodes"].to_numpy()[compared].sum()),
    )


CLAIM = Claim(
    row=39,
    claim="RL fails because q is small during training",
    where="Section IV-F",
    rule="mean duration gained by observing q, trained where q varies, minus the same in the "
    "paper's training; rule R at 20-40 and 20-50",
    chapter="ignored",
    decide=_decide,
)
