"""How fast may the robot ever be asked to go? The last word before the cable.

The supervisor of `cpl.quadruped` stops and slows; whatever comes out of it, and whatever arrives at
the watchdog, goes through this clamp once more. It is a scaling by factors in [0, 1], so it turns
nothing and speeds nothing up, and in floating point it never exceeds the envelope by a bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite

from cpl.robot.interfaces import ZERO, Command

__all__ = ["Envelope", "clamp", "factor", "within"]

SHRINK = 1 - 2**-40  # a scaled velocity must not exceed its limit by rounding


@dataclass(frozen=True, kw_only=True)
class Envelope:
    """The largest velocities.

    Args:
        v_max_mps: Linear speed [m/s].
        yaw_rate_max_radps: Yaw rate [rad/s].
    """

    v_max_mps: float = 1.0
    yaw_rate_max_radps: float = 2.0

    def __post_init__(self) -> None:
        for name in ("v_max_mps", "yaw_rate_max_radps"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, not {value}")


def factor(speed: float, limit: float) -> float:
    """Return the share of a speed that may be passed on, in [0, 1].

    limit / max(speed, limit)

    >>> factor(0.5, 1.0), factor(4.0, 1.0)
    (1.0, 0.25)
    """
    return limit / max(speed, limit)


def clamp(command: Command, envelope: Envelope) -> Command:
    """Scale a velocity into the envelope; one that is not finite becomes zero.

    Args:
        command: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        envelope: What is allowed.

    >>> clamp((0.5, 0.0, 0.1), Envelope()), clamp((float("nan"), 0.0, 0.0), Envelope())
    ((0.5, 0.0, 0.1), (0.0, 0.0, 0.0))
    """
    if within(command, envelope):
        return command
    if not all(map(isfinite, command)):
        return ZERO
    v_x, v_y, turn = command
    linear = factor(hypot(v_x, v_y), envelope.v_max_mps)
    angular = factor(abs(turn), envelope.yaw_rate_max_radps)
    linear *= SHRINK if linear < 1 else 1
    angular *= SHRINK if angular < 1 else 1
    return v_x * linear, v_y * linear, turn * angular


def within(command: Command, envelope: Envelope) -> bool:
    """Say whether a velocity is inside the envelope; NaN is not.

    >>> within((1.0, 0.0, 0.0), Envelope()), within((1.0, 0.1, 0.0), Envelope())
    (True, False)
    """
    v_x, v_y, turn = command
    return hypot(v_x, v_y) <= envelope.v_max_mps and abs(turn) <= envelope.yaw_rate_max_radps
