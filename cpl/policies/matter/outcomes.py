"""From what happened under a tracked threshold and under its controls to an answer in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.rng import stream
from cpl.stats import Estimate, hierarchical_weights
from cpl.stats.matched import Ratio, apart, beside_curve, ratio

__all__ = ["CONTROLS", "Answer", "judge"]

CONTROLS = ("shuffled", "mean", "donor", "EWMA")
"""What the tracked threshold is compared with, if it was played: its values in the wrong places,
their mean, those of another stream, a moving average of the scores."""

_RESAMPLES = 1_000


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Whether the threshold matters to what a policy does.

    Attributes:
        verdict: "matters", "does not matter" or "cannot be told".
        gain: Harm below the constants at the tracked threshold's own pace; above 0 is good.
        controls: How much more harm than tracked each control does at equal pace.
        why: Sentences.
    """

    verdict: str
    gain: Estimate
    controls: dict[str, Estimate]
    why: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join([f"the quantile {self.verdict}", *(f"  {line}" for line in self.why)])


def judge(outcomes: pd.DataFrame, *, margin: float = 0.03) -> Answer:
    """Compare harm at equal pace.

    Args:
        outcomes: One row a method, group and unit (or several): `method` ("tracked", "constant" at
            two or more values, any of `CONTROLS`), `value` of a constant, `group` (a training
            seed; one is allowed, and then the answer is about that one), `unit` (an independent
            stream or episode), `harms` and `episodes`, `pace` and `steps` (sums).
        margin: A difference in the share of harms that one would act on.

    Returns:
        *matters* if the harm is below the constants' at equal pace and below the shuffled
        threshold's, where that was played; *does not matter* if it cannot be below the constants'
        by the margin; else *cannot be told*.

    Raises:
        ValueError: If a column or the constants are missing, or somebody was not played on all
            units.
    """
    wanted = {"method", "value", "group", "unit", "harms", "episodes", "pace", "steps"}
    lacking = wanted - set(outcomes)
    if lacking:
        raise ValueError(f"outcomes must have columns {sorted(lacking)}")
    constants = _of(outcomes, "constant")
    if len(np.unique(constants["value"])) < 2:
        raise ValueError("outcomes must have constants of at least two values")
    curve = _ratios(constants, "value")
    own = _ratios(_of(outcomes, "tracked"))
    groups, units = own[0].over.shape
    weights = hierarchical_weights(groups, units, stream(0, "matter"), resamples=_RESAMPLES)
    loss = beside_curve(*own, *curve, weights)
    gain = Estimate(value=-loss.value, low=-loss.high, high=-loss.low, n=loss.n)
    played = sorted(set(CONTROLS) & set(outcomes["method"]), key=CONTROLS.index)
    controls = {name: apart(_ratios(_of(outcomes, name)), own, curve, weights) for name in played}
    verdict = _verdict(gain, controls, margin)
    return Answer(
        verdict=verdict, gain=gain, controls=controls, why=tuple(_why(gain, controls, margin))
    )


def _of(outcomes: pd.DataFrame, method: str) -> pd.DataFrame:
    return pd.DataFrame(outcomes[outcomes["method"] == method])


def _verdict(gain: Estimate, controls: dict[str, Estimate], margin: float) -> str:
    shuffled = controls.get("shuffled")
    if gain.low > 0 and (shuffled is None or shuffled.low > 0):
        return "matters"
    if gain.high < margin:
        return "does not matter"
    return "cannot be told"


def _why(gain: Estimate, controls: dict[str, Estimate], margin: float) -> list[str]:
    lines = [f"harm below constants at equal pace: {_shown(gain)}"]
    said = {
        "shuffled": "shuffled in time it does more harm by",
        "mean": "its mean, always, does more harm by",
        "donor": "another stream's threshold does more harm by",
        "EWMA": "a moving average does more harm by",
    }
    lines += [f"{said[name]}: {_shown(found)}" for name, found in controls.items()]
    if gain.high < 0:
        lines.append("it is worse than a constant: this way of tracking costs more than it brings")
    alike = [n for n, found in controls.items() if -margin < found.low and found.high < margin]
    if gain.low > 0 and "donor" in alike:
        lines.append("a donor does as well: what it knows is the regime, not the moment")
    if gain.low > 0 and "EWMA" in alike:
        lines.append("a moving average would do as well")
    return lines


def _shown(found: Estimate) -> str:
    return f"{found.value:+.3f} ({found.low:+.3f} to {found.high:+.3f})"


def _ratios(rows: pd.DataFrame, *point: str) -> tuple[Ratio, Ratio]:
    labels: list[NDArray[np.generic]] = [rows[c].to_numpy() for c in ("group", "unit", *point)]
    return (
        ratio(rows["harms"].to_numpy(), rows["episodes"].to_numpy(), *labels),
        ratio(rows["pace"].to_numpy(), rows["steps"].to_numpy(), *labels),
    )
