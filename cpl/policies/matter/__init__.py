"""Does the quantile matter? Ask a log of scores, or a policy that can be played."""

from cpl.policies.matter.log import LogAnswer, ask_log, read_log
from cpl.policies.matter.outcomes import Answer, judge
from cpl.policies.matter.play import Playable, play
from cpl.policies.matter.systems import SYSTEMS, WALKS, ask_system, ask_walks

__all__ = [
    "SYSTEMS",
    "WALKS",
    "Answer",
    "LogAnswer",
    "Playable",
    "ask_log",
    "ask_system",
    "ask_walks",
    "judge",
    "play",
    "read_log",
]
