"""What does the operator see? Plain text that any terminal shows.

On a terminal a panel is drawn over itself ten times a second; elsewhere (a file, a pipe) one line
is written each second.
"""

from __future__ import annotations

import sys
from math import isnan, pi
from typing import Any, TextIO

from cpl.quadruped import Path

__all__ = ["View", "line", "panel"]

WIDTH, HEIGHT = 41, 15  # [characters] of the map
BAR = 24  # [characters]
UP = "\x1b[{}A"
CLEAR = "\x1b[K"


class View:
    """Show a run while it goes on.

    Args:
        path: Where the robot is to go.
        kp_range: Least and largest gain [1/s].
        battery: Returns the state of charge [%].
        out: Where to.
    """

    def __init__(
        self,
        path: Path,
        kp_range: tuple[float, float],
        battery: Any = None,  # noqa: ANN401 - nothing or a function
        out: TextIO | None = None,
    ) -> None:
        self._path, self._kp, self._battery = path, kp_range, battery
        self._out = out or sys.stderr
        self._drawn, self._said_s = 0, float("-inf")

    def __call__(self, row: dict[str, Any]) -> None:
        """Show a row."""
        if not self._out.isatty():
            if row["t_s"] - self._said_s >= 1.0 - 1e-6 or row["outcome"]:
                self._said_s = row["t_s"]
                self._out.write(line(row) + "\n")
                self._out.flush()
            return
        charge = self._battery() if self._battery is not None else None
        lines = panel(row, self._path, self._kp, charge)
        back = UP.format(self._drawn) if self._drawn else ""
        self._out.write(back + "".join(f"{each}{CLEAR}\n" for each in lines))
        self._out.flush()
        self._drawn = len(lines)


def line(row: dict[str, Any]) -> str:
    """Return a row in one line.

    >>> row = {"t_s": 1.0, "x_m": 0.5, "y_m": -1.0, "yaw_rad": 0.0, "kp": 1.5, "l_hat": 0.25}
    >>> row |= {"q": 0.1, "slam_error": 0, "supervisor": "", "outcome": ""}
    >>> line(row)
    '   1.0 s  x +0.50  y -1.00  yaw   +0 deg  kp 1.50  l_hat 0.25  q 0.10  walks'
    """
    return (
        f"{row['t_s']:6.1f} s  x {row['x_m']:+.2f}  y {row['y_m']:+.2f}  "
        f"yaw {row['yaw_rad'] * 180 / pi:+4.0f} deg  kp {row['kp']:.2f}  "
        f"l_hat {_number(row['l_hat'])}  q {_number(row['q'])}  {_state(row)}"
    )


def panel(
    row: dict[str, Any], path: Path, kp_range: tuple[float, float], battery: int | None
) -> list[str]:
    """Return the panel's lines: a map on top, bars below.

    Args:
        row: What is shown.
        path: Where the robot is to go.
        kp_range: Least and largest gain [1/s].
        battery: State of charge [%]; None where nobody knows.
    """
    low, high = kp_range
    share = (row["kp"] - low) / (high - low) if high > low else 0.5
    speed = (row["cmd_v_x_mps"] ** 2 + row["cmd_v_y_mps"] ** 2) ** 0.5
    charge = "" if battery is None else f"   battery {battery} %"
    return [
        *_map(row, path),
        f"time  {row['t_s']:6.1f} s{charge}",
        f"pose  x {row['x_m']:+.2f} m  y {row['y_m']:+.2f} m  "
        f"yaw {row['yaw_rad'] * 180 / pi:+4.0f} deg  confidence {row['confidence']}",
        f"sent  {speed:.2f} m/s  {row['cmd_yaw_rate_radps']:+.2f} rad/s  "
        f"to waypoint {row['waypoint_index']} of {len(path) - 1}",
        f"gain  {row['kp']:.2f} {_bar(share)}",
        f"l_hat {_number(row['l_hat'])} {_bar(row['l_hat'])}",
        f"q     {_number(row['q'])} {_bar(row['q'])}",
        f"state {_state(row)}",
    ]


def _state(row: dict[str, Any]) -> str:
    words = [row["supervisor"] or "walks"]
    words += [f"SLAM error {('', 'Vision', 'Speed', 'Other')[row['slam_error']]}"] * bool(
        row["slam_error"]
    )
    words += [f"over: {row['outcome']}"] * bool(row["outcome"])
    return ", ".join(words)


def _map(row: dict[str, Any], path: Path) -> list[str]:
    """Return the path (.), the target (x) and the robot (an arrow), 3 m to each side."""
    grid = [[" "] * WIDTH for _ in range(HEIGHT)]

    def put(x: float, y: float, mark: str) -> None:
        column, line_ = round((x + 3) / 6 * (WIDTH - 1)), round((3 - y) / 6 * (HEIGHT - 1))
        grid[min(max(line_, 0), HEIGHT - 1)][min(max(column, 0), WIDTH - 1)] = mark

    for x, y, _ in path.waypoints.tolist():
        put(x, y, ".")
    target_x, target_y, _ = path.waypoints[row["waypoint_index"]].tolist()
    put(target_x, target_y, "x")
    arrow = ">^<v"[round(row["yaw_rad"] / (pi / 2)) % 4]
    put(row["x_m"], row["y_m"], arrow)
    edge = "+" + "-" * WIDTH + "+"
    return [edge, *(f"|{''.join(each)}|" for each in grid), edge]


def _bar(share: float) -> str:
    filled = 0 if isnan(share) else round(BAR * min(max(share, 0.0), 1.0))
    return "[" + "#" * filled + " " * (BAR - filled) + "]"


def _number(value: float) -> str:
    return " -  " if isnan(value) else f"{value:.2f}"
