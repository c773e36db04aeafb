"""The road: a compiled, batched engine that equals highway-env 1.12.1's highway-v0.

Importing this package registers the Gymnasium environment `cpl/highway-v0`. The adapter for
Stable-Baselines3 is in `cpl.highway.sb3` and imported by whoever needs it.
"""

from cpl.highway.config import FEATURES, PAPER, Config
from cpl.highway.distances import nearest_distances
from cpl.highway.engine import Engine, Info, Step
from cpl.highway.env import ACTIONS, HighwayEnv, register
from cpl.highway.episodes import Decision, Plan, Turn, episodes
from cpl.highway.options import RENDER_OPTIONS, change_config, highway_env_options, make_config
from cpl.highway.paths import PathReport, active_path, path_report
from cpl.highway.render import Renderer
from cpl.highway.replay import Replay, export_replay, read_replay, record_replay
from cpl.highway.rollout import Policy, Transition, rollout, run_episodes
from cpl.highway.state import State
from cpl.highway.vector import HighwayVectorEnv

__all__ = [
    "ACTIONS",
    "FEATURES",
    "PAPER",
    "RENDER_OPTIONS",
    "Config",
    "Decision",
    "Engine",
    "HighwayEnv",
    "HighwayVectorEnv",
    "Info",
    "PathReport",
    "Plan",
    "Policy",
    "Renderer",
    "Replay",
    "State",
    "Step",
    "Transition",
    "Turn",
    "active_path",
    "change_config",
    "episodes",
    "export_replay",
    "highway_env_options",
    "make_config",
    "nearest_distances",
    "path_report",
    "read_replay",
    "record_replay",
    "register",
    "rollout",
    "run_episodes",
]

register()
