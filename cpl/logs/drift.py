r"""How far does an estimate drift in the next second? Of a recording, a series of steps of time.

The drift from t to t + H is how far the motion that was estimated lies from the motion that was,
both seen from the body at t:

$$d_t = \lVert \hat R_t^\top(\hat p_{t+H} - \hat p_t) - R_t^\top(p_{t+H} - p_t) \rVert$$

so neither where the estimator's world lies nor what it got wrong before matters. Where there is no
truth, two other errors of a machine's own motion become known without one: that of going on as now
(:func:`without_truth`), and that of a legged robot's feet, which must not move while they stand
(:func:`of_feet`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.logs.checks import rotation
from cpl.logs.clock import NS
from cpl.logs.run import Run
from cpl.logs.sources import read_run
from cpl.store import project_root

__all__ = ["Series", "of_feet", "of_file", "with_truth", "without_truth"]

SHIPPED = (
    "data/logs/real-t265/test.bag",
    "/camera/odom/sample",
    "/vicon/t265_tracker/t265_tracker",
)
LONG_S = 20.0  # [s] a shorter recording is asked about a twentieth of it, not about a second
STEPS = 10  # in a horizon
GAP = 3.0  # [-] steps of the recording, beyond which nothing is interpolated
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Series:
    """A recording, step by step.

    Attributes:
        table: As :func:`with_truth` returns it.
        horizon_s: Over which the drift is taken [s].
        measured: What the drift is measured against, in words.
        run: The recording.
    """

    table: pd.DataFrame
    horizon_s: float
    measured: str
    run: Run


def of_file(
    file: str,
    truth: str,
    *,
    times: str = "none",
    provenance: str = "unstated",
    horizon_s: float = 0,
) -> Series:
    """Return the drift of a recording of one's own.

    Args:
        file: Any recording that is read here, from the project's root or absolute; behind `::` the
            topic, where it has several.
        truth: Likewise, what was measured from outside with the same clock; `none` if nothing was,
            `as shipped` for the truth in the shipped bag, and none for another file.
        times: A file of times for poses without them; `none` if they have some.
        provenance: Where it comes from, if the file does not say.
        horizon_s: Over which the drift is taken [s]; 0 for a second, or for a twentieth of a
            recording shorter than 20 s.

    Raises:
        cpl.logs.LogError: A file cannot be read.
        ValueError: As :func:`with_truth`.
    """
    options = {"silent": provenance, "times": None if times == "none" else times}
    run = _named(file, options)
    horizon_s = horizon_s or min(1.0, run.duration_s / LONG_S)
    span = {"horizon_s": horizon_s, "step_s": horizon_s / STEPS}
    if truth == "as shipped":
        own = (project_root() / file.partition("::")[0]) == project_root() / SHIPPED[0]
        truth = f"{SHIPPED[0]}::{SHIPPED[2]}" if own else "none"
    if truth == "none":
        told = "going on at the velocity of now, because no truth is given"
        return Series(table=without_truth(run, **span), horizon_s=horizon_s, measured=told, run=run)
    outside = _named(truth, options)
    table = with_truth(run, outside, same_body=False, **span)
    return Series(table=table, horizon_s=horizon_s, measured=f"the truth in {truth}", run=run)


def _named(text: str, options: dict[str, Any]) -> Run:
    name, _, topic = text.partition("::")
    path = project_root() / name
    if path == project_root() / SHIPPED[0]:
        options = {**options, "provenance": "real-T265-third-party"}
    return read_run(path, topic=topic or None, **options)


def with_truth(
    estimate: Run, truth: Run, *, horizon_s: float, step_s: float, same_body: bool = True
) -> pd.DataFrame:
    """Return an estimate's motion and its drift, step by step.

    Args:
        estimate: What the machine believed.
        truth: What was measured from outside, with the same clock.
        horizon_s: Over which the drift is taken [s].
        step_s: From step to step [s].
        same_body: Whether both tell the poses of the same body. If not, the turn between their
            bodies is estimated, with both worlds laid one upon the other by all positions.

    Returns:
        One row a step: `t_s`, `speed_mps`, `turn_radps`, `hard_mps2` (what the machine knows at
        that step, from its own estimate), `drift_m` (what shows `horizon_s` later).

    Raises:
        ValueError: They do not overlap for two horizons, or an argument is not positive.
    """
    _positive(horizon_s, step_s)
    times, start = _absolute(estimate), estimate.info.start_unix_ns
    true_times = _absolute(truth, since=start)
    first, last = max(times[0], true_times[0]), min(times[-1], true_times[-1])
    grid = _grid(first, last, horizon_s, step_s)
    p, r, known = _at(estimate, times, grid)
    q, s, seen = _at(truth, true_times, grid)
    if not same_body:
        r = r @ _between_bodies(p, r, q, s)
    h = round(horizon_s / step_s)
    ours = np.einsum("tji,tj->ti", r[:-h], p[h:] - p[:-h])
    theirs = np.einsum("tji,tj->ti", s[:-h], q[h:] - q[:-h])
    drift = np.linalg.norm(ours - theirs, axis=1)
    good = (known & seen)[:-h] & (known & seen)[h:]
    return _series(grid, p, r, drift, good, h, step_s)


def without_truth(estimate: Run, *, horizon_s: float, step_s: float) -> pd.DataFrame:
    """Return how far a machine strays from where it would be if it went on as it goes now.

    Args:
        estimate: What the machine believed.
        horizon_s: As :func:`with_truth`.
        step_s: As :func:`with_truth`.

    Returns:
        As :func:`with_truth`; `drift_m` is the error of going on at the velocity of now.

    Raises:
        ValueError: As :func:`with_truth`.
    """
    _positive(horizon_s, step_s)
    times = _absolute(estimate)
    grid = _grid(times[0], times[-1], horizon_s, step_s)
    p, r, known = _at(estimate, times, grid)
    h = round(horizon_s / step_s)
    velocity = np.gradient(p, step_s, axis=0)
    velocity[1:] = np.diff(p, axis=0) / step_s  # what is known at the step: backward
    drift = np.linalg.norm(p[h:] - p[:-h] - horizon_s * velocity[:-h], axis=1)
    return _series(grid, p, r, drift, known[:-h] & known[h:], h, step_s)


def of_feet(contacts: pd.DataFrame, *, horizon_s: float, step_s: float) -> pd.DataFrame:
    """Return how far a legged robot's standing feet slide against each other.

    Two feet that stand keep their distance, whatever the body does: by how much it changes is an
    error of the leg's odometry that needs no truth from outside.

    Args:
        contacts: One row a foot and moment at which it stands: `timestamp_s`, `foot_index` and
            `body_x`, `body_y`, `body_z` [m], its place in the body's frame.
        horizon_s: As :func:`with_truth`.
        step_s: As :func:`with_truth`.

    Returns:
        As :func:`with_truth`; `drift_m` is what the distances change in the horizon, summed up.

    Raises:
        ValueError: As :func:`with_truth`, or a column is missing.
    """
    _positive(horizon_s, step_s)
    wanted = ["timestamp_s", "foot_index", "body_x", "body_y", "body_z"]
    if lacking := [name for name in wanted if name not in contacts]:
        msg = f"contacts must have the columns {', '.join(wanted)}, got no {lacking[0]}"
        raise ValueError(msg)
    moments: dict[float, dict[int, Array]] = {}
    for t, foot, *place in contacts[wanted].to_numpy(dtype=np.float64).tolist():
        moments.setdefault(t, {})[int(foot)] = np.array(place)
    times, slips, moved, turned = [0.0], [0.0], [np.zeros(3)], [0.0]
    before: tuple[float, dict[int, Array]] | None = None
    begin = min(moments)
    for t, feet in moments.items():
        if before is not None and t - begin > times[-1]:
            stand = sorted(feet.keys() & before[1].keys())
            places = np.array([before[1][foot] for foot in stand])
            now = np.array([feet[foot] for foot in stand])
            times.append(t - begin)
            slips.append(_slip(places, now))
            moved.append((places - now).mean(axis=0) if stand else np.zeros(3))
            turned.append(_turn(places, now))
        before = t, feet
    grid = _grid(0.0, times[-1], horizon_s, step_s)
    total = np.interp(grid, times, np.cumsum(slips))
    path = np.column_stack([np.interp(grid, times, each) for each in np.cumsum(moved, axis=0).T])
    yaw = np.interp(grid, times, np.cumsum(turned))
    h = round(horizon_s / step_s)
    r = rotation(np.column_stack([0 * yaw, 0 * yaw, np.sin(yaw / 2), np.cos(yaw / 2)]))
    good = np.ones(len(grid) - h, dtype=bool)
    return _series(grid, path, r, total[h:] - total[:-h], good, h, step_s)


def _slip(before: Array, now: Array) -> float:
    """Return by how much the distances between feet changed, on average over pairs."""
    if len(before) < 2:
        return 0.0
    first, second = np.triu_indices(len(before), k=1)
    was = np.linalg.norm(before[first] - before[second], axis=1)
    is_ = np.linalg.norm(now[first] - now[second], axis=1)
    return float(np.abs(is_ - was).mean())


def _turn(before: Array, now: Array) -> float:
    """Return by how much the body turned about its upright axis, by the line between two feet."""
    if len(before) < 2:
        return 0.0
    a, b = before[1] - before[0], now[1] - now[0]
    return float(np.arctan2(a[1], a[0]) - np.arctan2(b[1], b[0]) + np.pi) % (2 * np.pi) - np.pi


def _positive(horizon_s: float, step_s: float) -> None:
    for name, value in (("horizon_s", horizon_s), ("step_s", step_s)):
        if not (np.isfinite(value) and value > 0):
            msg = f"{name} must be finite and above 0, got {value!r}"
            raise ValueError(msg)
    if round(horizon_s / step_s) < 1:
        msg = f"horizon_s must be at least one step of {step_s} s, got {horizon_s!r}"
        raise ValueError(msg)


def _absolute(run: Run, since: int | None = None) -> Array:
    """Return a run's times, from the moment that another one began [s]."""
    ahead = 0.0 if since is None else (run.info.start_unix_ns - since) / NS
    return run.table["t_s"].to_numpy() + ahead


def _grid(first: float, last: float, horizon_s: float, step_s: float) -> Array:
    if not last - first >= 2 * horizon_s:
        both = max(0.0, last - first)
        msg = f"the recording must last two horizons of {horizon_s} s, got {both:.3g} s"
        raise ValueError(msg)
    return np.arange(first, last, step_s)


def _at(run: Run, times: Array, grid: Array) -> tuple[Array, Array, NDArray[np.bool]]:
    """Return positions and rotations at some moments, and where they are between near rows."""
    table = run.table
    position = np.column_stack([np.interp(grid, times, table[f"{a}_m"]) for a in "xyz"])
    q = table[["qx", "qy", "qz", "qw"]].to_numpy().copy()
    flips = np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0))
    q[1:] *= flips[:, None]  # of a quaternion's two signs the one near the row before
    turned = np.column_stack([np.interp(grid, times, each) for each in q.T])
    after = np.clip(np.searchsorted(times, grid), 1, len(times) - 1)
    between = times[after] - times[after - 1]
    near = between <= GAP * max(float(np.median(np.diff(times))), float(grid[1] - grid[0]))
    return position, rotation(turned), near


def _between_bodies(p: Array, r: Array, q: Array, s: Array) -> Array:
    """Return the turn from one body to the other, where both move together."""
    world = _nearest((q - q.mean(axis=0)).T @ (p - p.mean(axis=0)))
    return _nearest(np.einsum("tji,tjk->ik", world @ r, s))


def _nearest(matrix: Array) -> Array:
    """Return the rotation nearest to a matrix."""
    u, _, v = np.linalg.svd(matrix)
    sign = np.sign(np.linalg.det(u @ v))
    return u @ np.diag([1.0, 1.0, sign]) @ v


def _series(
    grid: Array, p: Array, r: Array, drift: Array, good: NDArray[np.bool], h: int, step_s: float
) -> pd.DataFrame:
    """Put together what is known at each step from the last horizon, and what shows later."""
    n = len(drift)
    velocity = np.zeros_like(p)
    velocity[1:] = np.diff(p, axis=0) / step_s
    angle = np.einsum("tij,tij->t", r[1:], r[:-1])
    turn = np.zeros(len(p))
    turn[1:] = np.arccos(np.clip((angle - 1) / 2, -1, 1)) / step_s
    hard = np.zeros(len(p))
    hard[2:] = np.linalg.norm(np.diff(velocity[1:], axis=0), axis=1) / step_s
    columns = {"speed_mps": np.linalg.norm(velocity, axis=1), "turn_radps": turn, "hard_mps2": hard}
    weight = np.ones(h) / h
    told = {name: np.convolve(each, weight)[:n] for name, each in columns.items()}
    table = pd.DataFrame({"t_s": grid[:n] - grid[0], **told, "drift_m": drift})
    begun = np.arange(n) >= h  # before, less than a horizon was seen
    return table.iloc[np.flatnonzero(good & begun)].reset_index(drop=True)
