"""Row 39: RL fails because q is small during training."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import DURATION
from cpl.claims.verdict import Finding
from cpl.policies.effects import contrast

__all__ = ["CLAIM", "RETRAINED"]

RETRAINED = ("20-40", "20-50")  # roads on which the quantile is large


def _decide(read: Reader) -> Finding:
    source = read("beyond")
    natural = source.where(source["doing"] == "natural").table
    conditions = [
        Condition(
            name=f"road {road}",
            effect=contrast(
                natural,
                [
                    (sign, {"road": road, "method": name})
                    for sign, name in (
                        (1.0, "wide"), (-1.0, "wide_nq"), (-1.0, "rl"), (1.0, "rl_nq")
                    )
                ],
                "duration_s",
            ),
            margin=DURATION.value,
        )
        for road in RETRAINED
    ]  # fmt: skip
    compared = np.isin(natural["method"], ["wide", "wide_nq", "rl", "rl_nq"])
    compared &= np.isin(natural["road"], RETRAINED)
    return found(conditions, n=int(natural["episodes"].to_numpy()[compared].sum()))


CLAIM = Claim(
    row=39,
    claim="RL fails because q is small during training",
    where="Section IV-F",
    rule=(
        "mean duration gained by observing q, trained where q varies, minus the same in "
        "the paper's training; at 20-40 and 20-50"
    ),
    formula=r"\Delta D^{\text{wide}}_{q}-\Delta D^{\text{narrow}}_{q}>0",
    unit="s",
    margin=str(DURATION),
    revised="A margin.",
    chapter="ignored",
    decide=_decide,
)
