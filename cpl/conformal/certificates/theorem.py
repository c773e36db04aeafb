"""Certificates about Theorem 1: the range of the quantile, the window bound, its exact form."""

# Inequalities are written as in the mathematics, whichever side is the constant.
# ruff: noqa: SIM300
from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

from cpl.conformal.certificates.frame import Certificate, Obligation
from cpl.conformal.certificates.symbols import setting, step

__all__ = ["CERTIFICATES"]


def _range(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s = z3.Reals("q s")
    _, (_, after) = step(z3, here, q, [s])
    given = (*here.given, *here.bounded(s), q >= here.low, q < here.high)
    yield Obligation(
        name="the start value 0 lies in the range",
        given=here.given,
        goal=z3.And(here.low <= 0, here.high > 0),
    )
    yield Obligation(name="no step leaves it below", given=given, goal=after >= here.low)
    yield Obligation(name="no step leaves it above", given=given, goal=after < here.high)


def _start(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s, start = z3.Reals("q s q_1")
    _, (_, after) = step(z3, here, q, [s])
    low = z3.If(start < here.low, start, here.low)
    common = (*here.given, *here.bounded(s), q >= low)
    inside = z3.And(start >= here.low, start < here.high)
    yield Obligation(
        name="a start inside the range widens nothing",
        given=(*common, inside, q < here.high),
        goal=z3.And(after >= here.low, after < here.high),
    )
    yield Obligation(
        name="a start below widens the range down to it",
        given=(*common, start < here.low, q < here.high),
        goal=z3.And(after >= start, after < here.high),
    )
    yield Obligation(
        name="a start above widens the range up to it",
        given=(*common, start >= here.high, q <= start),
        goal=z3.And(after >= here.low, after <= start),
    )


def _telescoping(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s, first, total = z3.Reals("q s q_first total")
    (miss,), (_, after) = step(z3, here, q, [s])
    yield Obligation(
        name="the empty sum",
        given=(*here.given, q == first, total == 0),
        goal=q == first + here.eta * total,
    )
    yield Obligation(
        name="one more term",
        given=(*here.given, q == first + here.eta * total),
        goal=after == first + here.eta * (total + miss - here.alpha),
    )


def _strict(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    first, last, N, W = z3.Reals("q_first q_last N W")
    in_range = [z3.And(q >= here.low, q < here.high) for q in (first, last)]
    given = (*here.given, *in_range, last == first + here.eta * (N - here.alpha * W))
    width = here.B + here.eta
    yield Obligation(name="upper side", given=given, goal=here.eta * (N - here.alpha * W) < width)
    yield Obligation(name="lower side", given=given, goal=here.eta * (N - here.alpha * W) > -width)


def _integers(z3: ModuleType) -> Iterator[Obligation]:
    N, whole = z3.Ints("N whole")
    x = z3.Real("x")
    yield Obligation(
        name="an integer below x + 1 is at most ceil(x)",
        given=(N < x + 1, whole - 1 < x, x <= whole),
        goal=N <= whole,
    )
    yield Obligation(
        name="an integer above x - 1 is at least floor(x)",
        given=(N > x - 1, whole <= x, x < whole + 1),
        goal=N >= whole,
    )


def _from_start(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    last, N, W = z3.Reals("q_last N W")
    given = (
        *here.given,
        last >= here.low,
        last < here.high,
        last == here.eta * (N - here.alpha * W),
    )
    yield Obligation(
        name="upper side", given=given, goal=here.eta * (N - here.alpha * (W - 1) - 1) < here.B
    )
    yield Obligation(name="lower side", given=given, goal=N >= here.alpha * (W - 1))


def _upper_attained(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, N, W = z3.Reals("q N W")
    (miss,), (_, after) = step(z3, here, q, [here.B])
    band = here.B - here.alpha * here.eta
    yield Obligation(
        name="one zero score puts the quantile at its lower end",
        given=here.given,
        goal=step(z3, here, z3.RealVal(0), [z3.RealVal(0)])[1][1] == here.low,
    )
    yield Obligation(
        name="below B, the score B is always missed",
        given=(*here.given, q < here.B),
        goal=miss == 1,
    )
    yield Obligation(
        name="the top band is never left again", given=(*here.given, q >= band), goal=after >= band
    )
    yield Obligation(
        name="in the band, at least alpha W + B / eta have been missed",
        given=(*here.given, q >= band, q == here.low + here.eta * (N - here.alpha * W)),
        goal=here.eta * N >= here.eta * here.alpha * W + here.B,
    )


def _lower_attained(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, first, N, W, whole = z3.Reals("q q_first N W whole")
    (miss,), (_, after) = step(z3, here, q, [z3.RealVal(0)])
    band = (1 - here.alpha) * here.eta
    yield Obligation(
        name="above 0, the score 0 is always covered", given=(*here.given, q >= 0), goal=miss == 0
    )
    yield Obligation(
        name="the bottom band is never left again", given=(*here.given, q < band), goal=after < band
    )
    target = here.eta * (here.alpha * (W - 1) - whole)
    yield Obligation(
        name="the start to steer to lies in the range's last step",
        given=(
            *here.given,
            here.eta * whole <= here.eta * here.alpha * W - here.B,
            here.eta * (whole + 1) > here.eta * here.alpha * W - here.B,
        ),
        goal=z3.And(target >= here.B - here.alpha * here.eta, target < here.high),
    )
    yield Obligation(
        name="from there, in the band, fewer than floor(alpha W - B / eta) + 1 have been missed",
        given=(
            *here.given,
            first == target,
            q < band,
            q == first + here.eta * (N - here.alpha * W),
        ),
        goal=N < whole + 1,
    )


def _run(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, n = z3.Reals("q n")
    given = (*here.given, n >= 1, q == here.low + (n - 1) * (1 - here.alpha) * here.eta)
    yield Obligation(
        name="the n-th miss in a row can happen only if n (1 - alpha) < B / eta + 1",
        given=given,
        goal=(q < here.B) == (here.eta * n * (1 - here.alpha) < here.B + here.eta),
    )


def _vacuous(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    W = z3.Int("W")
    for alpha, longest in ((z3.Q(1, 10), 12), (z3.Q(1, 5), 13)):
        given = (*here.given, here.B == 10 * here.eta, here.alpha == alpha, W >= 1)
        yield Obligation(
            name=f"alpha = {alpha}: up to W = {longest} the bound is at least 1",
            given=(*given, W <= longest),
            goal=here.alpha * z3.ToReal(W) + 11 > z3.ToReal(W),
        )
        path = step(z3, here, here.low, [here.B] * longest)
        yield Obligation(
            name=f"alpha = {alpha}: {longest} misses in a row are possible",
            given=given,
            goal=sum(path[0]) == longest,
        )


CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="range of the quantile",
        kind="proof",
        statement="The quantile never leaves [-alpha eta, B + (1 - alpha) eta), whoever chooses "
        "the scores: nothing but 0 <= s <= B is assumed of them, so they may depend on q, on the "
        "past and on a policy.",
        formula=r"-\alpha\eta \le q_t < B + (1-\alpha)\eta \quad\text{for all } t",
        machine="the start, and one step from anywhere in the range, for all reals",
        by_hand="induction over t",
        paper="Theorem 1, last line of the proof, corrected",
        errata=(4, 5),
        build=_range,
    ),
    Certificate(
        name="start value of the quantile",
        kind="proof",
        statement="A start value inside the range changes nothing; one outside widens the range "
        "to include it, and not more.",
        formula=r"\min(q_1,-\alpha\eta) \le q_t,\quad "
        r"q_t < B+(1-\alpha)\eta \text{ or } q_t\le q_1",
        machine="one step from anywhere in the widened range, in three cases",
        by_hand="induction over t",
        paper="Theorem 1, which has no condition on the start value",
        errata=(6,),
        build=_start,
    ),
    Certificate(
        name="telescoping equality",
        kind="proof",
        statement="The quantile is the running sum of err - alpha: it integrates the error. Over "
        "W steps this is an equality, with the plus sign of the corrected update.",
        formula=r"q_{T_0+W} = q_{T_0} + \eta\sum_{t=T_0}^{T_0+W-1}(\mathrm{err}_t-\alpha)",
        machine="the empty sum, and one more term",
        by_hand="induction over W",
        paper="Theorem 1, first display of the proof",
        errata=(2, 3, 7, 10),
        build=_telescoping,
    ),
    Certificate(
        name="window bound is strict and two-sided",
        kind="proof",
        statement="The number of misses in W steps differs from alpha W by less than B / eta + 1.",
        formula=r"|N_W-\alpha W| < \frac{B}{\eta}+1",
        machine="the bound from the range of both end points and the telescoped sum",
        by_hand="",
        paper="Theorem 1; 'a two-sided guarantee is available'",
        errata=(3, 7),
        build=_strict,
    ),
    Certificate(
        name="integer strengthening",
        kind="proof",
        statement="Misses are whole: below x + 1 means at most ceil(x), above x - 1 at least "
        "floor(x).",
        formula=r"N<x+1 \Rightarrow N\le\lceil x\rceil,\qquad "
        r"N>x-1 \Rightarrow N\ge\lfloor x\rfloor",
        machine="both sides, over integers and reals together",
        by_hand="",
        paper="sharper than Theorem 1",
        build=_integers,
    ),
    Certificate(
        name="window bound from the start",
        kind="proof",
        statement="In the first W steps from q_1 = 0 the misses lie between alpha (W - 1) and "
        "B / eta + alpha (W - 1) + 1.",
        formula=r"\alpha(W-1) \le N_W < \frac{B}{\eta}+\alpha(W-1)+1",
        machine="both sides from the range of the end point",
        by_hand="",
        paper="Theorem 1 with T0 = 1",
        build=_from_start,
    ),
    Certificate(
        name="upper worst case is attained",
        kind="proof",
        statement="One zero score, then B for ever, misses at least alpha W + B / eta of W as soon "
        "as the quantile has reached its top band, and all of them before.",
        formula=r"N_W \ge \min\bigl(W, \lceil \alpha W + B/\eta\rceil\bigr)",
        machine="the first step, the miss below B, the band that is never left, the count in it",
        by_hand="the band is reached (each step below it climbs by the same amount)",
        paper="sharper than Theorem 1",
        build=_upper_attained,
    ),
    Certificate(
        name="lower worst case is attained",
        kind="proof",
        statement="From the right point of the top band, zeros for ever miss at most "
        "floor(alpha W - B / eta) of W.",
        formula=r"N_W \le \max\bigl(0, \lfloor \alpha W - B/\eta\rfloor\bigr)",
        machine="the cover above 0, the band that is never left, the start, the count in the band",
        by_hand="showing B for ever visits that start: on the top band it acts as a rotation "
        "of the circle by alpha, which visits every point of a lattice for rational alpha",
        paper="sharper than the two-sided remark after Theorem 1",
        build=_lower_attained,
    ),
    Certificate(
        name="longest run of misses",
        kind="proof",
        statement="A run of n misses is possible exactly if n (1 - alpha) < B / eta + 1.",
        formula=r"n < \frac{B/\eta+1}{1-\alpha}",
        machine="where the quantile stands before the n-th miss of a run from the lowest point",
        by_hand="",
        paper="against 'for all possible windows in time, the coverage will be met'",
        errata=(12,),
        build=_run,
    ),
    Certificate(
        name="short windows promise nothing",
        kind="proof",
        statement="At eta = 0.1 B the bound is vacuous up to W = 12 for alpha = 0.1 and up to "
        "W = 13 for alpha = 0.2, and indeed all predictions of such a window may be wrong.",
        formula=r"\alpha+\frac{B+\eta}{\eta W} > 1 \text{ and } N_W = W \text{ is possible}",
        machine="the bound for every such W, and the run of misses, step by step",
        by_hand="",
        paper="the multi-resolution remark; the window of 5 steps of the coverage figure",
        errata=(12,),
        build=_vacuous,
    ),
)
