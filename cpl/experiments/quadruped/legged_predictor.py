"""How well does the paper's network foresee the SLAM errors of the legged twin?

What `quadruped_predictor` does, on the zig-zags of `legged_collect`.
"""

from typing import Any

from cpl.experiments.quadruped import legged_collect
from cpl.experiments.quadruped.quadruped_predictor import (
    PROFILES,
    Config,
    need_predictor,
    predicting,
)
from cpl.experiments.run.spec import Need

__all__ = ["EXPERIMENT", "PROFILES", "Config", "needs"]


def needs(config: Any) -> list[Need]:  # noqa: ANN401 - see `need_predictor`
    """Ask for the network that walks of the legged twin are made with."""
    return need_predictor(config, "legged_predictor")


EXPERIMENT = predicting("legged_collect", legged_collect.EXPERIMENT, PROFILES)
