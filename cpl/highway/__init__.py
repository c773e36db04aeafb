"""The road: a compiled, batched engine that equals highway-env 1.12.1's highway-v0."""

from cpl.highway.config import FEATURES, PAPER, Config
from cpl.highway.engine import Engine, Info, Step
from cpl.highway.state import State

__all__ = ["FEATURES", "PAPER", "Config", "Engine", "Info", "State", "Step"]
