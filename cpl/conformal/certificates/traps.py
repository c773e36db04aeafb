"""Certificates about what looks harmless: frozen steps, clipping, saturation, coverage."""

# Inequalities are written as in the mathematics, whichever side is the constant.
# ruff: noqa: SIM300
from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

from cpl.conformal.certificates.frame import Certificate, Obligation, Term
from cpl.conformal.certificates.symbols import as_number, setting, step

__all__ = ["CERTIFICATES"]


def _frozen(z3: ModuleType) -> Iterator[Obligation]:
    alpha, q, s = z3.Reals("alpha q s")
    miss = as_number(z3, s > q)
    yield Obligation(
        name="a step of size zero changes nothing, and the same score is missed again",
        given=(alpha > 0, alpha < 1, s > q),
        goal=z3.And(miss == 1, q + 0 * (miss - alpha) == q),
    )


def _trailing_maximum(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    c, q_2, q_3, q_4 = z3.Reals("c q_2 q_3 q_4")
    s_1, s_2, s_3 = z3.Reals("s_1 s_2 s_3")
    world = (
        here.alpha == z3.Q(1, 10),
        here.B == 1,
        here.eta == 1,
        c > 0,
        *here.bounded(s_1, s_2, s_3),
        s_3 == 0,
    )

    def largest(s: Term, t: Term) -> Term:
        return z3.If(s >= t, s, t)

    path = (
        q_2 == c * s_1 * (as_number(z3, s_1 > 0) - here.alpha),
        q_3 == q_2 + c * largest(s_1, s_2) * (as_number(z3, s_2 > q_2) - here.alpha),
        q_4 == q_3 + c * largest(s_2, s_3) * (as_number(z3, s_3 > q_3) - here.alpha),
    )
    yield Obligation(
        name="below 0 when the window of two has only zeros in it from now on",
        given=(*world, *path),
        goal=q_4 < 0,
    )


def _clip_state(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)

    def clipped(x: Term) -> Term:
        return z3.If(x > here.B, here.B, z3.If(x < 0, z3.RealVal(0), x))

    given = (*here.given, here.eta <= here.B, 2 * here.alpha <= 1)
    (first,), (_, down) = step(z3, here, here.B, [here.B])
    (second,), (_, up) = step(z3, here, clipped(down), [here.B])
    yield Obligation(
        name="cover, miss, and back at B",
        given=given,
        goal=z3.And(first == 0, second == 1, clipped(up) == here.B),
    )


def _clip_below(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s, total, first, N, W = z3.Reals("q s total q_first N W")
    (miss,), (_, after) = step(z3, here, q, [s])
    floored = z3.If(after < 0, z3.RealVal(0), after)
    given = (*here.given, *here.bounded(s), q >= 0, q < here.high, first >= 0)
    yield Obligation(
        name="the quantile stays in the range",
        given=given,
        goal=z3.And(floored >= 0, floored < here.high),
    )
    yield Obligation(
        name="the telescoped sum is an upper bound",
        given=(*given, here.eta * total <= q - first),
        goal=here.eta * (total + miss - here.alpha) <= floored - first,
    )
    yield Obligation(
        name="so the upper side of the window bound survives",
        given=(*given, here.eta * (N - here.alpha * W) <= q - first),
        goal=here.eta * (N - here.alpha * W) < here.B + here.eta,
    )


def _clip_below_lower(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    (miss,), (_, after) = step(z3, here, z3.RealVal(0), [z3.RealVal(0)])
    floored = z3.If(after < 0, z3.RealVal(0), after)
    yield Obligation(
        name="zeros are covered for ever",
        given=here.given,
        goal=z3.And(miss == 0, floored == 0),
    )


def _wind_up(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q = z3.Real("q")
    shown = z3.If(q < 0, z3.RealVal(0), z3.If(q > here.B, here.B, q))
    (miss,), _ = step(z3, here, shown, [z3.RealVal(0)])
    yield Obligation(
        name="a zero score is covered at any q, so q falls without end",
        given=here.given,
        goal=z3.And(miss == 0, q + here.eta * (miss - here.alpha) == q - here.alpha * here.eta),
    )


def _dangerous(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, later, n, m = z3.Reals("q q_later n m")
    band = (1 - here.alpha) * here.eta
    (miss,), (_, after) = step(z3, here, q, [here.B])
    world = (*here.given, band <= here.B, q < band, q >= here.low)
    yield Obligation(name="the dangerous step is missed", given=world, goal=miss == 1)
    yield Obligation(
        name="with no miss among the harmless zeros, q is back where it was",
        given=(
            *world,
            n == m - 1,
            here.alpha * m >= 1,
            later == after - n * here.alpha * here.eta,
        ),
        goal=later < band,
    )
    yield Obligation(
        name="after a miss among the harmless zeros, q stays in the bottom band",
        given=(*here.given, later < band),
        goal=step(z3, here, later, [z3.RealVal(0)])[1][1] < band,
    )
    yield Obligation(
        name="and a zero is missed only below 0, after which q is in the bottom band",
        given=(*here.given, later < 0),
        goal=step(z3, here, later, [z3.RealVal(0)])[1][1] < band,
    )


def _saturated(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    E, r, s, m, U = z3.Reals("E r s m U")
    q = here.eta * E + r
    miss = as_number(z3, s > q)
    after = E + miss - here.alpha
    integrator = (
        z3.Implies(E >= 0, r >= 0),
        z3.Implies(E <= 0, r <= 0),
        m >= 0,
        z3.Implies(E >= m, z3.Or(r >= here.B, here.eta * E >= here.B)),
    )
    given = (*here.given, *here.bounded(s), *integrator, E >= -here.alpha, E <= U)
    smaller = z3.If(U < m, U, m)
    step_up = smaller + 1 - here.alpha
    envelope = z3.If(U - here.alpha > step_up, U - here.alpha, step_up)
    yield Obligation(name="lower side", given=given, goal=after >= -here.alpha)
    yield Obligation(name="upper side", given=given, goal=after <= envelope)


def _saturated_late(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    E, before, r, s, m, U = z3.Reals("E E_before r s m U")
    err = z3.Bool("err_before")
    q = here.eta * E + r
    after = E + as_number(z3, s > q) - here.alpha
    integrator = (
        z3.Implies(before >= 0, r >= 0),
        z3.Implies(before <= 0, r <= 0),
        m >= 0,
        z3.Or(z3.Implies(before >= m, r >= here.B), here.eta * m >= here.B),
        E == before + as_number(z3, err) - here.alpha,
    )
    given = (
        *here.given,
        *here.bounded(s),
        *integrator,
        E >= -2 * here.alpha,
        E <= U,
    )
    late = m + 1 - here.alpha
    smaller = z3.If(U < late, U, late)
    step_up = smaller + 1 - here.alpha
    envelope = z3.If(U - here.alpha > step_up, U - here.alpha, step_up)
    yield Obligation(name="lower side", given=given, goal=after >= -2 * here.alpha)
    yield Obligation(name="upper side", given=given, goal=after <= envelope)


def _lag_breaks(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    E, before, r, s = z3.Reals("E E_before r s")
    err = z3.Bool("err_before")
    yield Obligation(
        name="a stale integrator covers once too often",
        given=(
            *here.given,
            *here.bounded(s),
            here.alpha == z3.Q(1, 10),
            here.B == 1,
            here.eta == 1,
            before > 0,
            r > 0,
            E == before + as_number(z3, err) - here.alpha,
        ),
        goal=E + as_number(z3, s > here.eta * E + r) - here.alpha < -here.alpha,
    )


CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="a step of zero freezes",
        kind="proof",
        statement="Where the step is zero a miss has no consequence: the same score is missed for "
        "ever. A trailing range is zero for constant scores, a trailing maximum for zeros.",
        formula=r"\eta_t=0,\ s>q_t \;\Rightarrow\; \mathrm{err}_t=1,\ q_{t+1}=q_t",
        machine="one step",
        by_hand="induction over t",
        paper="'eta_t = 0.1 B_hat_t'",
        errata=(11,),
        build=_frozen,
    ),
    Certificate(
        name="trailing maximum can freeze below zero",
        kind="counterexample",
        statement="With the step c times the maximum of the last two scores, the quantile can be "
        "below zero when only zeros are left in the window: perfect predictions (score 0) are then "
        "rejected for ever ('a step of zero freezes').",
        formula=r"\eta_t=c\max(s_{t-1},s_t):\quad q_4<0,\ s_3=s_4=\dots=0",
        machine="two scores and c, with alpha = 1/10 and B = 1",
        by_hand="",
        paper="'eta_t = 0.1 B_hat_t ... trivial to get a guarantee', for the reading that is false",
        errata=(11,),
        build=_trailing_maximum,
    ),
    Certificate(
        name="clipping the state loses the guarantee",
        kind="proof",
        statement="If q is clipped to [0, B], then at q = B the score B is covered, missed, "
        "covered, missed, ...: an error rate of 1/2 for every alpha <= 1/2.",
        formula=r"q=B \to B-\alpha\eta \to \min(B, B+(1-2\alpha)\eta) = B",
        machine="the two steps of the cycle",
        by_hand="",
        paper="not in the paper",
        build=_clip_state,
    ),
    Certificate(
        name="clipping at zero keeps the upper side",
        kind="proof",
        statement="If q is only kept from falling below 0, it is never lower than the telescoped "
        "sum says, so the upper side of the window bound survives.",
        formula=r"q \leftarrow \max(0,\,q+\eta(\mathrm{err}-\alpha)) \;\Rightarrow\; "
        r"N_W < \alpha W+\frac B\eta+1",
        machine="the range, the sum, the bound",
        by_hand="induction over W",
        paper="not in the paper",
        build=_clip_below,
    ),
    Certificate(
        name="clipping at zero loses the lower side",
        kind="proof",
        statement="With the same clipping zeros are covered for ever: no misses, where the lower "
        "side of the bound promises about alpha W.",
        formula=r"s_t=0 \;\Rightarrow\; N_W=0",
        machine="one step from 0 leads back to 0 without a miss",
        by_hand="",
        paper="not in the paper",
        build=_clip_below_lower,
    ),
    Certificate(
        name="clipping only the comparison winds up",
        kind="proof",
        statement="If the score is compared with q clipped to [0, B] but q itself runs free, zero "
        "scores lower q for ever, and it takes as long to come back.",
        formula=r"s_t=0 \;\Rightarrow\; q_t = q_1-\alpha\eta(t-1)",
        machine="one step from any q",
        by_hand="",
        paper="not in the paper",
        build=_wind_up,
    ),
    Certificate(
        name="every dangerous step missed",
        kind="proof",
        statement="If a dangerous step (score B) comes once in m >= 1 / alpha steps and all others "
        "score 0, every dangerous step is missed, although the error rate is alpha.",
        formula=r"m\alpha \ge 1,\ (1-\alpha)\eta \le B \;\Rightarrow\; "
        r"\Pr(\mathrm{err}\mid\text{danger}) = 1",
        machine="the dangerous step, and both ways back below (1 - alpha) eta before the next one",
        by_hand="induction over the dangerous steps",
        paper="coverage read as safety",
        errata=(20,),
        build=_dangerous,
    ),
    Certificate(
        name="saturated integrator without lag",
        kind="proof",
        statement="Let the integrator have the sign of the excess E of misses, and let q reach B "
        "once E >= m. Then E never falls below -alpha, and its upper bound U moves to "
        "max(U - alpha, min(U, m) + 1 - alpha).",
        formula=r"-\alpha \le E_{n+1} \le \max(U_n-\alpha,\ \min(U_n,m_n)+1-\alpha)",
        machine="one step, for every such integrator",
        by_hand="that tan(E log n / (C n)) is such an integrator; induction over n",
        paper="'conformal PID control'",
        errata=(19,),
        build=_saturated,
    ),
    Certificate(
        name="saturated integrator with lag",
        kind="proof",
        statement="If the integrator sees the excess of one step before, as in the public code, "
        "both sides give way by one more step: -2 alpha, and m + 2 (1 - alpha).",
        formula=r"-2\alpha \le E_{n+1} \le \max(U_n-\alpha,\ \min(U_n,m_n+1-\alpha)+1-\alpha)",
        machine="one step, for every such integrator",
        by_hand="that tan(E log n / (C n)) is such an integrator; induction over n",
        paper="'conformal PID control'",
        errata=(19,),
        build=_saturated_late,
    ),
    Certificate(
        name="lag breaks the range without lag",
        kind="counterexample",
        statement="With the lag, E can fall below -alpha.",
        formula=r"E_{n+1} < -\alpha",
        machine="an excess, an integrator and a score, with alpha = 1/10 and eta = B = 1",
        by_hand="",
        paper="'conformal PID control'",
        errata=(19,),
        build=_lag_breaks,
    ),
)
