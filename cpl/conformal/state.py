"""Rules that keep a state of their own: what a member of the family has to say, and how it runs.

A step rule says how far feedback moves the threshold. Most methods published since 2021 do not fit
that form: they keep levels, weights, wealth or past scores, and *read* the threshold off them. Such
a rule is a frozen dataclass with three things:

- ``begin(alpha, q0)``, the state before any score, an array whose first entry is the threshold;
- ``numbers(alpha)``, its settings as an array;
- ``update``, a compiled function ``(state, numbers, score, met)`` that takes one piece of feedback:
  the score and the threshold that it met, which with late feedback is not the threshold of now.

Everything else (whole sequences, many streams, delay, episodes, live loops) is written once, here
and in `cpl.conformal._states`, and is the same for all of them.
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numba import cfunc, types
from numpy.typing import NDArray

__all__ = ["Running", "StateRule", "feedback"]

FloatArray: TypeAlias = NDArray[np.float64]

_PLACE = types.CPointer(types.float64)
_SIGNATURE = types.void(_PLACE, _PLACE, types.float64, types.float64)
_DOUBLES = ctypes.POINTER(ctypes.c_double)


def feedback(function: Any) -> Any:  # noqa: ANN401 - numba's function has no type of its own
    """Compile a rule's update, to machine code that Python and the compiled loops both call.

    One code for all uses: the tracker that takes one score after the other and the one that takes a
    whole sequence give the same bits because they run the same instructions.
    """
    return cfunc(_SIGNATURE, cache=True)(function)


class StateRule(ABC):
    """A rule that keeps a state and reads the threshold off it.

    To add one, write a module of `cpl.conformal.family` with a frozen dataclass derived from this
    class and a ``MEMBER`` that describes it: the laws in ``tests/conformal`` then run on it.
    """

    __slots__ = ()

    update: ClassVar[Any]
    """``(state, numbers, score, met)``: take one piece of feedback, from ``feedback``."""

    @abstractmethod
    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state before any score; its first entry is the threshold, ``q0``."""

    @abstractmethod
    def numbers(self, alpha: float) -> FloatArray:
        """Return what ``update`` needs to know of the settings; ``alpha`` comes first."""

    def most_errors(self, *, alpha: float, B: float, T: int) -> int | None:
        """Return the most errors in the first T steps on scores in [0, B]; None: no promise.

        For prompt feedback and a first threshold in [0, B].
        """
        del alpha, B, T
        return None


class Running:
    """A state rule at work on one sequence.

    Args:
        rule: The rule.
        alpha: The miscoverage aimed at.
        q0: The first threshold.
    """

    __slots__ = ("_call", "_numbers", "_settings", "state")

    def __init__(self, rule: StateRule, alpha: float, q0: float) -> None:
        self.state = rule.begin(alpha, q0)
        self._settings = rule.numbers(alpha)
        self._numbers = self._settings.ctypes.data_as(_DOUBLES)
        self._call = type(rule).update.ctypes

    def __deepcopy__(self, memo: dict[int, Any]) -> Running:
        twin = object.__new__(Running)
        twin.state = self.state.copy()
        twin._settings, twin._numbers, twin._call = self._settings, self._numbers, self._call
        return twin

    @property
    def q(self) -> float:
        """The threshold [score]; it may be infinite."""
        return float(self.state[0])

    def take(self, score: float, met: float) -> bool:
        """Take one piece of feedback; False, and nothing has changed, if the threshold is lost."""
        after = self.state.copy()
        self._call(after.ctypes.data_as(_DOUBLES), self._numbers, score, met)
        if np.isnan(after[0]):
            return False
        self.state = after
        return True
