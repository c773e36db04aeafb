"""One run on a robot: the ring of `cpl.quadruped.run`, closed through real time.

    observe -> learn -> predict -> gain -> command -> guard -> send -> log -> wait

The steps are the same functions in the same order; in lock-step with the twin the two loops give
the same rows. What is added is what only a robot has: ages, a battery, an operator, a clock.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cpl.quadruped import (
    COLUMNS,
    History,
    Path,
    Policy,
    RunConfig,
    advance,
    arrived,
    saturate,
    upcoming,
    velocity_command,
)
from cpl.robot.clock import Clock, RealClock, Timing
from cpl.robot.guard import GuardConfig, GuardState, RobotFacts, guard
from cpl.robot.interfaces import ZERO, Base, BaseState, Fix, Localizer, Mode, Pose, RobotError

__all__ = ["OUTCOMES", "PERIOD_S", "Robot", "drive", "halt", "prepare"]

PERIOD_S = 0.1  # [s] 10 Hz
OUTCOMES = (
    "arrived", "timeout", "geofence", "operator", "damped", "watchdog", "clock", "link", "battery",
    "camera", "odometry",
)  # fmt: skip
READY_S = 10.0  # [s] for robot and camera to answer
STOPPED_S = 0.3  # [s] of zero velocity before it stands
STOOD_S = 0.2  # [s]


def _nobody() -> bool:
    return False


@dataclass(kw_only=True)
class Robot:
    """Legs, eyes and a clock, and who may stop them.

    Attributes:
        base: Legs.
        localizer: Eyes.
        clock: The time.
        operator: Says whether somebody asked to stop.
        odometry_is_truth: Whether the base's odometry is the true pose, as an emulator's is.
        provenance: Where a log of this robot comes from.
        placement: Where the watchdog runs: `none`, `laptop` or `robot`.
    """

    base: Base
    localizer: Localizer
    clock: Clock = field(default_factory=RealClock)
    operator: Callable[[], bool] = _nobody
    odometry_is_truth: bool = False
    provenance: str = "real-Go1"
    placement: str = "none"

    def close(self) -> None:
        """Let both go."""
        self.localizer.close()
        self.base.close()


def prepare(robot: Robot, path: Path, timeout_s: float = READY_S) -> None:
    """Let the robot stand, wait until it and its camera answer, and call its place the start.

    Args:
        robot: The robot, standing on the path's first waypoint and looking along its first leg.
        path: Where it is to go.
        timeout_s: How long to wait [s].

    Raises:
        RobotError: Something does not answer, or the operator stopped.
    """
    clock = robot.clock
    begun = due = clock.now()
    changes: set[float] = set()  # a pose that never changes is none
    while clock.now() - begun < timeout_s:
        robot.base.send(Mode.STAND)
        due += PERIOD_S
        clock.wait(due)
        if robot.operator():
            raise RobotError("stopped by the operator before the run began")
        state, fix = robot.base.state(), robot.localizer.fix()
        if state is not None and state.tripped:
            raise RobotError(f"the watchdog does not obey: {state.tripped}")
        if fix is not None and fix.confidence > 0:
            changes.add(fix.changed_s)
        fresh = len(changes) > 1 and clock.now() - max(changes) < 2.5 * PERIOD_S
        if state is not None and state.mode != Mode.DAMPED and fresh:
            robot.localizer.anchor(path.start)
            return
    raise RobotError(_why(robot, timeout_s))


def drive(
    robot: Robot,
    path: Path,
    policy: Policy,
    config: GuardConfig,
    run: RunConfig,
    timing: Timing,
) -> Generator[dict[str, Any]]:
    """Run once along a path; whatever happens, the last thing asked for is zero velocity.

    Args:
        robot: A robot that `prepare` made ready.
        path: Where it is to go.
        policy: A fresh policy.
        config: What stands between policy and robot.
        run: Limits and time-out.
        timing: Is filled.

    Yields:
        One row a step with the columns of `cpl.quadruped.COLUMNS`.
    """
    loop = _Loop(robot, path, policy, config, run)
    clock = robot.clock
    begun = clock.now()
    try:
        while True:
            start = clock.now()
            timing.begun_s.append(start)
            row, outcome = loop.step(start, begun)
            timing.policy_s.append(clock.now() - start)
            yield row
            timing.busy_s.append(clock.now() - start)
            if outcome:
                return
            clock.wait(begun + len(timing.begun_s) * PERIOD_S)
    finally:
        robot.base.send(Mode.WALK, ZERO)


def halt(robot: Robot) -> None:
    """Zero velocity for a moment, then stand."""
    due = robot.clock.now()
    for mode, seconds in ((Mode.WALK, STOPPED_S), (Mode.STAND, STOOD_S)):
        for _ in range(round(seconds / PERIOD_S)):
            robot.base.send(mode, ZERO)
            due += PERIOD_S
            robot.clock.wait(due)


class _Loop:
    """What is remembered between two steps of a run."""

    def __init__(
        self, robot: Robot, path: Path, policy: Policy, config: GuardConfig, run: RunConfig
    ) -> None:
        self._robot, self._path, self._policy = robot, path, policy
        self._config, self._run = config, run
        self._history, self._state, self._index = History(), GuardState(), 0
        self._fix: Fix | None = None
        self._frame: Pose | None = None  # where the odometry's origin is in the path's frame
        self._last_t_s = -PERIOD_S

    def step(self, now: float, begun: float) -> tuple[dict[str, Any], str]:
        """Look, decide, send; return the row and, at the end, why it ends."""
        robot, path, policy = self._robot, self._path, self._policy
        base, fix = robot.base.state(), self._seen()
        pose = (*fix.position[:2], _yaw(fix))
        error = fix.slam_error != 0
        self._index = advance(self._index, pose, path, radius_m=self._run.advance_radius_m)
        self._history.observe(pose, error)
        decision = policy.decide(self._history.features(upcoming(path, self._index)), error)
        wanted = velocity_command(pose, path.waypoints[self._index], decision.kp)
        wanted = saturate(wanted, self._run.limits)
        facts = self._facts(now, begun, fix, base)
        ruling = guard(self._state, facts, wanted, self._config)
        self._state = ruling.state
        outcome = self._outcome(ruling.outcome, pose, facts)
        command = ZERO if outcome else ruling.command
        robot.base.send(Mode.WALK, command)
        self._history.sent(command)
        # A clock that does not go on must not cost the row that says so.
        t_s = facts.t_s if facts.t_s > self._last_t_s else self._last_t_s + PERIOD_S
        self._last_t_s = t_s
        row = {
            "t_s": t_s,
            **_observed(fix, pose[2]),
            **self._truth(base),
            **dict(zip(("cmd_v_x_mps", "cmd_v_y_mps", "cmd_yaw_rate_radps"), command, strict=True)),
            "kp": decision.kp,
            "waypoint_index": self._index,
            "l_hat": decision.l_hat,
            "q": decision.q,
            "score": decision.score,
            "err": -1 if decision.err is None else int(decision.err),
            "supervisor": ruling.reason,
            "outcome": outcome,
        }
        return {name: row[name] for name in COLUMNS}, outcome

    def _seen(self) -> Fix:
        """Return the newest fix; the last one if the camera fell silent, whose age then tells."""
        self._fix = self._robot.localizer.fix() or self._fix
        if self._fix is None:
            raise RobotError("there is no pose: call prepare first")
        return self._fix

    def _facts(self, now: float, begun: float, fix: Fix, base: BaseState | None) -> RobotFacts:
        clock = self._robot.clock
        return RobotFacts(
            t_s=now - begun,
            x_m=fix.position[0],
            y_m=fix.position[1],
            pose_valid=fix.confidence > 0,
            pose_age_s=now - fix.changed_s,
            command_age_s=clock.now() - now,
            answer_age_s=float("inf") if base is None else now - base.received_s,
            battery=0 if base is None else base.battery,
            mode=Mode.WALK if base is None else base.mode,
            operator=self._robot.operator(),
            tripped=base is not None and bool(base.tripped),
            pose_fault=bool(fix.fault),
            odometry=self._odometry(base),
        )

    def _odometry(self, base: BaseState | None) -> tuple[float, float]:
        """Return the place by the robot's own odometry, which began where the path does."""
        if base is None:
            return np.nan, np.nan
        x, y, yaw = base.odometry
        if self._frame is None:
            x0, y0, yaw0 = self._path.start
            turn = yaw0 - yaw
            c, s = np.cos(turn), np.sin(turn)
            self._frame = (float(x0 - c * x + s * y), float(y0 - s * x - c * y), float(turn))
        u, v, turn = self._frame
        c, s = np.cos(turn), np.sin(turn)
        return float(u + c * x - s * y), float(v + s * x + c * y)

    def _outcome(self, stopped: str, pose: Pose, facts: RobotFacts) -> str:
        if stopped:
            return stopped
        if arrived(self._index, pose, self._path):
            return "arrived" if self._there(facts.odometry) else "odometry"
        return "timeout" if facts.t_s >= self._run.max_s else ""

    def _there(self, odometry: tuple[float, float]) -> bool:
        """Whether the legs, too, say that this is the end of the path."""
        limits = self._config.agreement
        last = self._path.waypoints[-1]
        away = np.hypot(odometry[0] - last[0], odometry[1] - last[1])
        return limits is None or bool(away <= limits.arrived_m)

    def _truth(self, base: BaseState | None) -> dict[str, float]:
        names = ("true_x_m", "true_y_m", "true_yaw_rad")
        known = base is not None and self._robot.odometry_is_truth
        return dict(zip(names, base.odometry if known and base else [np.nan] * 3, strict=True))


def _observed(fix: Fix, yaw: float) -> dict[str, Any]:
    names = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "v_x_mps", "v_y_mps", "yaw_rate_radps")
    numbers = (*fix.position, *fix.quaternion, *fix.twist)
    return {
        **dict(zip(names, numbers, strict=True)),
        "yaw_rad": yaw,
        "confidence": fix.confidence,
        "slam_error": fix.slam_error,
    }


def _yaw(fix: Fix) -> float:
    x, y, z, w = fix.quaternion
    return float(np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z))


def _why(robot: Robot, seconds: float) -> str:
    """Say what did not answer, and what to look at."""
    state, fix = robot.base.state(), robot.localizer.fix()
    refused = getattr(robot.base, "refused", 0)
    if state is None and refused:
        return (
            f"the robot answers, but none of {refused} datagrams can be read: its firmware speaks "
            "another protocol than SDK 3.8"
        )
    if state is None:
        return f"the robot has not answered in {seconds:g} s: look at address, cable and power"
    if state.mode == Mode.DAMPED:
        return "the robot is damped by its remote: release it as its manual says"
    if fix is None:
        return f"the camera has sent no pose in {seconds:g} s: is the bridge running?"
    if fix.confidence == 0:
        return "the camera's tracker has failed: give it light and something to see"
    return f"the camera's pose has not changed for {robot.clock.now() - fix.changed_s:.1f} s"
