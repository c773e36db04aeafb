"""Track a quantile online: rules, trackers, and what can be proved about them."""

from cpl.conformal.batch import BatchTracker
from cpl.conformal.exact import ExactTrack, track_exact
from cpl.conformal.rules import (
    PI,
    Decaying,
    Fixed,
    Rule,
    RunningMax,
    StepRule,
    TrailingMax,
    TrailingRange,
)
from cpl.conformal.sequence import (
    Track,
    fed_back,
    step_sizes,
    track,
    track_episodes,
    track_many,
)
from cpl.conformal.state import StateRule
from cpl.conformal.tracker import Tracker

__all__ = [
    "PI",
    "BatchTracker",
    "Decaying",
    "ExactTrack",
    "Fixed",
    "Rule",
    "RunningMax",
    "StateRule",
    "StepRule",
    "Track",
    "Tracker",
    "TrailingMax",
    "TrailingRange",
    "fed_back",
    "step_sizes",
    "track",
    "track_episodes",
    "track_exact",
    "track_many",
]
