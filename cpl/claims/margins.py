"""The smallest effects that matter, with the reason for each: one principle for all quantities.

An effect counts if it is at least a twentieth of the range that the quantity spans on these roads.
A reader of Table I or Figure 2 could not see less, and nobody would change a car's policy for it.
They were fixed with the second edition's rules, when the data of the first had been seen and
before any of the second's.
"""

from dataclasses import dataclass

__all__ = ["CRASH", "DURATION", "PER_KM", "QUANTILE", "RATIO", "SHARE", "SPEED", "Margin"]


@dataclass(frozen=True, kw_only=True)
class Margin:
    """The smallest effect that matters.

    Attributes:
        value: How large, in the unit.
        unit: Its unit; ``1`` for shares and ratios.
        reason: Why that much.
    """

    value: float
    unit: str
    reason: str

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.value:g}{unit}: {self.reason}"


DURATION = Margin(
    value=2.0,
    unit="s",
    reason="a twentieth of an episode of 40 s; what row 29 calls the same cell of Table I",
)
SPEED = Margin(
    value=0.7,
    unit="m/s",
    reason="a twentieth of the 14 m/s between pi_safe (20) and pi_speed (34)",
)
CRASH = Margin(value=0.05, unit="1", reason="a twentieth of all episodes: five in a hundred")
SHARE = Margin(value=0.05, unit="1", reason="a twentieth of all that is counted")
PER_KM = Margin(
    value=0.07,
    unit="1/km",
    reason="a twentieth of the 1.4 collisions per km of a car that never switches",
)
QUANTILE = Margin(
    value=0.015,
    unit="1",
    reason="a twentieth of the way from 0 to the switch's threshold of 0.3",
)
RATIO = Margin(value=0.05, unit="1", reason="a twentieth of the compared duration")
