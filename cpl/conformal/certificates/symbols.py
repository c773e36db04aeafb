"""The symbols that certificates share, and one step of the tracker in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

from cpl.conformal.certificates.frame import Term

__all__ = ["Setting", "as_number", "setting", "step"]


@dataclass(frozen=True, kw_only=True)
class Setting:
    """The reals `alpha`, `eta` and `B`, and what is always assumed of them."""

    alpha: Term
    eta: Term
    B: Term
    given: tuple[Term, ...]

    @property
    def low(self) -> Term:
        """Lower end of the range of `q`, attained."""
        return -self.alpha * self.eta

    @property
    def high(self) -> Term:
        """Upper end of the range of `q`, not attained."""
        return self.B + (1 - self.alpha) * self.eta

    def bounded(self, *scores: Term) -> tuple[Term, ...]:
        """Say that scores lie in `[0, B]`."""
        return tuple(fact for s in scores for fact in (s >= 0, s <= self.B))


def setting(z3: ModuleType) -> Setting:
    """Return fresh symbols with `0 < alpha < 1`, `eta > 0`, `B > 0`."""
    alpha, eta, B = z3.Reals("alpha eta B")
    return Setting(alpha=alpha, eta=eta, B=B, given=(alpha > 0, alpha < 1, eta > 0, B > 0))


def as_number(z3: ModuleType, event: Term) -> Term:
    """Return 1 if an event happens, else 0."""
    return z3.If(event, z3.RealVal(1), z3.RealVal(0))


def step(
    z3: ModuleType, here: Setting, q: Term, scores: Sequence[Term]
) -> tuple[list[Term], list[Term]]:
    """Run the corrected update from `q` through some scores.

    Returns:
        The misses as numbers 0 or 1, and the quantiles, of which there is one more.
    """
    misses: list[Term] = []
    path = [q]
    for s in scores:
        misses.append(as_number(z3, s > path[-1]))
        path.append(path[-1] + here.eta * (misses[-1] - here.alpha))
    return misses, path
