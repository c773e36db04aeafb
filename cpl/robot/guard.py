"""What a real robot adds to the supervisor: reasons to end the run, and the last clamp.

`cpl.quadruped.supervise` clamps, fences and waits for poses. On a robot there is also an operator,
a battery, a clock, a cable, a pose that may jump, be late or count from another origin, and legs
that know better. `guard` asks the supervisor first and can only take away from what that passes on.
It is a pure function of (state, facts, command).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import hypot, isfinite, nan

from cpl.quadruped import Facts, Reason, SupervisorConfig, SupervisorState, supervise
from cpl.robot.agreement import Agreement, AgreementConfig, compare
from cpl.robot.envelope import Envelope, clamp
from cpl.robot.interfaces import ZERO, Command, Mode

__all__ = ["SUPERVISOR", "GuardConfig", "GuardState", "RobotFacts", "Ruling", "Stop", "guard"]

SUPERVISOR = SupervisorConfig(pose_age_s=0.15)
"""The supervisor's settings on a robot, whose camera gives 200 poses in a second."""


class Stop(StrEnum):
    """Why a run ends before its path does. Each is latched: only a new run begins anew."""

    OPERATOR = "operator"  # Ctrl-C or Enter
    DAMPED = "damped"  # the remote's emergency stop: the motors give way
    WATCHDOG = "watchdog"  # the watchdog no longer obeys, or is gone
    CLOCK = "clock"  # time ran backwards, or the loop stood still
    LINK = "link"  # the robot has not answered for too long
    BATTERY = "battery"
    CAMERA = "camera"  # its poses are old for too long, or count from another origin
    ODOMETRY = "odometry"  # the robot's own odometry and the camera have parted


class Hold(StrEnum):
    """Why the robot waits for now."""

    NO_ANSWER = "no_answer"  # the robot has not answered for a moment
    POSE_JUMP = "pose_jump"  # farther than it can have walked


@dataclass(frozen=True, kw_only=True)
class GuardConfig:
    """When to intervene.

    Args:
        supervisor: The supervisor's settings, speed limits and fence among them.
        battery_min: Least state of charge to walk with [%].
        answer_s: Without an answer of the robot for this long it is asked to stand still [s].
        link_s: Without an answer for this long the run ends [s].
        gap_s: A step that took longer than this is a fault of clock or computer [s].
        jump_m: A pose that moved farther between two steps than this jumped [m].
        settle_s: How long the robot waits after a jump [s].
        stale_s: When poses were older than the supervisor allows for this long, the run ends [s].
        agreement: How far camera and odometry may part; None where there is no odometry.
    """

    supervisor: SupervisorConfig = SUPERVISOR
    battery_min: int = 20
    answer_s: float = 0.3
    link_s: float = 1.0
    gap_s: float = 1.0
    jump_m: float = 0.5
    settle_s: float = 0.3
    stale_s: float = 0.3
    agreement: AgreementConfig | None = field(default_factory=AgreementConfig)

    def __post_init__(self) -> None:
        if not 0 <= self.battery_min <= 100:
            raise ValueError(f"battery_min must be in [0, 100], not {self.battery_min}")
        for name in ("answer_s", "link_s", "gap_s", "jump_m", "settle_s", "stale_s"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, not {value}")

    @property
    def envelope(self) -> Envelope:
        """What no command leaves."""
        limits = self.supervisor
        return Envelope(v_max_mps=limits.v_max_mps, yaw_rate_max_radps=limits.yaw_rate_max_radps)


@dataclass(frozen=True, kw_only=True)
class GuardState:
    """What is remembered from step to step."""

    supervisor: SupervisorState = field(default_factory=SupervisorState)
    stop: Stop | None = None
    fenced: bool = False
    settle_until_s: float = float("-inf")
    last_t_s: float | None = None
    last_place: tuple[float, float] | None = None
    stale_since_s: float | None = None
    agreement: Agreement = field(default_factory=Agreement)


@dataclass(frozen=True, kw_only=True)
class RobotFacts:
    """What is known when a command is about to be sent.

    Args:
        t_s: Time since the run began [s].
        x_m: Estimated position along x [m].
        y_m: Estimated position along y [m].
        pose_valid: Whether the estimator stands by this pose.
        pose_age_s: Since when the pose has not changed [s].
        command_age_s: How long the policy thought about it [s].
        answer_age_s: Age of the robot's last answer [s].
        battery: State of charge [%].
        mode: The robot's.
        operator: Whether somebody asked to stop.
        tripped: Whether the watchdog no longer obeys, or is gone.
        pose_fault: Whether no pose of the camera counts any more.
        odometry: x [m], y [m] of the robot by its own odometry, in the frame of the path.
    """

    t_s: float
    x_m: float
    y_m: float
    pose_valid: bool
    pose_age_s: float = 0.0
    command_age_s: float = 0.0
    answer_age_s: float = 0.0
    battery: int = 100
    mode: int = Mode.WALK
    operator: bool = False
    tripped: bool = False
    pose_fault: bool = False
    odometry: tuple[float, float] = (nan, nan)


@dataclass(frozen=True, kw_only=True)
class Ruling:
    """What is sent, why it differs from what was wanted, and whether the run is over.

    Args:
        command: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        reason: Empty if the command was passed on as it was.
        outcome: Empty while the run goes on.
        state: For the next call.
    """

    command: Command
    reason: str
    outcome: str
    state: GuardState


def guard(state: GuardState, facts: RobotFacts, command: Command, config: GuardConfig) -> Ruling:
    """Pass a command on, slow it down, or stop.

    Args:
        state: What the call before returned; `GuardState()` at first.
        facts: What is known now.
        command: What the policy wants: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        config: When to intervene.

    Returns:
        What to send. Nothing that the facts can say makes this raise.

    >>> facts = RobotFacts(t_s=0.0, x_m=0.0, y_m=0.0, pose_valid=True, battery=12,
    ...                    odometry=(0.0, 0.0))
    >>> ruling = guard(GuardState(), facts, (0.5, 0.0, 0.0), GuardConfig())
    >>> ruling.command, ruling.reason, ruling.outcome
    ((0.0, 0.0, 0.0), 'battery', 'battery')
    """
    stop = state.stop or _stop(state, facts, config)
    if stop is not None:  # the supervisor is not asked: a clock that runs backwards makes it raise
        return _end(replace(state, stop=stop), stop.value)
    verdict = supervise(state.supervisor, _plain(facts), command, config.supervisor)
    state = replace(_remember(state, facts, config), supervisor=verdict.state)
    if state.fenced:
        return _end(state, Reason.GEOFENCE.value)
    stop = _parted(state, facts, config)
    if stop is not None:
        return _end(replace(state, stop=stop), stop.value)
    hold = _hold(state, facts, config)
    if hold is not None:
        return Ruling(command=ZERO, reason=hold.value, outcome="", state=state)
    sent = clamp(verdict.command, config.envelope)
    reason = verdict.reason.value if verdict.reason else ""
    return Ruling(command=sent, reason=reason, outcome="", state=state)


def _end(state: GuardState, why: str) -> Ruling:
    return Ruling(command=ZERO, reason=why, outcome=why, state=state)


def _stop(state: GuardState, facts: RobotFacts, config: GuardConfig) -> Stop | None:
    last = state.last_t_s
    step_s = 0.0 if last is None else facts.t_s - last
    first = last is None
    rules = (
        (Stop.OPERATOR, facts.operator),
        (Stop.DAMPED, facts.mode == Mode.DAMPED),
        (Stop.WATCHDOG, facts.tripped),
        (Stop.CLOCK, not (isfinite(facts.t_s) and step_s <= config.gap_s)),
        (Stop.CLOCK, not (first or step_s > 0)),
        (Stop.LINK, not facts.answer_age_s <= config.link_s),
        (Stop.BATTERY, facts.battery < config.battery_min),
        (Stop.CAMERA, facts.pose_fault),
    )
    return next((stop for stop, applies in rules if applies), None)


def _parted(state: GuardState, facts: RobotFacts, config: GuardConfig) -> Stop | None:
    """Whether the camera's poses are of no use: old for too long, or not where the legs are."""
    since = state.stale_since_s
    if since is not None and not facts.t_s - since < config.stale_s:
        return Stop.CAMERA
    return Stop.ODOMETRY if state.agreement.broken else None


def _remember(state: GuardState, facts: RobotFacts, config: GuardConfig) -> GuardState:
    known = isfinite(facts.x_m) and isfinite(facts.y_m)
    place = (facts.x_m, facts.y_m) if known else state.last_place
    half = config.supervisor.fence_half_width_m
    seen = (*facts.odometry, *((facts.x_m, facts.y_m) if known else ()))
    outside = any(abs(each) > half for each in seen)  # by either estimate
    moved = 0.0
    if known and state.last_place is not None:
        moved = hypot(facts.x_m - state.last_place[0], facts.y_m - state.last_place[1])
    until = facts.t_s + config.settle_s if moved > config.jump_m else state.settle_until_s
    fresh = known and facts.pose_age_s <= config.supervisor.pose_age_s
    stale = facts.t_s if state.stale_since_s is None else state.stale_since_s
    return replace(
        state,
        fenced=state.fenced or outside,
        settle_until_s=until,
        last_t_s=facts.t_s,
        last_place=place,
        stale_since_s=None if fresh else stale,
        agreement=_agreement(state, facts, config) if known else state.agreement,
    )


def _agreement(state: GuardState, facts: RobotFacts, config: GuardConfig) -> Agreement:
    if config.agreement is None or not facts.answer_age_s <= config.answer_s:
        return state.agreement  # an odometry that is old says nothing of a robot that walks
    place = (facts.x_m, facts.y_m)
    return compare(state.agreement, facts.t_s, place, facts.odometry, config.agreement)


def _hold(state: GuardState, facts: RobotFacts, config: GuardConfig) -> Hold | None:
    if not facts.answer_age_s <= config.answer_s:
        return Hold.NO_ANSWER
    return Hold.POSE_JUMP if facts.t_s < state.settle_until_s else None


def _plain(facts: RobotFacts) -> Facts:
    return Facts(
        t_s=facts.t_s,
        x_m=facts.x_m,
        y_m=facts.y_m,
        pose_valid=facts.pose_valid,
        pose_age_s=facts.pose_age_s,
        command_age_s=facts.command_age_s,
    )
