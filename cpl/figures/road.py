"""Pictures of rides on the highway: the road from above, and forecasts along a ride."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.transforms import Affine2D
from numpy.typing import ArrayLike

from cpl.figures.style import BLUE, GREY, INK, RED, Card, cards, drawn, level, note, span

__all__ = ["forecasts", "moments", "rides"]

_LANE = 4.0  # [m] width
_LENGTH, _BREADTH = 5.0, 2.0  # [m] of a car
_BAND = "#b9dcf0"  # a pale BLUE that stands out from the shading of a span


@drawn
def moments(frames: Mapping[str, pd.DataFrame], *, lanes_count: int, ahead: float = 120.0) -> Card:
    """The road from above at a few moments, the ego vehicle at the same place in each.

    Args:
        frames: by name of the moment, one row a vehicle with `vehicle` (0 is the ego), `x_m`,
            `y_m`, `heading_rad` and `crashed`.
        lanes_count: lanes to draw.
        ahead: how far to look along the road [m].

    Raises:
        ValueError: if a moment has no ego vehicle.
    """
    figure, panels = cards(len(frames), 0.35 + 1.15 * len(frames))
    for axes, (name, frame) in zip(panels, frames.items(), strict=True):
        ego = frame.loc[frame["vehicle"] == 0, "x_m"].tolist()
        if len(ego) != 1:
            raise ValueError(f"frames[{name!r}] must have one row with vehicle 0, not {len(ego)}")
        _lanes(axes, lanes_count)
        here = frame.assign(x_m=frame["x_m"] - ego[0])
        for car in here[here["x_m"].between(-30, ahead)].itertuples():
            _car(axes, car)
        axes.set_title(name)
        axes.set(xlim=(-30, ahead), ylim=(_LANE * (lanes_count - 0.5), -_LANE / 2), yticks=[])
        axes.grid(visible=False)
        axes.spines["left"].set_visible(False)
    panels[-1].set_xlabel("distance along the road from the own car [m]")
    return figure


@drawn
def forecasts(
    times: ArrayLike, l_tilde: ArrayLike, l_hat: ArrayLike, q: ArrayLike, *, shift: float
) -> Card:
    """Truth, forecast and what the tracker adds to it, over the scored steps of several rides.

    Args:
        times: running time of each scored step [s], shape (n,).
        l_tilde: what happened, shape (n,).
        l_hat: what had been forecast for that step, shape (n,).
        q: threshold that the step's score met, shape (n,).
        shift: time at which the speed range widens [s].
    """
    t, truth, guess, threshold = (np.asarray(a, dtype=float) for a in (times, l_tilde, l_hat, q))
    figure, (upper, lower) = cards(2, 4.8)
    missed = np.abs(truth - guess) > threshold
    upper.fill_between(
        t, guess - threshold, guess + threshold, step="mid", color=_BAND, label="forecast ± q"
    )
    upper.plot(t[~missed], truth[~missed], "o", color=GREY, markersize=3, label="happened, covered")
    upper.plot(t[missed], truth[missed], "^", color=RED, markersize=5, label="happened, missed")
    upper.set(ylabel="proximity", ylim=(-0.05, 1.05))
    upper.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    lower.step(t, threshold, where="mid", color=BLUE)
    lower.set(xlabel="seconds driven, rides laid end to end [s]", ylabel="threshold q")
    for axes, text in ((upper, ""), (lower, "wider speed range")):
        span(axes, shift, float(t[-1]), text)
    lower.set_ylim(0, lower.get_ylim()[1] * 1.12)
    return figure


@drawn
def rides(
    speeds: Mapping[str, Sequence[ArrayLike]], *, unit_s: float, cap_mps: float | None = None
) -> Card:
    """Speed over time of every ride, a panel a condition; a cross ends a ride that crashed.

    Args:
        speeds: by condition, the speed after each step of each ride [m/s]; a ride that stops
            before the longest one has crashed.
        unit_s: seconds a step [s].
        cap_mps: a limit to draw [m/s].
    """
    figure, panels = cards(len(speeds), 0.5 + 1.9 * len(speeds))
    longest = max(len(np.asarray(v)) for rows in speeds.values() for v in rows)
    for axes, (name, rows) in zip(panels, speeds.items(), strict=True):
        for row in rows:
            v = np.asarray(row, dtype=float)
            t = unit_s * np.arange(1, len(v) + 1)
            axes.plot(t, v, color=BLUE, alpha=0.75, linewidth=1.3)
            if len(v) < longest:
                axes.plot(t[-1], v[-1], "x", color=RED, markersize=8, markeredgewidth=2)
                note(axes, t[-1] + 0.6, v[-1], "crash", RED)
        if cap_mps is not None:
            level(axes, cap_mps, f"highway-env's cap, {cap_mps:g} m/s")
        axes.set_title(name)
        axes.set_ylabel("speed [m/s]")
    panels[-1].set_xlabel("time [s]")
    return figure


def _lanes(axes: Axes, lanes_count: int) -> None:
    for i in range(lanes_count + 1):
        edge = i in (0, lanes_count)
        axes.axhline(
            _LANE * (i - 0.5),
            color=INK if edge else GREY,
            linewidth=1.2 if edge else 0.7,
            linestyle="-" if edge else (0, (8, 8)),
        )


def _car(axes: Axes, car) -> None:  # noqa: ANN001 (a named tuple made by pandas)
    own = car.vehicle == 0
    box = Rectangle(
        (-_LENGTH / 2, -_BREADTH / 2),
        _LENGTH,
        _BREADTH,
        facecolor=BLUE if own else "white",
        edgecolor=RED if car.crashed else (BLUE if own else INK),
        hatch="///" if car.crashed else None,
        linewidth=1.6 if car.crashed else 1.0,
    )
    turn = Affine2D().rotate(car.heading_rad).translate(car.x_m, car.y_m)
    box.set_transform(turn + axes.transData)
    axes.add_patch(box)
