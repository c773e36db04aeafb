"""One run, as a generator of log rows: world, path, policy and supervisor put in a ring.

    observe -> learn -> predict -> gain -> command -> supervise -> log -> act

Logging stays outside: whoever iterates keeps the rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from cpl.quadruped.controller import (
    ADVANCE_RADIUS_M,
    Limits,
    advance,
    arrived,
    saturate,
    velocity_command,
)
from cpl.quadruped.features import HORIZON, History, upcoming
from cpl.quadruped.observation import ForkableWorld, Observation, World
from cpl.quadruped.paths import Path
from cpl.quadruped.policy import Policy
from cpl.quadruped.supervisor import (
    Facts,
    Reason,
    SupervisorConfig,
    SupervisorState,
    Verdict,
    supervise,
)
from cpl.settings.ranges import Positive, Settings

__all__ = ["COLUMNS", "OUTCOMES", "RunConfig", "run"]

COLUMNS: dict[str, str] = {
    "t_s": "time since the run began [s]",
    "x_m": "estimated position, world frame [m]",
    "y_m": "estimated position, world frame [m]",
    "z_m": "estimated position, world frame [m]",
    "qx": "estimated attitude, body to world, unit quaternion [-]",
    "qy": "as qx",
    "qz": "as qx",
    "qw": "as qx",
    "yaw_rad": "estimated heading [rad]",
    "v_x_mps": "estimated velocity, body frame [m/s]",
    "v_y_mps": "estimated velocity, body frame [m/s]",
    "yaw_rate_radps": "measured yaw rate [rad/s]",
    "confidence": "tracker confidence, 0 failed .. 3 high [-]",
    "slam_error": "0 none, 1 Vision, 2 Speed, 3 Other, since the row before [-]",
    "cmd_v_x_mps": "command sent, body frame [m/s]",
    "cmd_v_y_mps": "command sent, body frame [m/s]",
    "cmd_yaw_rate_radps": "command sent [rad/s]",
    "kp": "gain [1/s]",
    "waypoint_index": "the target's index [-]",
    "l_hat": "predicted probability of an error two rows later [-]; NaN without a predictor",
    "q": "threshold in force for l_hat [score]",
    "score": "|l - l_hat| of the prediction two rows earlier, known now [score]; NaN before",
    "err": "1 if that score was above the q it met, 0 if not, -1 before any is known [-]",
    "supervisor": "why the command sent is not the policy's; empty if it is",
    "true_x_m": "true position [m]; NaN where nobody knows it",
    "true_y_m": "as true_x_m",
    "true_yaw_rad": "true heading [rad]; NaN where nobody knows it",
    "outcome": "in the last row why the run ended, else empty",
}

OUTCOMES = ("arrived", "timeout", "wall", "geofence", "fell")


@dataclass(frozen=True, kw_only=True)
class RunConfig(Settings):
    """How a run is conducted.

    Args:
        limits: What the robot may be asked for.
        advance_radius_m: A waypoint this near counts as achieved [m].
        max_s: A run longer than this is given up [s].
    """

    limits: Limits = field(default_factory=Limits)
    advance_radius_m: Positive = ADVANCE_RADIUS_M
    max_s: Positive = 60.0


def run(
    world: World,
    path: Path,
    policy: Policy,
    supervisor: SupervisorConfig | None,
    seed: int,
    config: RunConfig | None = None,
) -> Iterator[dict[str, Any]]:
    """Run once along a path.

    Paper: Section V. The run ends when the robot has arrived (by its own estimate), after
    `config.max_s`, when it has run into a wall or lies on the floor, or when the supervisor's
    geofence has tripped.

    Args:
        world: Where the robot is. It is reset to the path's first waypoint.
        path: Where it is to go.
        policy: A fresh policy.
        supervisor: What stands between policy and robot; None for nothing.
        seed: Everything random in the world.
        config: Limits and time-out.

    Yields:
        One row a policy step (10 Hz) with the columns of `COLUMNS`.

    Raises:
        ValueError: An oracle in a world that cannot be forked.
    """
    config = config or RunConfig()
    if policy.oracle and not hasattr(world, "fork"):
        raise ValueError(f"world must have fork() for an oracle, not {type(world).__name__}")
    history, state, index = History(), SupervisorState(), 0
    now = world.reset(path.start, seed)
    while True:
        index = advance(index, now.pose, path, radius_m=config.advance_radius_m)
        history.observe(now.pose, now.slam_error != 0)

        features = history.features(upcoming(path, index))
        peek = partial(_future_error, world, now, path, index, policy.kp, config)
        decision = policy.decide(features, now.slam_error != 0, peek)
        wanted = velocity_command(now.pose, path.waypoints[index], decision.kp)
        command, reason = saturate(wanted, config.limits), None
        if supervisor is not None:
            verdict = _supervised(state, now, command, supervisor)
            command, reason, state = verdict.command, verdict.reason, verdict.state
        outcome = _outcome(now, index, path, reason, config)
        command = (0.0, 0.0, 0.0) if outcome else command
        history.sent(command)
        row = _observed(now) | {
            "cmd_v_x_mps": command[0],
            "cmd_v_y_mps": command[1],
            "cmd_yaw_rate_radps": command[2],
            "kp": decision.kp,
            "waypoint_index": index,
            "l_hat": decision.l_hat,
            "q": decision.q,
            "score": decision.score,
            "err": -1 if decision.err is None else int(decision.err),
            "supervisor": reason.value if reason else "",
            "outcome": outcome,
        }
        yield {name: row[name] for name in COLUMNS}
        if outcome:
            return
        now = world.step(command)


def _supervised(
    state: SupervisorState,
    now: Observation,
    command: tuple[float, float, float],
    config: SupervisorConfig,
) -> Verdict:
    facts = Facts(
        t_s=now.t_s, x_m=now.position[0], y_m=now.position[1], pose_valid=now.confidence > 0
    )
    return supervise(state, facts, command, config)


def _outcome(
    now: Observation, index: int, path: Path, reason: Reason | None, config: RunConfig
) -> str:
    """Return why the run ends here, or nothing."""
    rules = (
        ("arrived", arrived(index, now.pose, path)),
        ("wall", now.touched),
        ("geofence", reason is Reason.GEOFENCE),
        ("fell", now.fell),
        ("timeout", now.t_s >= config.max_s),
    )
    return next((name for name, applies in rules if applies), "")


def _observed(now: Observation) -> dict[str, Any]:
    x, y, z = now.position
    true_x, true_y, true_yaw = now.true_pose or (np.nan, np.nan, np.nan)
    return {
        "t_s": now.t_s,
        "x_m": x,
        "y_m": y,
        "z_m": z,
        **dict(zip(("qx", "qy", "qz", "qw"), now.quaternion, strict=True)),
        "yaw_rad": now.yaw,
        "v_x_mps": now.twist[0],
        "v_y_mps": now.twist[1],
        "yaw_rate_radps": now.twist[2],
        "confidence": now.confidence,
        "slam_error": now.slam_error,
        "true_x_m": true_x,
        "true_y_m": true_y,
        "true_yaw_rad": true_yaw,
    }


def _future_error(
    world: World, now: Observation, path: Path, index: int, kp: float, config: RunConfig
) -> float:
    """Return the true label of this step: the error at t + 2 if the gain stays as it is.

    The world's future is looked into on a copy, with its own noise, not with a second draw of it.
    """
    future: ForkableWorld = world.fork()  # pyright: ignore[reportAttributeAccessIssue]
    for _ in range(HORIZON):
        index = advance(index, now.pose, path, radius_m=config.advance_radius_m)
        wanted = velocity_command(now.pose, path.waypoints[index], kp)
        now = future.step(saturate(wanted, config.limits))
    return float(now.slam_error != 0)
