"""Deep Q-learning on the road: Stable-Baselines3 as the reference, and a compiled equal."""

from cpl.policies.dqn.config import DQNConfig
from cpl.policies.dqn.curve import DivergedError
from cpl.policies.dqn.task import Wrapper
from cpl.policies.dqn.training import LearnerName, Trained, train

__all__ = ["DQNConfig", "DivergedError", "LearnerName", "Trained", "Wrapper", "train"]
