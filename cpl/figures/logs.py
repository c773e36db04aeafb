"""Pictures of a recorded run: where the robot went, and what its policy knew.

They draw what a run has and leave out what it has not, so a third party's pose recording gives a
figure too. Every figure carries the run's provenance stamp.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from cpl.figures.style import BLUE, GREEN, GREY, INK, PURPLE, RED, Card, cards, drawn

__all__ = ["overview", "stamp"]

ERRORS = {1: ("Vision", "o"), 2: ("Speed", "D"), 3: ("Other", "s")}


def stamp(figure: Card, label: str) -> Card:
    """Write where the data comes from below a figure.

    Args:
        figure: The figure.
        label: The stamp, such as `Run.label`.
    """
    figure.supxlabel(f"data: {label}", x=0.01, ha="left", fontsize=8.5, color=GREY)
    return figure


@drawn
def overview(table: pd.DataFrame, *, label: str) -> Card:
    """One run: its path from above and, below, its speed, gain, prediction and quantile over time.

    Args:
        table: Rows of one run, columns as in `cpl.logs.COLUMNS` as far as it has them.
        label: The provenance stamp.
    """
    panels = [each for each in (_speed, _gain, _prediction) if each(None, table)]
    figure, (above, *below) = cards(
        1 + len(panels),
        height=4.2 + 1.5 * len(panels),
        share_x=False,
        ratios=(3.4, *[1.0] * len(panels)),
    )
    _path(above, table)
    for axes, panel in zip(below, panels, strict=True):
        panel(axes, table)
        axes.set_xlim(float(table["t_s"].iloc[0]), max(float(table["t_s"].iloc[-1]), 1e-3))
        axes.tick_params(labelbottom=axes is below[-1])
    (below or [above])[-1].set_xlabel("time [s]" if below else "x [m]")
    return stamp(figure, label)


def _path(axes: Axes, table: pd.DataFrame) -> None:
    """Draw the estimated path, the true one where it is known, and where SLAM failed."""
    if "true_x_m" in table:
        axes.plot(
            table["true_x_m"],
            table["true_y_m"],
            color=INK,
            linestyle=(0, (5, 2)),
            linewidth=1.2,
            label="true path",
        )
    axes.plot(table["x_m"], table["y_m"], color=BLUE, label="estimated path")
    axes.plot(table["x_m"].iloc[:1], table["y_m"].iloc[:1], "^", color=GREEN, label="start")
    axes.plot(table["x_m"].iloc[-1:], table["y_m"].iloc[-1:], "v", color=PURPLE, label="end")
    if "slam_error" in table:
        for code, (name, marker) in ERRORS.items():
            at = table[table["slam_error"] == code]
            if len(at):
                axes.plot(
                    at["x_m"],
                    at["y_m"],
                    marker,
                    color=RED,
                    markersize=4,
                    label=f"SLAM error {name} ({len(at)})",
                )
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _speed(axes: Axes | None, table: pd.DataFrame) -> bool:
    """Draw the speed, and the commanded one; tell whether there is any."""
    lines = [
        (("v_x_mps", "v_y_mps"), "estimated", BLUE, "-"),
        (("cmd_v_x_mps", "cmd_v_y_mps"), "commanded", GREY, (0, (4, 2))),
    ]
    have = [line for line in lines if set(line[0]) <= set(table)]
    if axes is not None:
        for columns, name, hue, dash in have:
            speed = np.linalg.norm(table[list(columns)].to_numpy(), axis=1)
            axes.plot(table["t_s"], speed, color=hue, linestyle=dash, linewidth=1.3, label=name)
        axes.set_ylabel("speed [m/s]")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return bool(have)


def _gain(axes: Axes | None, table: pd.DataFrame) -> bool:
    """Draw the gain and mark where the supervisor stepped in."""
    if axes is not None and "kp" in table:
        axes.plot(table["t_s"], table["kp"], color=BLUE, label="gain kp")
        held = table[table["supervisor"] != ""] if "supervisor" in table else table[:0]
        if len(held):
            foot = np.full(len(held), table["kp"].min() - 0.1)
            axes.plot(held["t_s"], foot, "|", color=RED, label=f"supervisor ({len(held)})")
        axes.set_ylabel("gain [1/s]")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return "kp" in table


def _prediction(axes: Axes | None, table: pd.DataFrame) -> bool:
    """Draw what was predicted, the threshold on its error, and the errors that came."""
    known = "l_hat" in table and bool(table["l_hat"].notna().any())
    if axes is not None and known:
        axes.plot(table["t_s"], table["l_hat"], color=PURPLE, linewidth=1.2, label="l_hat")
        axes.step(
            table["t_s"], table["q"], where="post", color=BLUE, linestyle=(0, (5, 2)), label="q"
        )
        if "slam_error" in table:
            at = table.loc[table["slam_error"] != 0, "t_s"]
            if len(at):
                axes.plot(at, np.ones(len(at)), "|", color=RED, label="SLAM error")
        axes.set(ylabel="score", ylim=(-0.05, 1.12))
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return known
