"""Does an agent listen to the quantile if one thing about its training is changed?

Four rivals of the paper's explanation (Section IV-F: at training time the quantile is small), each
a training of pi_RL that differs in one thing: the quantile is an input too weak to be noticed; the
agent is too short-sighted for what the quantile announces; one number at one time says too little;
the quantile never varies. The last is the paper's own, on the paper's own road: only the forecast
is blurred, in some episodes more and in some less.
"""

from dataclasses import dataclass

from cpl.experiments.trained.recipes import Training, retraining

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Training):
    """The trainings; see `cpl.experiments.trained.recipes.Training`."""

    recipes: tuple[str, ...] = ("louder", "farther", "longer", "blurred")


PROFILES = {
    "smoke": Config(pairs=1, models="smoke", steps=1_500),
    "book": Config(pairs=1, recipes=("louder",), steps=30_000),
    "paper": Config(pairs=3),
}

EXPERIMENT = retraining(PROFILES)
