"""The family: thresholds side by side, and what the policies did."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from cpl.conformal.family import MEMBERS
from cpl.figures.style import Card, card, drawn, span

__all__ = ["at_equal_speed", "followed", "rates"]

_HUES = ("C0", "C1", "C2", "C3", "C4")
_DASHES = ("-", "--", "-.", ":", (0, (3, 1, 1, 1)))


@drawn
def followed(scores: ArrayLike, paths: Mapping[str, ArrayLike], *, start: int, end: int) -> Card:
    """Scores as dots, and the thresholds of a few members over them.

    Args:
        scores: Shape (T,).
        paths: Thresholds by member, each (T,); infinite ones leave the picture.
        start: Where the world changes.
        end: Where it is as it was.
    """
    figure, axes = card(height=3.8)
    values = np.asarray(scores)
    axes.plot(values, ".", color="0.7", markersize=2, label="score")
    top = 1.6 * float(np.quantile(values, 0.99))
    for (name, path), hue, dash in zip(paths.items(), _HUES, _DASHES, strict=False):
        shown = np.clip(np.asarray(path), -0.2 * top, top)
        axes.step(
            np.arange(values.size), shown, where="post", color=hue, linestyle=dash, label=name
        )
    span(axes, start, end, "another world")
    axes.set_ylim(-0.2 * top, top)
    axes.set_xlabel("time step t")
    axes.set_ylabel("score, threshold")
    axes.legend(loc="upper left", ncols=3, frameon=False, fontsize="small")
    return figure


def rates(streams: pd.DataFrame, *keys: str) -> pd.DataFrame:
    """Sum `gate_family` up: crash rate, mean speed, coverage and mean margin by some keys."""
    sums = ["episodes", "crashes", "steps", "speed_sum", "scored", "missed", "margin_sum"]
    found = streams.groupby(list(keys), sort=False, as_index=False).agg(dict.fromkeys(sums, "sum"))
    return found.assign(
        crash_rate=found["crashes"] / found["episodes"],
        speed_mps=found["speed_sum"] / found["steps"],
        coverage=1 - found["missed"] / found["scored"].where(found["scored"] > 0),
        margin_m=found["margin_sum"] / found["steps"],
    )


@drawn
def at_equal_speed(constants: pd.DataFrame, others: pd.DataFrame) -> Card:
    """Crash rate over mean speed: the curve of constants, and everybody else as a named point.

    Args:
        constants: From `rates`, by value.
        others: From `rates`, by method.
    """
    figure, axes = card(height=4.6)
    line = constants.sort_values("speed_mps")
    axes.plot(line["speed_mps"], line["crash_rate"], "o-", color="0.6", label="constants")
    columns = (others[name].tolist() for name in ("method", "speed_mps", "crash_rate"))
    for k, (name, speed, share) in enumerate(zip(*columns, strict=True)):
        member = name in MEMBERS
        mark, hue = ("o", _HUES[0]) if member else ("s", _HUES[1])
        axes.plot(speed, share, mark, color=hue, markersize=4)
        axes.annotate(
            name, (speed, share), fontsize=6, xytext=(3, 3 if k % 2 else -7),
            textcoords="offset points",
        )  # fmt: skip
    axes.set_xlabel("mean speed [m/s]")
    axes.set_ylabel("share of episodes that crash")
    return figure
