"""Certificates about Theorem 1 as printed: where it fails, and where it survives."""

# Inequalities are written as in the mathematics, whichever side is the constant.
from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

from cpl.conformal.certificates.frame import Certificate, Obligation
from cpl.conformal.certificates.symbols import setting, step

__all__ = ["CERTIFICATES"]


def _start_outside(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, *scores = z3.Reals("q_1 s_1 s_2 s_3")
    misses, _ = step(z3, here, q, scores)
    excess = here.eta * (sum(misses) - 3 * here.alpha)
    yield Obligation(
        name="three steps from a start far below",
        given=(*here.given, *here.bounded(*scores), here.eta == 1, here.alpha == z3.Q(1, 10)),
        goal=excess >= here.B + here.eta,
    )


def _printed_high(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    s = z3.Real("s_1")
    _, (_, after) = step(z3, here, z3.RealVal(0), [s])
    yield Obligation(
        name="one miss from the start value 0",
        given=(*here.given, *here.bounded(s), here.alpha == z3.Q(1, 4), here.B == 1),
        goal=after > here.B + here.alpha * here.eta,
    )


def _printed_low(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    s = z3.Real("s_1")
    _, (_, after) = step(z3, here, z3.RealVal(0), [s])
    yield Obligation(
        name="one covered score from the start value 0",
        given=(*here.given, *here.bounded(s), here.eta == 1, here.B == 1),
        goal=after < -(1 - here.alpha) * here.eta,
    )


def _printed_low_loose(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    yield Obligation(
        name="for alpha <= 1/2 the printed end lies below the true one",
        given=(*here.given, 2 * here.alpha <= 1),
        goal=-(1 - here.alpha) * here.eta <= here.low,
    )
    yield Obligation(
        name="for alpha > 1/2 the true end lies below the printed one",
        given=(*here.given, 2 * here.alpha > 1),
        goal=here.low < -(1 - here.alpha) * here.eta,
    )


def _width(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    printed = (here.B + here.alpha * here.eta) + (1 - here.alpha) * here.eta
    yield Obligation(
        name="both ranges have width B + eta",
        given=here.given,
        goal=z3.And(printed == here.B + here.eta, here.high - here.low == here.B + here.eta),
    )


def _printed_window(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    scores = z3.Reals("s_1 s_2 s_3")
    misses, _ = step(z3, here, z3.RealVal(0), scores)
    yield Obligation(
        name="T0 = 2, W = 1, so the printed sum has the terms 2 and 3",
        given=(
            *here.given,
            *here.bounded(*scores),
            here.alpha == z3.Q(1, 10),
            here.eta == 1,
        ),
        goal=here.eta * (misses[1] + misses[2]) > here.alpha * here.eta + here.B + here.eta,
    )


def _printed_window_survives(z3: ModuleType) -> Iterator[Obligation]:
    m, W, c, product = z3.Ints("m W c product")
    yield Obligation(
        name="ceil((W + 1) / m) <= W / m + 1",
        given=(m >= 1, W >= 1, product == m * c, product >= W + 1, product - m < W + 1),
        goal=product <= W + m,
    )


def _printed_rearranging(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, *scores = z3.Reals("q_1 s_1 s_2")
    misses, path = step(z3, here, q, scores)
    printed = here.eta * sum(misses) <= here.eta * here.alpha + path[1] - path[0]
    yield Obligation(
        name="W = 1: the printed sum has two terms, the difference has one step",
        given=(
            *here.given,
            *here.bounded(*scores),
            here.alpha == z3.Q(1, 10),
            here.eta == 1,
            here.B == 2,
            q == 0,
        ),
        goal=z3.Not(printed),
    )


def _printed_correction(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    W = z3.Real("W")
    per_window = (here.B + here.eta) / here.eta * W
    yield Obligation(
        name="read from left to right, the correction grows with W and is never below 1",
        given=(*here.given, W >= 1),
        goal=per_window >= 1,
    )
    total = z3.Real("total")
    yield Obligation(
        name="(sum err - alpha) / W is the mean less alpha only for W = 1",
        given=(*here.given, W > 1),
        goal=(total - here.alpha) / W != total / W - here.alpha,
    )


CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="start far outside breaks Theorem 1",
        kind="counterexample",
        statement="Without a condition on q_1 the theorem is false: from far below, three misses "
        "in a row are more than alpha W + B / eta + 1.",
        formula=r"q_1 \ll 0:\quad N_3 \ge 3\alpha + \frac{B}{\eta} + 1",
        machine="a start value and three scores, with alpha = 1/10 and eta = 1",
        by_hand="",
        paper="Theorem 1",
        errata=(6,),
        build=_start_outside,
    ),
    Certificate(
        name="printed upper end of the range fails",
        kind="counterexample",
        statement="The quantile can exceed B + alpha eta, even with its first step.",
        formula=r"q_2 > B+\alpha\eta",
        machine="a step size and a score, with alpha = 1/4 and B = 1",
        by_hand="",
        paper="Theorem 1, last line of the proof",
        errata=(4,),
        build=_printed_high,
    ),
    Certificate(
        name="printed lower end of the range fails",
        kind="counterexample",
        statement="For alpha > 1/2 the quantile can fall below -(1 - alpha) eta.",
        formula=r"q_2 < -(1-\alpha)\eta",
        machine="a level and a score, with eta = B = 1",
        by_hand="",
        paper="Theorem 1, last line of the proof",
        errata=(5,),
        build=_printed_low,
    ),
    Certificate(
        name="printed lower end is loose or false",
        kind="proof",
        statement="The printed lower end is too low for alpha <= 1/2 and too high for alpha > 1/2.",
        formula=r"-(1-\alpha)\eta \le -\alpha\eta \iff \alpha\le\tfrac12",
        machine="both cases",
        by_hand="",
        paper="Theorem 1, last line of the proof",
        errata=(5,),
        build=_printed_low_loose,
    ),
    Certificate(
        name="width survives the swapped ends",
        kind="proof",
        statement="The paper swaps alpha and 1 - alpha between the two ends; the width is B + eta "
        "either way, so the constant of the theorem is right.",
        formula=r"(B+\alpha\eta)-(-(1-\alpha)\eta) = B+\eta = (B+(1-\alpha)\eta)-(-\alpha\eta)",
        machine="both equalities",
        by_hand="",
        paper="Theorem 1, last line of the proof",
        errata=(4, 5),
        build=_width,
    ),
    Certificate(
        name="printed window of Theorem 1 fails",
        kind="counterexample",
        statement="The sum from T0 to T0 + W has W + 1 terms, and for those the theorem is false.",
        formula=r"\sum_{t=T_0}^{T_0+W}\mathrm{err}_t > \alpha W+\frac{B+\eta}{\eta}",
        machine="scores and B for T0 = 2, W = 1, with alpha = 1/10 and eta = 1",
        by_hand="",
        paper="Theorem 1",
        errata=(3,),
        build=_printed_window,
    ),
    Certificate(
        name="printed window survives at alpha = 1/m",
        kind="proof",
        statement="If alpha is 1/m and B / eta an integer (the paper's own eta = 0.1 B with alpha "
        "= 0.1 or 0.2), then the W + 1 terms obey the printed bound after all, by integrality.",
        formula=r"\Bigl\lceil\frac{W+1}{m}\Bigr\rceil+\frac B\eta \le \frac Wm+\frac B\eta+1",
        machine="the inequality for all integers m and W",
        by_hand="the exact worst case of W + 1 terms, `max_errors`",
        paper="Theorem 1",
        errata=(3,),
        build=_printed_window_survives,
    ),
    Certificate(
        name="printed rearrangement fails",
        kind="counterexample",
        statement="With W + 1 terms on the left, the first inequality of the last display is "
        "false; with W terms it is an equality.",
        formula=r"\frac1W\sum_{t=T_0}^{T_0+W}\mathrm{err}_t > "
        r"\alpha+\frac{q_{T_0+W}-q_{T_0}}{\eta W}",
        machine="two scores for W = 1, with alpha = 1/10, eta = 1, B = 2",
        by_hand="",
        paper="Theorem 1, last display of the proof",
        errata=(3, 7),
        build=_printed_rearranging,
    ),
    Certificate(
        name="printed brackets of the correction",
        kind="proof",
        statement="Without brackets, (B + eta) / eta W read from left to right is at least 1 for "
        "every W, and (sum err - alpha) / W is not the mean less alpha.",
        formula=r"\frac{B+\eta}{\eta}W \ge 1,\qquad \frac{\sum\mathrm{err}-\alpha}{W} \ne "
        r"\frac{\sum\mathrm{err}}{W}-\alpha",
        machine="both, for all W >= 1 and W > 1",
        by_hand="",
        paper="the multi-resolution remark; first display of the proof",
        errata=(8,),
        build=_printed_correction,
    ),
)
