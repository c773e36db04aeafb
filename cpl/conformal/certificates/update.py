"""Certificates about the update equation: its sign, its argument, its target, its name."""

# Inequalities are written as in the mathematics, whichever side is the constant.
# ruff: noqa: SIM300
from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

from cpl.conformal.certificates.frame import Certificate, Obligation, Term
from cpl.conformal.certificates.symbols import as_number, setting, step

__all__ = ["CERTIFICATES"]


def _printed_update(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s = z3.Reals("q s")
    miss = as_number(z3, s > q)
    after = q - here.eta * (miss - here.alpha)
    given = (*here.given, *here.bounded(s), q < 0)
    yield Obligation(name="below 0 every score is missed", given=given, goal=miss == 1)
    yield Obligation(name="and a miss lowers q further", given=given, goal=after < q)


def _printed_update_gets_there(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    s = z3.Real("s_1")
    miss = as_number(z3, s > 0)
    after = -here.eta * (miss - here.alpha)
    yield Obligation(
        name="one step from the start value 0",
        given=(*here.given, *here.bounded(s), here.alpha == z3.Q(1, 10), here.B == 1),
        goal=after < 0,
    )


def _pinball(z3: ModuleType, level: Term, x: Term) -> Term:
    """Return the quantile loss of a residual: `level * x` above 0, `(level - 1) * x` below."""
    return z3.If(x >= 0, level * x, (level - 1) * x)


def _gradient_of_score(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, other, s = z3.Reals("q q_other s")
    miss = as_number(z3, s > q)
    loss_here = _pinball(z3, 1 - here.alpha, s - q)
    loss_there = _pinball(z3, 1 - here.alpha, s - other)
    yield Obligation(
        name="alpha - err is a slope of the loss in q, at a tie too",
        given=here.given,
        goal=loss_there >= loss_here + (here.alpha - miss) * (other - q),
    )


def _gradient_as_printed(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    x, other = z3.Reals("x other")
    err = z3.Bool("err")
    yield Obligation(
        name="the slope of the loss at x = err - alpha is err - alpha",
        given=(*here.given, x == as_number(z3, err) - here.alpha),
        goal=_pinball(z3, 1 - here.alpha, other)
        >= _pinball(z3, 1 - here.alpha, x) + x * (other - x),
    )


def _target(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    N, W = z3.Reals("N W")
    bound = here.B + here.eta
    deviation = here.eta * (N - here.alpha * W)
    yield Obligation(
        name="a rate of 1 - alpha would break the window bound",
        given=(
            *here.given,
            2 * here.alpha < 1,
            W > 0,
            here.eta * W * (1 - 2 * here.alpha) >= bound,
            deviation < bound,
            deviation > -bound,
        ),
        goal=N < (1 - here.alpha) * W,
    )


def _not_proportional(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    first, second = z3.Reals("s_1 s_2"), z3.Reals("r_1 r_2")
    misses, path = step(z3, here, z3.RealVal(0), first)
    other_misses, other_path = step(z3, here, z3.RealVal(0), second)
    yield Obligation(
        name="two histories with the same last error and different quantiles",
        given=(*here.given, *here.bounded(*first, *second), here.B == 1, here.eta == 1),
        goal=z3.And(misses[1] == other_misses[1], path[2] != other_path[2]),
    )


CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="printed update absorbs misses",
        kind="proof",
        statement="With the printed minus sign a miss lowers q. Once q < 0 every score is missed "
        "and q falls for ever: 100 % errors.",
        formula=r"q_t<0 \;\Rightarrow\; \mathrm{err}_t=1,\; q_{t+1}=q_t-\eta(1-\alpha)<q_t",
        machine="both claims, for all reals",
        by_hand="induction over t",
        paper="the update equation, as printed",
        errata=(1,),
        build=_printed_update,
    ),
    Certificate(
        name="printed update reaches the trap",
        kind="counterexample",
        statement="One miss is enough to take the printed update below 0.",
        formula=r"q_1 = 0,\quad q_2 < 0",
        machine="a score and a step size, with alpha = 1/10 and B = 1",
        by_hand="",
        paper="the update equation, as printed",
        errata=(1,),
        build=_printed_update_gets_there,
    ),
    Certificate(
        name="corrected update descends the quantile loss",
        kind="proof",
        statement="alpha - err is a subgradient in q of the quantile loss of s - q, so gradient "
        "descent is q + eta (err - alpha): plus, and with the score in the argument.",
        formula=r"\rho_{1-\alpha}(s-q') \ge \rho_{1-\alpha}(s-q) + (\alpha-\mathrm{err})(q'-q)",
        machine="the subgradient inequality, for all reals, ties included",
        by_hand="",
        paper="the update equation, corrected",
        errata=(1,),
        build=_gradient_of_score,
    ),
    Certificate(
        name="printed argument hides the wrong sign",
        kind="proof",
        statement="The slope of the quantile loss at the printed argument err - alpha is err - "
        "alpha itself. So the printed update is q - eta (err - alpha), and the proof, which "
        "telescopes with a plus sign, contradicts it.",
        formula=r"\nabla\rho_{1-\alpha}(\mathrm{err}-\alpha) = \mathrm{err}-\alpha",
        machine="the subgradient inequality at both values of err",
        by_hand="the loss is differentiable there, so the subgradient is the gradient",
        paper="the update equation and the first display of the proof, as printed",
        errata=(1, 2),
        build=_gradient_as_printed,
    ),
    Certificate(
        name="mean error is near alpha, not 1 - alpha",
        kind="proof",
        statement="For alpha < 1/2 and W large enough, the window bound forbids an error rate of "
        "1 - alpha.",
        formula=r"W \ge \frac{B/\eta+1}{1-2\alpha} \;\Rightarrow\; \frac{N_W}{W} < 1-\alpha",
        machine="the implication from the two-sided bound",
        by_hand="",
        paper="'the feedback signal is err_t and we would like it close to 1 - alpha'",
        errata=(9,),
        build=_target,
    ),
    Certificate(
        name="not proportional control",
        kind="counterexample",
        statement="Two histories end with the same error and different quantiles. Proportional "
        "control of the error has no such memory; integral control does ('telescoping equality').",
        formula=r"\mathrm{err}_2=\mathrm{err}'_2,\quad q_3 \ne q'_3",
        machine="four scores, with eta = B = 1",
        by_hand="",
        paper="'a simple form of P-control'",
        errata=(10,),
        build=_not_proportional,
    ),
)
