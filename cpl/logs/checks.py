"""Do the numbers make sense together? Row by row, and then the run as a whole.

What is wrong with a row costs the row. What is wrong with the whole (a unit, a frame) makes the log
unusable: a run in millimetres must not become a slow run in metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.logs.codec import MalformedError, sound
from cpl.logs.errors import (
    Fault,
    FrameError,
    LogError,
    QuaternionError,
    TimeOrderError,
    UnitError,
)

__all__ = ["Sieve", "check_run", "rotation", "yaw_of"]

UNIT_TOLERANCE = 1e-3  # [-] stored attitudes are rounded to 1e-4 in some recordings
YAW_TOLERANCE = 1e-3  # [rad]
MOVING_MPS = 0.1  # [m/s] below, displacement says little about velocity
TURNING_RADPS = 0.1  # [rad/s]
ENOUGH = 20  # [rows] of motion before units and frames are judged
FACTOR = 20.0  # [-] a wrong unit is off by 57 (degrees) or 1000 (millimetres, milliseconds)
BASELINE_S = 0.1  # [s] over which displacements are taken
FASTEST_MPS = 50.0  # [m/s] neither legs nor hands carry a camera faster than this


@dataclass(kw_only=True)
class Sieve:
    """Let the good rows of a run through, in order, and name what is wrong with the others.

    Attributes:
        rows: The rows that passed.
        numbers: Their row numbers.
        faults: Why the others did not.

    Examples:
        >>> sieve = Sieve()
        >>> pose = dict(x_m=0.0, y_m=0.0, z_m=0.0, qx=0.0, qy=0.0, qz=0.0, qw=2.0)
        >>> sieve.offer(0, {"t_s": 0.0, **pose}, "row 0")
        >>> print(*sieve.faults)
        Quaternion: row 0: the attitude has length 2.0000, not 1 (1 row dropped)
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    last_s: float = -math.inf

    def offer(self, number: int, row: dict[str, Any], where: str) -> None:
        """Take a row, or drop it with a fault."""
        length = math.sqrt(sum(row[f"q{axis}"] ** 2 for axis in "xyzw"))
        yaw = yaw_of(row["qx"], row["qy"], row["qz"], row["qw"])
        said = row.get("yaw_rad", yaw)
        if row["t_s"] < 0:
            self.drop(TimeOrderError, where, f"time is {row['t_s']} s, before the run's start")
        elif not row["t_s"] > self.last_s:
            how = "stands still" if row["t_s"] == self.last_s else "runs backwards"
            self.drop(TimeOrderError, where, f"time {how}: {row['t_s']} s after {self.last_s} s")
        elif abs(length - 1) > UNIT_TOLERANCE:
            self.drop(QuaternionError, where, f"the attitude has length {length:.4f}, not 1")
        elif abs(math.remainder(said - yaw, 2 * math.pi)) > YAW_TOLERANCE:
            what = f"yaw_rad is {said:.4f}, but the quaternion's heading is {yaw:.4f}"
            self.drop(QuaternionError, where, what)
        else:
            self.last_s = row["t_s"]
            self.rows.append({**row, "yaw_rad": said})
            self.numbers.append(number)

    def offer_raw(self, number: int, row: dict[str, Any], where: str) -> None:
        """Take a row from elsewhere, whose values nobody has looked at yet."""
        try:
            row = sound(row)
        except MalformedError as error:
            self.drop(error.error, where, str(error))
        else:
            self.offer(number, row, where)

    def drop(self, error: type[LogError], where: str, what: str, rows: int = 1) -> None:
        """Name a fault."""
        self.faults.append(Fault(error=error, where=where, what=what, rows=rows))


def yaw_of(qx: float, qy: float, qz: float, qw: float) -> float:
    """Return the heading of a quaternion's x axis [rad]; its length does not matter.

    Examples:
        >>> round(yaw_of(0.0, 0.0, 1.0, 1.0), 4)  # a quarter turn
        1.5708
    """
    return math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)


def rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotation matrices, body to world.

    Args:
        quaternion: x, y, z, w, shape (T, 4).

    Returns:
        Shape (T, 3, 3).
    """
    x, y, z, w = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    entries = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(entries), 2, 0)


def check_run(table: pd.DataFrame, path: Path) -> None:
    """Hold poses, twist and clock against each other.

    Medians over the moving rows, so that the jumps of a lost estimator do not count as a unit.

    Args:
        table: The run.
        path: The file, for the error.

    Raises:
        UnitError: The poses move more than 20 times faster or slower than the twist says, or faster
            than anything that carries such a camera.
        FrameError: The twist agrees with the poses only if it is taken as a world-frame one.
    """
    t_s = table["t_s"].to_numpy()
    if len(t_s) <= ENOUGH:
        return
    # At 200 Hz a step is no longer than the noise of a pose; over a tenth of a second it is.
    stride = max(1, round(BASELINE_S / float(np.median(np.diff(t_s)))))
    table, t_s = table.iloc[::stride], t_s[::stride]
    if len(t_s) <= ENOUGH:
        return
    dt = np.diff(t_s)
    moved = np.diff(table[["x_m", "y_m", "z_m"]].to_numpy(), axis=0)
    speed = np.linalg.norm(moved, axis=1) / dt
    _must(np.median(speed) < FASTEST_MPS, UnitError, path,
          lambda: f"the poses move at {np.median(speed):.0f} m/s: is a unit wrong?")  # fmt: skip
    if "v_x_mps" not in table:
        return
    _check_speed(table, speed, path)
    _check_turn(table, dt, path)
    _check_direction(table, moved, speed, path)


def _check_speed(table: pd.DataFrame, speed: NDArray[np.float64], path: Path) -> None:
    said = np.linalg.norm(table[["v_x_mps", "v_y_mps"]].to_numpy(), axis=1)[1:]
    # Rows in which the pose is frozen say nothing about its unit.
    fast = (np.maximum(said, speed) > MOVING_MPS) & (said > 0) & (speed > 0)
    if fast.sum() > ENOUGH:
        poses, twist = np.median(speed[fast]), np.median(said[fast])
        _must(
            abs(np.median(np.log(speed[fast] / said[fast]))) < np.log(FACTOR),
            UnitError,
            path,
            lambda: (
                f"the poses move at {poses:.3g} m/s, the twist says {twist:.3g} m/s: "
                "is a unit wrong?"
            ),
        )


def _check_turn(table: pd.DataFrame, dt: NDArray[np.float64], path: Path) -> None:
    yaw = table["yaw_rad"].to_numpy()
    turned = np.abs((np.diff(yaw) + np.pi) % (2 * np.pi) - np.pi) / dt
    said = np.abs(table["yaw_rate_radps"].to_numpy()[1:])
    turning = said > TURNING_RADPS
    if turning.sum() > ENOUGH:
        poses, rate = np.median(turned[turning]), np.median(said[turning])
        _must(rate < FACTOR * max(poses, TURNING_RADPS), UnitError, path,
              lambda: f"the heading turns at {poses:.3g} rad/s, the twist says {rate:.3g} rad/s: "
              "is it in degrees?")  # fmt: skip


def _check_direction(
    table: pd.DataFrame, moved: NDArray[np.float64], speed: NDArray[np.float64], path: Path
) -> None:
    body = table[["v_x_mps", "v_y_mps"]].to_numpy()[1:]
    body = np.column_stack([body, np.zeros(len(body))])
    turn = rotation(table[["qx", "qy", "qz", "qw"]].to_numpy()[1:])
    turned = np.abs(np.arccos(np.clip(turn[:, 0, 0], -1, 1))) > np.pi / 4
    use = turned & (speed > MOVING_MPS) & (np.linalg.norm(body, axis=1) > MOVING_MPS)
    if use.sum() <= ENOUGH:
        return
    as_body = _cosine(np.einsum("tij,tj->ti", turn[use], body[use])[:, :2], moved[use, :2])
    as_world = _cosine(body[use, :2], moved[use, :2])
    _must(not (as_world > 0.9 and as_body < 0.5), FrameError, path,
          lambda: "the twist agrees with the poses in the world frame and not in the body frame: "
          "it was not recorded in the frame that is claimed")  # fmt: skip


def _cosine(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return float(np.median((a * b).sum(axis=1) / np.maximum(lengths, 1e-12)))


def _must(holds: bool | np.bool, error: type[LogError], path: Path,
          what: Callable[[], str]) -> None:  # fmt: skip
    if not holds:
        raise error(what(), path=path)
