"""What stands between policy and robot? A state machine that can only make the robot slower.

The policy proposes a velocity, the supervisor passes it on scaled by a factor in [0, 1]. Every
intervention has a reason that goes into the log. It is a pure function of (state, facts, command),
so it runs unchanged in the twin, in the live loop and in a property test.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from math import hypot, isfinite

from cpl.settings.ranges import Positive, Settings

__all__ = ["Facts", "Reason", "SupervisorConfig", "SupervisorState", "Verdict", "supervise"]

Command = tuple[float, float, float]
TICK_S = 1e-6  # [s] clocks that count in tenths of a second are not exact


class Reason(StrEnum):
    """Why the supervisor did not pass the command on as it was; the first that applies is given."""

    BAD_COMMAND = "bad_command"  # not finite
    WATCHDOG = "watchdog"  # no fresh command
    GEOFENCE = "geofence"  # the estimated position is outside; latched
    STALE_POSE = "stale_pose"  # the last pose message is too old
    SLAM_LOST = "slam_lost"  # no VALID pose for too long, which is not one SLAM error
    RECOVERING = "recovering"  # the cause has gone, the hold has not yet been released
    SPEED_CLAMP = "speed_clamp"  # passed on, but slower


@dataclass(frozen=True, kw_only=True)
class SupervisorConfig(Settings):
    """When to intervene.

    Args:
        v_max_mps: Largest linear speed passed on [m/s].
        yaw_rate_max_radps: Largest yaw rate passed on [rad/s].
        fence_half_width_m: The estimated |x| and |y| must stay within this [m].
        command_age_s: A command older than this is not obeyed [s]; the Go1 has no time-out itself.
        pose_age_s: A pose message older than this is stale [s].
        lost_after_s: SLAM is lost when no valid pose came for this long [s].
        release_after_s: Poses must be valid for this long before a hold is released [s].
    """

    v_max_mps: Positive = 1.0
    yaw_rate_max_radps: Positive = 2.0
    fence_half_width_m: Positive = 3.0
    command_age_s: Positive = 0.3
    pose_age_s: Positive = 0.25
    lost_after_s: Positive = 0.5
    release_after_s: Positive = 0.3


@dataclass(frozen=True, kw_only=True)
class SupervisorState:
    """What the supervisor remembers from step to step.

    Args:
        fence_tripped: Once outside, a person must reset it.
        holding: A stale or lost pose stopped the robot.
        valid_since_s: Since when every pose was valid [s]; None while it is not.
        last_valid_s: When the last valid pose came [s]; None before the first call.
        t_s: Time of the last call [s]; None before the first call.
    """

    fence_tripped: bool = False
    holding: bool = False
    valid_since_s: float | None = None
    last_valid_s: float | None = None
    t_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What is known when a command is about to be sent.

    Args:
        t_s: Now [s], never smaller than in the call before.
        x_m: Estimated position along x [m].
        y_m: Estimated position along y [m].
        pose_valid: Whether the estimator stands by this pose (its confidence is above 0).
        pose_age_s: Age of the pose message [s].
        command_age_s: Age of the command [s].
    """

    t_s: float
    x_m: float
    y_m: float
    pose_valid: bool
    pose_age_s: float = 0.0
    command_age_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What is sent to the robot, and why it differs.

    Args:
        command: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        reason: None if the command was passed on as it was.
        state: To be given to the next call.
    """

    command: Command
    reason: Reason | None
    state: SupervisorState


def supervise(
    state: SupervisorState, facts: Facts, command: Command, config: SupervisorConfig
) -> Verdict:
    """Pass a command on, slow it down or stop it.

    The result is the command with its linear part scaled by a factor in [0, 1] and its yaw rate by
    another: it never turns the velocity and never makes it larger.

    Args:
        state: What the call before returned; `SupervisorState()` at first.
        facts: Time, pose and ages.
        command: What the policy wants: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        config: When to intervene.

    Returns:
        The command to send, the reason and the new state.

    Raises:
        ValueError: Time ran backwards.

    >>> facts = Facts(t_s=0.0, x_m=0.0, y_m=0.0, pose_valid=True)
    >>> clamped = supervise(SupervisorState(), facts, (2.0, 0.0, 0.1), SupervisorConfig())
    >>> clamped.command, clamped.reason.value
    ((1.0, 0.0, 0.1), 'speed_clamp')
    """
    state = _remember(state, facts, config)
    stop = _stop_reason(state, facts, command, config)
    if stop is not None:
        return Verdict(command=(0.0, 0.0, 0.0), reason=stop, state=state)
    v_x, v_y, yaw_rate = command
    speed = hypot(v_x, v_y)
    if speed <= config.v_max_mps and abs(yaw_rate) <= config.yaw_rate_max_radps:
        return Verdict(command=command, reason=None, state=state)
    linear = min(1.0, config.v_max_mps / speed) if speed > 0 else 1.0
    turn = min(1.0, config.yaw_rate_max_radps / abs(yaw_rate)) if yaw_rate else 1.0
    slower = (v_x * linear, v_y * linear, yaw_rate * turn)
    return Verdict(command=slower, reason=Reason.SPEED_CLAMP, state=state)


def _remember(state: SupervisorState, facts: Facts, config: SupervisorConfig) -> SupervisorState:
    """Return the state after these facts: time, validity, hold and fence."""
    t = facts.t_s
    if not isfinite(t) or (state.t_s is not None and t < state.t_s):
        raise ValueError(f"t_s must be finite and not run backwards, not {t} after {state.t_s}")
    known = isfinite(facts.x_m) and isfinite(facts.y_m)
    fresh = known and facts.pose_age_s <= config.pose_age_s
    valid = fresh and facts.pose_valid
    # Before any valid pose the clock of "lost" starts at the first call.
    last_valid = t if valid or state.last_valid_s is None else state.last_valid_s
    since = (t if state.valid_since_s is None else state.valid_since_s) if valid else None
    lost = t - last_valid >= config.lost_after_s - TICK_S
    released = since is not None and t - since >= config.release_after_s - TICK_S
    outside = known and max(abs(facts.x_m), abs(facts.y_m)) > config.fence_half_width_m
    return replace(
        state,
        fence_tripped=state.fence_tripped or outside,
        holding=(state.holding and not released) or lost or not fresh,
        valid_since_s=since,
        last_valid_s=last_valid,
        t_s=t,
    )


def _stop_reason(
    state: SupervisorState, facts: Facts, command: Command, config: SupervisorConfig
) -> Reason | None:
    fresh = isfinite(facts.x_m) and isfinite(facts.y_m) and facts.pose_age_s <= config.pose_age_s
    rules = (
        (Reason.BAD_COMMAND, not all(map(isfinite, command))),
        (Reason.WATCHDOG, not facts.command_age_s <= config.command_age_s),
        (Reason.GEOFENCE, state.fence_tripped),
        (Reason.STALE_POSE, not fresh),
        (Reason.SLAM_LOST, state.holding and state.valid_since_s is None),
        (Reason.RECOVERING, state.holding),
    )
    return next((reason for reason, applies in rules if applies), None)
