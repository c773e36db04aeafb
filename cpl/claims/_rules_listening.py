"""How the claims about why agents do not use the quantile are decided."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from cpl.claims._reading import Reader
from cpl.claims._verdicts import Finding, rule_r
from cpl.policies.effects import contrast, over_pairs

__all__ = ["RETRAINED", "RULES"]

RETRAINED = ("20-40", "20-50")
"""The roads on which the agents of row 39 are compared: those on which the quantile is large."""


def _conservative(read: Reader) -> Finding:
    """Row 37: what rl_2's braking is told by q l_hat beside q, on episodes that were not fitted."""
    source = read("why_inside")
    table = source.where((source["agent"] == "rl_2") & (source["question"] == "risk")).table
    wide = table.pivot_table(index="pair", columns="of", values="value")
    gain = over_pairs(pd.Series(wide["q and q l_hat"] - wide["q"]))
    return Finding(
        verdict=rule_r([gain], [None]),
        value=gain.value,
        low=gain.low,
        high=gain.high,
        n=int(table.drop_duplicates("pair")["n"].to_numpy().sum()),
        n_seeds=gain.n,
    )


def _small_in_training(read: Reader) -> Finding:
    """Row 39: is q worth more to an agent in whose training it varied?"""
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
    return Finding(
        verdict=rule_r(found, [None] * len(found)),
        value=least.value,
        low=least.low,
        high=least.high,
        n=int(natural["episodes"].to_numpy()[compared].sum()),
        n_seeds=least.n,
    )


RULES: dict[int, Callable[[Reader], Finding]] = {37: _conservative, 39: _small_in_training}
"""The rules by row."""
