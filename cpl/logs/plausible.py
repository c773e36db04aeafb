"""Could this have happened? What a recording shows of speed, rate, gaps and jumps, beside "whole".

A file can be whole and its numbers nonsense: centimetres called metres, a quaternion written with w
first, an estimator that found its place again two metres from where it thought it was. Nothing here
changes or refuses a row. It is said, and whoever knows the robot decides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.logs.checks import rotation, strided

__all__ = ["Plausibility", "plausibility"]

FAST_MPS = 15.0  # [m/s] neither legs nor hands; a car
HARD_MPS2 = 30.0  # [m/s^2] three times gravity, over a tenth of a second, half of the time
GAP = 3.0  # [-] steps of time, in usual ones, that are called a gap
JUMP_M = 0.05  # [m] a step that is called a jump is at least that long,
JUMP_TIMES = 5.0  # [-] that many times faster than nine in ten steps,
JUMP_MPS2 = 50.0  # [m/s^2] and needs at least that acceleration
SHOWN = 5  # gaps and jumps that are named; more are counted
ENOUGH = 10  # [rows] before a run is judged
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Plausibility:
    """What a recording shows, beside the question whether it is whole.

    Attributes:
        rate_hz: Usual rate [Hz]; NaN for a single row.
        speed_mps: Median speed over a tenth of a second [m/s].
        fastest_mps: Speed that one step in a hundred exceeds [m/s].
        turning_radps: Turn rate that one step in a hundred exceeds [rad/s].
        gaps: Begin [s] and length [s] of steps of time above three usual ones.
        jumps: Time [s] and size [m] of steps that no motion explains: a relocalisation.
        doubts: What does not look right, in words.
    """

    rate_hz: float
    speed_mps: float
    fastest_mps: float
    turning_radps: float
    gaps: tuple[tuple[float, float], ...]
    jumps: tuple[tuple[float, float], ...]
    doubts: tuple[str, ...]

    def __str__(self) -> str:
        gaps = _named(self.gaps, "gap", "{1:.3g} s at {0:.2f} s")
        jumps = _named(self.jumps, "jump", "{1:.2f} m at {0:.2f} s")
        text = (
            f"{self.rate_hz:.4g} Hz, {gaps}; {self.speed_mps:.3g} m/s "
            f"(99 %: {self.fastest_mps:.3g}), turning up to {self.turning_radps:.3g} rad/s, {jumps}"
        )
        return f"{text}; doubtful: {'; '.join(self.doubts)}" if self.doubts else text


def plausibility(table: pd.DataFrame) -> Plausibility:
    """Look at a run as a whole.

    Args:
        table: Rows of one run, columns as in `cpl.logs.COLUMNS`.

    A walk at 0.5 m/s that jumps by two metres after a second:

    >>> t_s = np.arange(40) / 10
    >>> still = np.zeros(40)
    >>> walk = dict(t_s=t_s, x_m=0.5 * t_s + 2.0 * (t_s > 1), y_m=still, z_m=still,
    ...             qx=still, qy=still, qz=still, qw=still + 1)
    >>> print(plausibility(pd.DataFrame(walk)))
    10 Hz, no gap; 0.5 m/s (99 %: 12.9), turning up to 0 rad/s, 1 jump (2.05 m at 1.10 s)
    """
    t_s = table["t_s"].to_numpy()
    if len(t_s) < 2:
        nan = float("nan")
        return Plausibility(
            rate_hz=nan, speed_mps=nan, fastest_mps=nan, turning_radps=nan,
            gaps=(), jumps=(), doubts=("a single row shows nothing",),
        )  # fmt: skip
    dt = np.diff(t_s)
    usual = float(np.median(dt))
    far = np.flatnonzero(dt > GAP * usual)
    step = np.sqrt(sum(np.diff(table[name].to_numpy()) ** 2 for name in ("x_m", "y_m", "z_m")))
    jumps = _jumps(step, dt)
    thin = strided(table)
    speed, hardest = _motion(thin)
    turning = _turning(thin)
    doubts = [*_doubts(speed, hardest, usual, len(thin)), *_quaternion_doubts(thin)]
    return Plausibility(
        rate_hz=1 / usual,
        speed_mps=float(np.median(speed)),
        fastest_mps=float(np.quantile(speed, 0.99)),
        turning_radps=float(np.quantile(turning, 0.99)),
        gaps=tuple((float(t_s[at]), float(dt[at])) for at in far),
        jumps=tuple((float(t_s[at + 1]), float(step[at])) for at in jumps),
        doubts=tuple(doubts),
    )


def _named(found: tuple[tuple[float, float], ...], word: str, form: str) -> str:
    if not found:
        return f"no {word}"
    shown = [form.format(*each) for each in found[:SHOWN]]
    more = [f"and {len(found) - SHOWN} more"] if len(found) > SHOWN else []
    return f"{len(found)} {word}{'s' * (len(found) > 1)} ({', '.join([*shown, *more])})"


def _jumps(step: Array, dt: Array) -> NDArray[np.intp]:
    """Return after which rows the position steps further than motion explains."""
    speed = step / dt
    usual = float(np.quantile(speed, 0.9))
    far = (step > JUMP_M) & (speed > JUMP_TIMES * usual) & (speed - usual > JUMP_MPS2 * dt)
    return np.flatnonzero(far & ((speed - usual) / dt > JUMP_MPS2))


def _motion(thin: pd.DataFrame) -> tuple[Array, float]:
    """Return speeds [m/s], and the median acceleration [m/s^2]."""
    dt = np.diff(thin["t_s"].to_numpy())
    velocity = np.diff(thin[["x_m", "y_m", "z_m"]].to_numpy(), axis=0) / dt[:, None]
    speed = np.linalg.norm(velocity, axis=1)
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1) / dt[1:]
    return speed if len(speed) else np.zeros(1), float(np.median(change)) if len(change) else 0.0


def _turning(thin: pd.DataFrame) -> Array:
    """Return turn rates about whatever axis [rad/s]."""
    q = thin[["qx", "qy", "qz", "qw"]].to_numpy()
    dt = np.diff(thin["t_s"].to_numpy())
    same = np.clip(np.abs((q[1:] * q[:-1]).sum(axis=1)), 0.0, 1.0)
    # Near 1 the arc cosine would make a turn of 1e-8 out of a rounding.
    rate = np.where(same > 1 - 1e-9, 0.0, 2 * np.arccos(same)) / dt
    return rate if len(rate) else np.zeros(1)


def _doubts(speed: Array, hardest: float, usual_s: float, rows: int) -> list[str]:
    doubts: list[str] = []
    if rows >= ENOUGH and np.median(speed) > FAST_MPS:
        doubts.append(
            f"half of the time faster than {np.median(speed):.0f} m/s: a car, or centimetres or "
            "millimetres called metres? (--unit cm, --unit mm)"
        )
    if rows >= ENOUGH and hardest > HARD_MPS2:
        doubts.append(
            f"accelerates by {hardest:.0f} m/s^2 half of the time: is the positions' unit right?"
        )
    if not 1e-4 < usual_s < 10:
        doubts.append(f"rows are {usual_s:.3g} s apart: is the unit of time right?")
    return doubts


def _quaternion_doubts(thin: pd.DataFrame) -> list[str]:
    """Ask whether the attitudes make more sense with w written first.

    A body moves along the same axis of its own, and carries the same side up, more or less: read in
    the wrong order, attitudes that turn scatter both. Who stands still shows neither.
    """
    read = thin[["qx", "qy", "qz", "qw"]].to_numpy()
    if len(read) < ENOUGH:
        return []
    if np.median(np.abs(read[:, 0])) > 0.995:
        return ["upside down, half a turn about x: was w written first? (--quaternion wxyz)"]
    other = read[:, [1, 2, 3, 0]]
    ups = [_upright(each) for each in (read, other)]
    ways = [_along(each, thin) for each in (read, other)]
    if (ups[1] > 0.98 and ups[0] < 0.9) or (ways[1] > 0.9 and ways[0] < 0.6):
        return ["attitudes make more sense with w first (--quaternion wxyz)"]
    return []


def _upright(quaternion: Array) -> float:
    """Return how constant the world's vertical is to the body, 1 for always the same."""
    turned = rotation(quaternion)
    return max(float(np.linalg.norm(turned[:, row].mean(axis=0))) for row in (1, 2))


def _along(quaternion: Array, thin: pd.DataFrame) -> float:
    """Return how constant the direction of motion is to the body; 0 where nothing moves."""
    moved = np.diff(thin[["x_m", "y_m", "z_m"]].to_numpy(), axis=0)
    length = np.linalg.norm(moved, axis=1)
    moving = length > 0.01
    if moving.sum() < ENOUGH:
        return 0.0
    body = np.einsum("tji,tj->ti", rotation(quaternion[:-1][moving]), moved[moving])
    return float(np.linalg.norm((body / length[moving, None]).mean(axis=0)))
