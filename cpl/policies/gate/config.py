"""The look-ahead's settings."""

from dataclasses import dataclass
from typing import Annotated

from cpl.settings.ranges import Choice, Count, Natural, Positive, Settings, interval

__all__ = ["ERRORS", "FORECASTS", "GateConfig"]

FORECASTS = ("velocity", "lane", "idm")
"""How the other cars are forecast; the order is the kernels' code."""
ERRORS = ("closing", "position", "clearance")
"""What the error of a forecast is; the order is the kernels' code."""

_SLOWER, _IDLE = 4, 1


@dataclass(frozen=True, kw_only=True)
class GateConfig(Settings):
    """How the gate looks ahead, and what it calls an error.

    Attributes:
        horizon: Decisions that are rolled out, and after which a forecast is scored [decisions].
        plan: What follows the action that is tried: "slower" or "idle".
        forecast: "velocity" (constant), "lane" (sideways, a car settles in the lane it aims at) or
            "idm" (lane, and it follows the observed car before it).
        actions: Actions that the gate may choose from, highway-env's numbers.
        stride: Frames between two looks at the distances; divides the frames of a decision.
        weight: Metres along the road that one metre across it is worth [-].
        growth: The margin wanted at time t of a horizon T is the margin times max(t / T, floor) to
            this power; 0 wants all of it at once [-].
        floor: Least of t / T in it [-].
        error: "closing" (the largest over the cars of forecast less seen clearance), "position"
            (the same of the size of the error) or "clearance" (of the nearest car).
        memory: Decisions for which a car that is not seen any more is still reckoned with
            [decisions].
        filtered: Standard deviation of the observation's noise that a Kalman filter reckons
            with, in units of the observation; 0 takes what is seen as it is [-].
        radius: From this weighted distance on, a row does not show the car forecast there [m].
        far: Clearance that counts where nobody is seen [m].
    """

    horizon: Count = 3
    plan: Annotated[str, Choice(("slower", "idle"))] = "slower"
    forecast: Annotated[str, Choice(FORECASTS)] = "lane"
    actions: tuple[int, ...] = (0, 1, 2, 3, 4)
    stride: Count = 3
    weight: Positive = 3.0
    growth: Annotated[float, interval("[0, inf)")] = 1.0
    floor: Positive = 0.2
    error: Annotated[str, Choice(ERRORS)] = "closing"
    memory: Natural = 3
    filtered: Annotated[float, interval("[0, inf)")] = 0.0
    radius: Positive = 20.0
    far: Positive = 60.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.actions or not set(self.actions) <= set(range(5)):
            raise ValueError(f"actions must be some of 0 to 4, got {self.actions!r}")

    @property
    def after(self) -> int:
        """The action that follows the one that is tried."""
        return _SLOWER if self.plan == "slower" else _IDLE
