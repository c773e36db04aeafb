"""A recorded run as a robot: it shows what was seen, and ignores where it is sent.

Replayed through the same loop, policy and guard, a log must give back its own commands, unless a
clock was the reason for one of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np
import pandas as pd

from cpl.conformal import RunningMax
from cpl.logs import Run
from cpl.quadruped import GAIN_RULES, GainLimits, Path, Policy, PolicyConfig, RunConfig
from cpl.robot.clock import Timing
from cpl.robot.guard import GuardConfig
from cpl.robot.interfaces import ZERO, BaseState, Command, Fix, Mode, Pose
from cpl.robot.loop import PERIOD_S, Robot, drive

__all__ = ["ReplayBase", "ReplayClock", "ReplayLocalizer", "replay", "replayed"]

NEEDED = (
    "v_x_mps", "confidence", "slam_error", "cmd_v_x_mps", "kp", "waypoint_index", "l_hat", "q",
)  # fmt: skip


class ReplayClock:
    """The log's own times, one after the other, as fast as they are asked for."""

    def __init__(self, t_s: list[float]) -> None:
        self._t_s, self.row = t_s, 0

    def now(self) -> float:
        """Return the time of the present row [s]."""
        return self._t_s[self.row]

    def wait(self, until: float) -> None:
        """Go on to the next row, whatever its time."""
        del until
        self.row = min(self.row + 1, len(self._t_s) - 1)


class ReplayLocalizer:
    """The poses of a log."""

    library = "cpl.robot.replay"

    def __init__(self, rows: list[dict[str, Any]], clock: ReplayClock) -> None:
        self._rows, self._clock = rows, clock

    def fix(self) -> Fix:
        """Return the present row's pose."""
        row = self._rows[self._clock.row]
        x, y, z, q_x, q_y, q_z, q_w = (
            row[n] for n in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
        )
        return Fix(
            position=(x, y, z),
            quaternion=(q_x, q_y, q_z, q_w),
            twist=(row["v_x_mps"], row["v_y_mps"], row["yaw_rate_radps"]),
            confidence=int(row["confidence"]),
            slam_error=int(row["slam_error"]),
            changed_s=self._clock.now(),
        )

    def anchor(self, pose: Pose) -> None:
        """Do nothing: a log is where it is."""

    def close(self) -> None:
        """Do nothing."""


class ReplayBase:
    """Legs that go nowhere and remember what they were asked for."""

    library = "cpl.robot.replay"

    def __init__(self, rows: list[dict[str, Any]], clock: ReplayClock) -> None:
        self._rows, self._clock = rows, clock
        self.asked: list[Command] = []

    def send(self, mode: Mode, command: Command = ZERO) -> None:
        """Remember."""
        if mode is Mode.WALK:
            self.asked.append(command)

    def state(self) -> BaseState:
        """Return a healthy robot, where the log knows the truth at the true pose."""
        row = self._rows[self._clock.row]
        names = ("true_x_m", "true_y_m", "true_yaw_rad")
        x, y, yaw = (row.get(name, nan) for name in names)
        return BaseState(
            mode=Mode.WALK,
            battery=100,
            velocity=ZERO,
            odometry=(x, y, yaw),
            version=(0, 0),
            received_s=self._clock.now(),
        )

    def close(self) -> None:
        """Do nothing."""


def replay(run: Run, config: GuardConfig | None = None) -> Iterator[dict[str, Any]]:
    """Send a log through the loop again.

    The predictions are the logged ones, so no network is needed; gain, quantile, command and guard
    are worked out anew.

    Args:
        run: A log of this package, with its configuration.
        config: The guard's.

    Yields:
        The rows of the new run.

    Raises:
        cpl.logs.LogError: The log lacks a channel.
        ValueError: The log does not say along which path, or with which policy.
    """
    run.require(*NEEDED)
    said = run.info.config
    if not (isinstance(said, dict) and {"waypoints", "policy", "kp_min", "kp_max"} <= set(said)):
        raise ValueError(f"run must say its waypoints and its policy, not {sorted(said)}")
    rows: list[dict[str, Any]] = run.table.to_dict("records")
    clock = ReplayClock([float(row["t_s"]) for row in rows])
    robot = Robot(
        base=ReplayBase(rows, clock),
        localizer=ReplayLocalizer(rows, clock),
        clock=clock,
        odometry_is_truth="true_x_m" in run.table,
    )
    limits = GainLimits(kp_min=said["kp_min"], kp_max=said["kp_max"])
    tracker = said.get("tracker", {})
    tracking = PolicyConfig(
        alpha=tracker.get("alpha", 0.2), rule=RunningMax(c=tracker.get("c", 0.1))
    )
    predicts = not all(np.isnan(row["l_hat"]) for row in rows)
    policy = Policy(
        GAIN_RULES[said["policy"]],
        limits,
        tracking,
        forecast=(lambda _: rows[clock.row]["l_hat"]) if predicts else None,
    )
    course = Path(name=str(said.get("shape", "path")), waypoints=np.array(said["waypoints"]))
    config = config or GuardConfig()
    if not robot.odometry_is_truth:  # a log keeps no odometry, unless it is the truth
        config = replace(config, agreement=None)
    steps = drive(robot, course, policy, config, RunConfig(max_s=1e6), _timing())
    for _, row in zip(rows, steps, strict=False):
        yield row


def replayed(run: Run, again: list[dict[str, Any]]) -> pd.DataFrame:
    """Return where a replay and its log part.

    Args:
        run: The log.
        again: What `replay` gave.

    Returns:
        One row a step in which the command or the gain differs: `t_s`, `logged`, `again`
        (forward commands [m/s]), `supervisor` (the log's), `supervisor_again`.
    """
    new = pd.DataFrame(again)
    old = run.table.iloc[: len(new)].reset_index(drop=True)
    numbers = ["cmd_v_x_mps", "cmd_v_y_mps", "cmd_yaw_rate_radps", "kp"]
    same = np.isclose(new[numbers], old[numbers], atol=1e-6).all(axis=1)
    differs = np.asarray(~same)
    # The last row's zero is the end of the run, which a replay does not decide.
    differs[-1] = False
    why = old["supervisor"] if "supervisor" in old else pd.Series([""] * len(old))
    return pd.DataFrame(
        {
            "t_s": old["t_s"][differs],
            "logged": old["cmd_v_x_mps"][differs],
            "again": new["cmd_v_x_mps"][differs],
            "supervisor": why.fillna("")[differs],
            "supervisor_again": new["supervisor"][differs],
        }
    ).reset_index(drop=True)


def _timing() -> Timing:
    return Timing(period_s=PERIOD_S)
