"""Can an agent learn to use the quantile where the quantile varies?

Trainings beyond the paper's: speed ranges and densities are drawn anew for each episode, so that
the forecast is good in some and bad in others. `wide` drives by itself; `gate` chooses between
pi_safe and pi_speed as the switch does, and a crash costs it five times as much. Each has a twin
that sees everything but the quantile.
"""

from dataclasses import dataclass

from cpl.experiments.trained.recipes import Training, retraining

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Training):
    """The trainings; see `cpl.experiments.trained.recipes.Training`."""

    recipes: tuple[str, ...] = ("wide", "wide_nq", "gate", "gate_nq")


PROFILES = {
    "smoke": Config(pairs=1, models="smoke", steps=1_500),
    "book": Config(pairs=1, recipes=("gate",), steps=30_000),
    "paper": Config(pairs=3),
}

EXPERIMENT = retraining(PROFILES)
