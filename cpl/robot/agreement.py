"""Do the robot's legs agree with its camera? Two estimates of one place, compared in every step.

The robot counts its own steps (odometry), the camera looks at the room. Each may be wrong: the legs
drift, the camera loses track, is late, or counts from another origin. Where they part by more than
what is usual, at least one of them is, and the run ends. Two gates:

- position: d = camera - odometry is at most ``share`` times the way walked (one metre at least),
  and at most ``apart_m``;
- speed: d changes by at most ``change_m`` within ``over_s``.

The limits come from the shipped logs (`cpl.experiments.robot_agreement` has the false-alarm rates).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite

__all__ = ["Agreement", "AgreementConfig", "compare"]

Place = tuple[float, float]
TICK_S = 1e-6  # [s]


@dataclass(frozen=True, kw_only=True)
class AgreementConfig:
    """How far camera and odometry may part.

    Args:
        apart_m: Never more than this [m].
        share: Nor more than this share of the way walked, or of one metre before that [-].
        change_m: Nor may the difference change by more than this [m]
        over_s: within so long [s].
        arrived_m: The odometry must be this near to the last waypoint for "arrived" [m].
    """

    apart_m: float = 1.5
    share: float = 0.35
    change_m: float = 0.85
    over_s: float = 1.0
    arrived_m: float = 1.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, not {value}")


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """What is remembered of the two.

    Args:
        parts: Differences of the last `over_s`: time [s], x [m], y [m].
        walked_m: The way by odometry [m].
        last: The place by odometry [m]; None at first.
        broken: Whether they have parted.
    """

    parts: tuple[tuple[float, float, float], ...] = ()
    walked_m: float = 0.0
    last: Place | None = None
    broken: bool = False


def compare(
    state: Agreement, t_s: float, camera: Place, odometry: Place, config: AgreementConfig
) -> Agreement:
    """Return what is remembered after one more step; once parted, they stay so.

    Args:
        state: What was remembered.
        t_s: The time [s], growing.
        camera: The camera's place [m].
        odometry: The odometry's, in the same frame [m]. One that is no number agrees with nothing.
        config: How far they may part.

    >>> state = compare(Agreement(), 0.0, (0.0, 0.0), (0.0, 0.0), AgreementConfig())
    >>> compare(state, 0.1, (0.1, 0.0), (0.05, 0.0), AgreementConfig()).broken
    False
    >>> compare(state, 0.1, (0.4, 0.0), (0.0, 0.0), AgreementConfig()).broken
    True
    """
    x, y = camera[0] - odometry[0], camera[1] - odometry[1]
    last = state.last or odometry
    walked = state.walked_m + hypot(odometry[0] - last[0], odometry[1] - last[1])
    allowed = min(config.apart_m, config.share * max(1.0, walked))
    parts = tuple(each for each in state.parts if t_s - each[0] <= config.over_s + TICK_S)
    apart = not hypot(x, y) <= allowed
    fast = any(not hypot(x - u, y - v) <= config.change_m for _, u, v in parts)
    return Agreement(
        parts=(*parts, (t_s, x, y)),
        walked_m=walked,
        last=odometry,
        broken=state.broken or apart or fast,
    )
