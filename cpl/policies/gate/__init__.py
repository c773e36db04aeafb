"""A look-ahead that lets actions pass, and the margin that it asks for."""

from cpl.policies.gate.config import ERRORS, FORECASTS, GateConfig
from cpl.policies.gate.gate import Gate, Sight, gated
from cpl.policies.gate.margins import (
    Adaptive,
    Averaged,
    Constant,
    Costly,
    Decision,
    Margin,
    Outcome,
    Recorded,
    Stacked,
    Tracked,
)

__all__ = [
    "ERRORS",
    "FORECASTS",
    "Adaptive",
    "Averaged",
    "Constant",
    "Costly",
    "Decision",
    "Gate",
    "GateConfig",
    "Margin",
    "Outcome",
    "Recorded",
    "Sight",
    "Stacked",
    "Tracked",
    "gated",
]
