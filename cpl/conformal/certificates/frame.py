"""What a certificate is: a statement in words, its obligations for z3, and what is left to hand.

A *proof* is a list of obligations `given => goal`. z3 is asked for real numbers that satisfy what
is given and break the goal; "unsat" means that there are none, so the obligation holds for **all**
reals, not for the ones that somebody tried. Because anything follows from a contradiction, z3 is
also asked to satisfy each `given` alone.

A *counterexample* is the opposite: z3 is asked for numbers that satisfy everything, and returns
them as exact fractions.

z3 is imported when a certificate is checked, not before.
"""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

import html
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from types import ModuleType
from typing import Any, Literal

__all__ = ["Certificate", "Kind", "Obligation", "Status", "Term", "Verdict"]

Term = Any
"""A formula or a term of z3 (whose own annotations are a union of everything it can express)."""

Kind = Literal["proof", "counterexample"]
Status = Literal["proved", "found", "refuted", "contradictory", "unknown"]

TIMEOUT = 5_000  # [ms] for one query; the slowest takes a small fraction of it


@dataclass(frozen=True, kw_only=True)
class Obligation:
    """One question for z3: does `goal` follow from `given` (proof), or can both be true?"""

    name: str
    """What this step of the argument says."""
    given: tuple[Term, ...]
    """What is assumed."""
    goal: Term
    """What must follow; for a counterexample, what must be possible."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What z3 answered."""

    name: str
    """Name of the certificate."""
    kind: Kind
    """Proof or counterexample."""
    status: Status
    """`proved` and `found` are what one hopes for; the others name what went wrong."""
    obligation: str
    """The obligation that failed, or the counterexample's; empty for a proof that went through."""
    queries: int
    """Number of questions asked."""
    seconds: float
    """Wall time [s]."""
    model: dict[str, Fraction | bool] = field(default_factory=dict[str, Fraction | bool])
    """The numbers of a counterexample, exactly (also those that break a failed proof)."""

    @property
    def holds(self) -> bool:
        """Whether the certificate is good: every obligation proved, or the counterexample found."""
        return self.status in ("proved", "found")

    def __str__(self) -> str:
        """Return one line: the name, the answer, and the numbers if there are any."""
        numbers = ", ".join(f"{name} = {value}" for name, value in self.model.items())
        where = "" if self.holds else f" at '{self.obligation}'"
        return f"{self.name}: {self.status}{where}" + (f" ({numbers})" if numbers else "")


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """A statement about the tracker that a machine can check for all reals."""

    name: str
    """Unique name, in words."""
    kind: Kind
    """Whether the statement is proved, or broken by an example."""
    statement: str
    """The statement in words."""
    formula: str
    """The statement in LaTeX."""
    machine: str
    """What z3 is asked."""
    by_hand: str
    """What remains for a human to see (empty: nothing)."""
    paper: str
    """The place in the paper that it is about."""
    errata: tuple[int, ...] = ()
    """Numbers of the errata that it bears on."""
    build: Callable[[ModuleType], Iterable[Obligation]] = field(repr=False)
    """Makes the obligations, given the module `z3`."""

    def obligations(self) -> tuple[Obligation, ...]:
        """Return the questions for z3."""
        return tuple(self.build(_z3()))

    def check(self) -> Verdict:
        """Ask z3.

        Returns:
            `proved` or `found` if all is well. Otherwise `refuted` (with the numbers that break a
            proof, or without, if there is no counterexample), `contradictory` (what was assumed
            cannot be satisfied, so the proof would be empty) or `unknown`.
        """
        begun = time.perf_counter()
        queries = 0
        for obligation in self.obligations():
            ask = _proof if self.kind == "proof" else _counterexample
            for status, model in ask(obligation):
                queries += 1
                if status != "proved":
                    return self._verdict(status, obligation.name, queries, begun, model)
        return self._verdict("proved", "", queries, begun, {})

    def smtlib(self) -> str:
        """Return the obligations in SMT-LIB, for another solver.

        Each block must be answered `unsat` for a proof, `sat` for a counterexample.
        """
        z3 = _z3()
        blocks: list[str] = []
        for obligation in self.obligations():
            solver = z3.Solver()
            goal = z3.Not(obligation.goal) if self.kind == "proof" else obligation.goal
            solver.add(*obligation.given, goal)
            blocks.append(f"; {self.name}: {obligation.name}\n{solver.to_smt2()}")
        return "\n".join(blocks)

    def _verdict(
        self,
        status: Status,
        obligation: str,
        queries: int,
        begun: float,
        model: dict[str, Fraction | bool],
    ) -> Verdict:
        return Verdict(
            name=self.name,
            kind=self.kind,
            status=status,
            obligation=obligation,
            queries=queries,
            seconds=time.perf_counter() - begun,
            model=model,
        )

    def _repr_html_(self) -> str:
        """Return the certificate as a small table for a notebook."""
        rows = {
            "statement": html.escape(self.statement),
            "formula": f"\\({self.formula}\\)",
            "by machine": html.escape(self.machine),
            "by hand": html.escape(self.by_hand or "nothing"),
            "paper": html.escape(self.paper),
        }
        body = "".join(f"<tr><th>{key}</th><td>{value}</td></tr>" for key, value in rows.items())
        title = f"{html.escape(self.name)} ({self.kind})"
        return f"<table><caption>{title}</caption><tbody>{body}</tbody></table>"


def _z3() -> ModuleType:
    import z3

    return z3


def _proof(obligation: Obligation) -> Iterator[tuple[Status, dict[str, Fraction | bool]]]:
    """Ask whether the assumptions can be met, then whether the goal can be broken."""
    z3 = _z3()
    solver = z3.Solver()
    solver.set("timeout", TIMEOUT)
    solver.add(*obligation.given)
    answer = solver.check()
    if answer != z3.sat:
        yield ("contradictory" if answer == z3.unsat else "unknown"), {}
        return
    yield "proved", {}
    solver.add(z3.Not(obligation.goal))
    answer = solver.check()
    if answer == z3.sat:
        yield "refuted", _numbers(solver.model())
    else:
        yield ("proved" if answer == z3.unsat else "unknown"), {}


def _counterexample(
    obligation: Obligation,
) -> Iterator[tuple[Status, dict[str, Fraction | bool]]]:
    z3 = _z3()
    solver = z3.Solver()
    solver.set("timeout", TIMEOUT)
    solver.add(*obligation.given, obligation.goal)
    answer = solver.check()
    if answer == z3.sat:
        yield "found", _numbers(solver.model())
    else:
        yield ("refuted" if answer == z3.unsat else "unknown"), {}


def _numbers(model: Term) -> dict[str, Fraction | bool]:
    """Return a model's numbers exactly, sorted by name."""
    z3 = _z3()
    numbers: dict[str, Fraction | bool] = {}
    for symbol in sorted(model.decls(), key=lambda decl: decl.name()):
        value = model[symbol]
        if z3.is_bool(value):
            numbers[symbol.name()] = z3.is_true(value)
        elif z3.is_int_value(value) or z3.is_rational_value(value):
            numbers[symbol.name()] = Fraction(str(value.as_fraction()))
        elif z3.is_algebraic_value(value):
            # A root of a polynomial: rational to 20 digits, enough to be looked at.
            numbers[symbol.name()] = Fraction(str(value.approx(20).as_fraction()))
    return numbers
