"""Do the numbers of a run make sense together?

What is wrong with a row costs the row (:mod:`cpl.logs.sieve`). What is wrong with the whole, a unit
or a frame, makes the log unusable: a run in millimetres must not become a slow run in metres.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.logs.errors import FrameError, LogError, UnitError

__all__ = ["FASTEST_MPS", "check_run", "rotation", "strided"]

MOVING_MPS = 0.1  # [m/s] below, displacement says little about velocity
TURNING_RADPS = 0.1  # [rad/s]
ENOUGH = 5  # [rows] of motion, a tenth of a second apart, before a unit is judged
ENOUGH_FRAME = 20  # [rows] of motion before a frame is
FACTOR = 20.0  # [-] a wrong unit is off by 57 (degrees) or 1000 (millimetres, milliseconds)
BASELINE_S = 0.1  # [s] over which displacements are taken
FASTEST_MPS = 50.0  # [m/s] neither legs nor hands carry a camera faster than this


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


def strided(table: pd.DataFrame) -> pd.DataFrame:
    """Return every so many rows that they are a tenth of a second apart, or all if they are more.

    At 200 Hz a step is no longer than the noise of a pose; over a tenth of a second it is.
    """
    t_s = table["t_s"].to_numpy()
    usual = float(np.median(np.diff(t_s))) if len(t_s) > 1 else BASELINE_S
    return table.iloc[:: max(1, round(BASELINE_S / usual))]


def check_run(table: pd.DataFrame, path: Path, *, unit_known: bool = False) -> None:
    """Hold poses, twist and clock against each other.

    Medians over the moving rows, so that the jumps of a lost estimator do not count as a unit.

    Args:
        table: The run.
        path: The file, for the error.
        unit_known: Whether somebody said what unit the positions have, so that a great speed is
            one.

    Raises:
        UnitError: The poses move more than 20 times faster or slower than the twist says, or faster
            than anything that carries such a camera.
        FrameError: The twist agrees with the poses only if it is taken as a world-frame one.
    """
    table = strided(table)
    t_s = table["t_s"].to_numpy()
    if len(t_s) <= ENOUGH:
        return
    dt = np.diff(t_s)
    moved = np.diff(table[["x_m", "y_m", "z_m"]].to_numpy(), axis=0)
    speed = np.linalg.norm(moved, axis=1) / dt
    _must(unit_known or np.median(speed) < FASTEST_MPS, UnitError, path,
          lambda: f"the poses move at {np.median(speed):.0f} m/s: is a unit wrong? Give the "
          "positions' unit (--unit mm, cm or m; unit= in Python)")  # fmt: skip
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
    if use.sum() <= ENOUGH_FRAME:
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
