"""A robot that walks by what it sees: paths, controller, gain rules, predictor, supervisor.

The twin that renders what the robot sees lives in `cpl.quadruped.kinematic`, which needs OpenCV
(the extra `quadruped`); nothing here does.
"""

from cpl.quadruped.controller import (
    Limits,
    advance,
    arrived,
    saturate,
    velocity_command,
    wrap_angle,
)
from cpl.quadruped.features import FEATURES, HORIZON, PAST, History, dataset, labels, upcoming
from cpl.quadruped.gains import (
    GAIN_RULES,
    GainLimits,
    constant_gain,
    corrected_gain,
    false_positive,
    no_quantile_gain,
    paper_gain,
)
from cpl.quadruped.metrics import (
    coverage,
    path_distance,
    summary,
    trajectory_error,
    windowed_coverage,
)
from cpl.quadruped.observation import ForkableWorld, Observation, World
from cpl.quadruped.paths import (
    SHAPES,
    Path,
    hexagon,
    polyline,
    rectangle,
    shape,
    triangle,
    zigzag,
)
from cpl.quadruped.permutation import SignFlip, sign_flip
from cpl.quadruped.policy import Decision, Policy, PolicyConfig
from cpl.quadruped.predictor import Predictor, decode_predictor, encode_predictor, unweighted
from cpl.quadruped.run import COLUMNS, OUTCOMES, RunConfig, run
from cpl.quadruped.supervisor import (
    Facts,
    Reason,
    SupervisorConfig,
    SupervisorState,
    Verdict,
    supervise,
)
from cpl.quadruped.training import TrainingConfig, auc, train

__all__ = [
    "COLUMNS",
    "FEATURES",
    "GAIN_RULES",
    "HORIZON",
    "OUTCOMES",
    "PAST",
    "SHAPES",
    "Decision",
    "Facts",
    "ForkableWorld",
    "GainLimits",
    "History",
    "Limits",
    "Observation",
    "Path",
    "Policy",
    "PolicyConfig",
    "Predictor",
    "Reason",
    "RunConfig",
    "SignFlip",
    "SupervisorConfig",
    "SupervisorState",
    "TrainingConfig",
    "Verdict",
    "World",
    "advance",
    "arrived",
    "auc",
    "constant_gain",
    "corrected_gain",
    "coverage",
    "dataset",
    "decode_predictor",
    "encode_predictor",
    "false_positive",
    "hexagon",
    "labels",
    "no_quantile_gain",
    "paper_gain",
    "path_distance",
    "polyline",
    "rectangle",
    "run",
    "saturate",
    "shape",
    "sign_flip",
    "summary",
    "supervise",
    "train",
    "trajectory_error",
    "triangle",
    "unweighted",
    "upcoming",
    "velocity_command",
    "windowed_coverage",
    "wrap_angle",
    "zigzag",
]
