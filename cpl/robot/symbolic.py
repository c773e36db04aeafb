"""Run a function on *all* real numbers: its own code, with z3 terms in the place of floats.

A term does arithmetic by noting it down. Where the code asks whether a comparison holds, both
answers are followed that the conditions so far allow, so a function is a finite set of paths, each
with its conditions and its result. That is symbolic execution; what is proved is proved of the
function that runs, with reals for floats (what rounding does is tested, not proved).

`math.hypot` and `math.isfinite` cannot be given terms. While a function is followed they are
replaced, in the modules that it lives in, by ones that can: a length is the root that is not
negative, and a real number is finite.
"""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

__all__ = ["Follow", "Number", "Path", "Real", "follow"]

Term = Any
Number = Any  # a float, or a `Real`
TIMEOUT = 2_000  # [ms] for one question whether a branch is possible


@dataclass(frozen=True)
class Path:
    """One way through a function.

    Attributes:
        conditions: What must hold of the inputs to go it.
        result: What it returned.
    """

    conditions: tuple[Term, ...]
    result: Any


class Real:
    """A real number that is not known. It does what the code does to a float."""

    def __init__(self, term: Term, run: Follow) -> None:
        self.term, self._run = term, run

    def __add__(self, other: Number) -> Real:
        return self._made(self.term + _term(other))

    def __sub__(self, other: Number) -> Real:
        return self._made(self.term - _term(other))

    def __mul__(self, other: Number) -> Real:
        return self._made(self.term * _term(other))

    def __truediv__(self, other: Number) -> Real:
        return self._run.quotient(self.term, _term(other))

    def __radd__(self, other: Number) -> Real:
        return self._made(_term(other) + self.term)

    def __rsub__(self, other: Number) -> Real:
        return self._made(_term(other) - self.term)

    def __rmul__(self, other: Number) -> Real:
        return self._made(_term(other) * self.term)

    def __rtruediv__(self, other: Number) -> Real:
        return self._run.quotient(_term(other), self.term)

    def __neg__(self) -> Real:
        return self._made(-self.term)

    def __abs__(self) -> Real:
        return -self if self < 0 else self

    def __lt__(self, other: Number) -> bool:
        return self._run.holds(self.term < _term(other))

    def __le__(self, other: Number) -> bool:
        return self._run.holds(self.term <= _term(other))

    def __gt__(self, other: Number) -> bool:
        return self._run.holds(self.term > _term(other))

    def __ge__(self, other: Number) -> bool:
        return self._run.holds(self.term >= _term(other))

    def __eq__(self, other: object) -> bool:
        return self._run.holds(self.term == _term(other))

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return id(self)

    def __bool__(self) -> bool:
        return self != 0

    def _made(self, term: Term) -> Real:
        return Real(term, self._run)


@dataclass
class Follow:
    """One run of a function along one path; `holds` decides, and notes what it decided."""

    z3: ModuleType
    decisions: list[bool]
    conditions: list[Term] = field(default_factory=list[Term])
    open: list[list[bool]] = field(default_factory=list[list[bool]])
    _at: int = 0
    _names: int = 0

    def real(self, name: str) -> Number:
        """Return a number of which nothing is known."""
        return Real(self.z3.Real(name), self)

    def quotient(self, above: Term, below: Term) -> Real:
        """Divide, without a division: q below = above."""
        term = self._new("q")
        self.conditions += [below != 0, term * below == above]
        return Real(term, self)

    def hypot(self, x: Number, y: Number) -> Number:
        """Return the length of a vector."""
        if not isinstance(x, Real) and not isinstance(y, Real):
            return math.hypot(x, y)
        u, v = _term(x), _term(y)
        term = self._new("r")
        self.conditions += [term >= 0, term * term == u * u + v * v]
        return Real(term, self)

    def holds(self, condition: Term) -> bool:
        """Say whether a comparison holds on this path."""
        condition = self.z3.simplify(condition)
        if self.z3.is_true(condition) or self.z3.is_false(condition):
            return bool(self.z3.is_true(condition))
        if self._at == len(self.decisions):
            self._decide(condition)
        answer = self.decisions[self._at]
        self._at += 1
        self.conditions.append(condition if answer else self.z3.Not(condition))
        return answer

    def _decide(self, condition: Term) -> None:
        """Follow what is possible; keep the other answer for later if that is possible too."""
        yes, no = (self._possible(each) for each in (condition, self.z3.Not(condition)))
        if yes and no:
            self.open.append([*self.decisions, False])
        self.decisions.append(yes)

    def _possible(self, condition: Term) -> bool:
        solver = self.z3.Solver()
        solver.set("timeout", TIMEOUT)
        solver.add(*self.conditions, condition)
        return solver.check() != self.z3.unsat  # not known counts as possible

    def _new(self, letter: str) -> Term:
        self._names += 1
        return self.z3.Real(f"{letter}!{self._names}")


def follow(
    function: Callable[[Follow], Any], *modules: ModuleType, limit: int = 10_000
) -> Iterator[Path]:
    """Yield all paths of a function.

    Args:
        function: Makes its own inputs (`Follow.real`) and returns what is asked about. One that
            raises `ValueError` refuses its inputs: that path is none.
        modules: Where `hypot` and `isfinite` are looked up.
        limit: Of paths.

    Raises:
        RuntimeError: More paths than that.

    >>> def positive(run):
    ...     x = run.real("x")
    ...     return abs(x) >= 0
    >>> [path.result for path in follow(positive)]
    [True, True]
    """
    import z3

    open_: list[list[bool]] = [[]]
    for _ in range(limit):
        if not open_:
            return
        run = Follow(z3, open_.pop())
        with suppress(ValueError), _replaced(run, modules):
            result = function(run)
            yield Path(tuple(run.conditions), result)
        open_ += run.open
    raise RuntimeError(f"a function with more than {limit} paths")


@contextmanager
def _replaced(run: Follow, modules: tuple[ModuleType, ...]) -> Iterator[None]:
    ours = {"hypot": run.hypot, "isfinite": _isfinite}
    kept = [(m, name, getattr(m, name)) for m in modules for name in ours if hasattr(m, name)]
    try:
        for module, name, _ in kept:
            setattr(module, name, ours[name])
        yield
    finally:
        for module, name, real in kept:
            setattr(module, name, real)


def _isfinite(value: Number) -> bool:
    return isinstance(value, Real) or math.isfinite(value)


def _term(value: Number) -> Term:
    """Return the term of a number: a float is taken for exactly what it is."""
    if isinstance(value, Real):
        return value.term
    import z3

    numerator, denominator = float(value).as_integer_ratio()
    return z3.Q(numerator, denominator)
