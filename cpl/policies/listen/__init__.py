"""Learners that hear the forecast and its quantile: what reaches them, training, rides."""

from cpl.policies.listen.hearing import Hearing, Penalty, View
from cpl.policies.listen.lesson import Listening
from cpl.policies.listen.ride import Choose, Heard, Intervene, best, by_chooser, ride

__all__ = [
    "Choose",
    "Heard",
    "Hearing",
    "Intervene",
    "Listening",
    "Penalty",
    "View",
    "best",
    "by_chooser",
    "ride",
]
