"""What do the paper's two policies log when the robot has legs?

What `quadruped_walks` does, with the legged twin: three shapes, two ranges of the gain, pi_switch
and No Quantile, paired by seed. Needs the extra `legged`; its logs are recorded once and shipped.

Paper: Section V-C and V-D.
"""

from cpl.experiments.quadruped import legged_collect, legged_predictor
from cpl.experiments.quadruped.legged import LEGGED
from cpl.experiments.quadruped.quadruped_walks import CELL, Config, walking

__all__ = ["CELL", "EXPERIMENT", "PROFILES", "Config"]

PROFILES = {
    "smoke": Config(
        collect="smoke", policies=("paper",), shapes=("triangle",), repeats=1, epochs=2, max_s=2.0
    ),
    "book": Config(collect="book", policies=("paper", "no_quantile"), repeats=1),
    "paper": Config(collect="paper", policies=("paper", "no_quantile"), repeats=3),
}

EXPERIMENT = walking(
    LEGGED, legged_collect.PROFILES, legged_predictor.needs, PROFILES, extent=("repeats",)
)
