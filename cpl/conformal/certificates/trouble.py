"""Certificates about feedback that is late by varying amounts, out of order, lost, or wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType

from cpl.conformal.certificates.frame import Certificate, Obligation, Term
from cpl.conformal.certificates.symbols import Setting, as_number, setting

__all__ = ["CERTIFICATES"]


@dataclass(frozen=True, kw_only=True)
class _Step:
    """One score that meets q, and what is reported of it: the truth, a lie, or nothing ever."""

    here: Setting
    p: Term
    after: Term
    h: Term
    fed: Term
    false_miss: Term
    false_cover: Term
    given: tuple[Term, ...]

    @property
    def high(self) -> Term:
        """The upper wall of p, without lies."""
        return self.here.B + self.h * (1 - self.here.alpha) * self.here.eta

    @property
    def low(self) -> Term:
        """The lower wall."""
        return -self.h * self.here.alpha * self.here.eta


def _step(z3: ModuleType) -> _Step:
    here = setting(z3)
    p, pending, s, h = z3.Reals("p pending s h")
    fed, lie = z3.Bools("fed lie")
    err = s > p - here.eta * pending
    reported = z3.Xor(err, lie)
    moved = p + here.eta * (as_number(z3, reported) - here.alpha)
    return _Step(
        here=here,
        p=p,
        after=z3.If(fed, moved, p),
        h=h,
        fed=fed,
        false_miss=z3.And(fed, lie, z3.Not(err)),
        false_cover=z3.And(fed, lie, err),
        given=(
            *here.given,
            *here.bounded(s),
            h >= 1,
            pending >= -(h - 1) * here.alpha,
            pending <= (h - 1) * (1 - here.alpha),
        ),
    )


def _queue(z3: ModuleType, before: Term, arrival: Term, size: Term, served: Term, by: Term) -> Term:
    """Return what a queue holds after one more event: an arrival, or service."""
    rest = z3.If(arrival, before + size, z3.If(served, before - by, before))
    return z3.If(rest > 0, rest, z3.RealVal(0))


def _walls(z3: ModuleType) -> Iterator[Obligation]:
    step = _step(z3)
    alpha, eta = step.here.alpha, step.here.eta
    x, y = z3.Reals("x y")
    above = _queue(z3, x, step.false_miss, 1 - alpha, step.fed, alpha)
    yield Obligation(
        name="no event leaves it above",
        given=(*step.given, x >= 0, step.p < step.high + eta * x),
        goal=step.after < step.high + eta * above,
    )
    below = _queue(z3, y, step.false_cover, alpha, step.fed, 1 - alpha)
    yield Obligation(
        name="no event leaves it below",
        given=(*step.given, y >= 0, step.p >= step.low - eta * y),
        goal=step.after >= step.low - eta * below,
    )


def _bursts(z3: ModuleType) -> Iterator[Obligation]:
    alpha, x, c, tokens = z3.Reals("alpha x c tokens")
    wrong = z3.Bool("wrong")
    after = _queue(z3, x, wrong, 1 - alpha, z3.BoolVal(True), alpha)
    left = tokens + alpha - as_number(z3, wrong)
    yield Obligation(
        name="one more event that may spend a token",
        given=(alpha > 0, alpha < 1, c >= 0, x >= 0, x + tokens <= c, tokens <= c, left >= 0),
        goal=after + z3.If(left < c, left, c) <= c,
    )


def _inside(z3: ModuleType) -> Iterator[Obligation]:
    step = _step(z3)
    alpha, eta = step.here.alpha, step.here.eta
    first, lies = z3.Reals("p_first lies")

    def below(p: Term, count: Term) -> Term:
        lift = (1 - alpha) * eta * count
        return z3.Or(p < step.high + lift, p <= first + lift)

    yield Obligation(
        name="rising above where it began takes false misses",
        given=(*step.given, lies >= 0, below(step.p, lies)),
        goal=below(step.after, lies + as_number(z3, step.false_miss)),
    )
    ground = z3.If(first < step.low, first, step.low)
    yield Obligation(
        name="falling below where it began takes false covers",
        given=(*step.given, lies >= 0, step.p >= ground - alpha * eta * lies),
        goal=step.after >= ground - alpha * eta * (lies + as_number(z3, step.false_cover)),
    )


def _window(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    first, last, h, c, d = z3.Reals("p_first p_last h c d")
    N, W, lost, lost_misses = z3.Reals("N W lost lost_misses")
    false_misses, false_covers = z3.Reals("false_misses false_covers")
    alpha, eta, B = here.alpha, here.eta, here.B
    high, low = B + h * (1 - alpha) * eta, -h * alpha * eta
    # What was fed back moved p; what was not, and what was wrong, makes the rest of N.
    told = N - lost_misses - false_covers + false_misses
    given = (
        *here.given,
        h >= 1,
        c >= 0,
        d >= 0,
        false_misses >= 0,
        false_covers >= 0,
        lost_misses >= 0,
        lost_misses <= lost,
        last - first == eta * (told - alpha * (W - lost)),
        first >= low - eta * d,
        first < high + eta * c,
    )
    lift = (1 - alpha) * eta * false_misses
    ground = z3.If(first < low, first, low)
    yield Obligation(
        name="upper side",
        given=(*given, z3.Or(last < high + lift, last <= first + lift)),
        goal=eta * (N - alpha * W - d - false_covers - (1 - alpha) * lost) < B + h * eta,
    )
    yield Obligation(
        name="lower side",
        given=(*given, last >= ground - alpha * eta * false_covers),
        goal=eta * (alpha * W - N - c - false_misses - alpha * lost) < B + h * eta,
    )


_PAPER = "not in the paper, which takes feedback for granted"

CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="range with lost and wrong feedback",
        kind="proof",
        statement="Let feedback arrive in any order, with at most h thresholds whose feedback is "
        "still to come, some of it never, some of it wrong. The virtual quantile leaves its range "
        "upwards by no more than a queue holds that every false miss fills by 1 - alpha and every "
        "other feedback empties by alpha; downwards likewise with false covers.",
        formula=r"p_t < B+h(1-\alpha)\eta+\eta x_t,\quad x_{t+1}=\bigl(x_t+(1-\alpha)"
        r"1_{\text{false miss}}-\alpha 1_{\text{else}}\bigr)_+",
        machine="one event from anywhere in the range, true, false or lost",
        by_hand="induction over t",
        paper=_PAPER,
        errata=(16,),
        build=_walls,
    ),
    Certificate(
        name="what the queue of wrong feedback can hold",
        kind="proof",
        statement="If among any n feedbacks in a row at most c + alpha n are false misses, the "
        "queue never holds more than c.",
        formula=r"C(I) \le c+\alpha |I|\ \text{for all}\ I \;\Rightarrow\; x_t \le c",
        machine="one more event; what the queue and the unspent tokens hold together",
        by_hand="induction over t; for false covers put 1 - alpha for alpha",
        paper=_PAPER,
        errata=(16,),
        build=_bursts,
    ),
    Certificate(
        name="inside a window with wrong feedback",
        kind="proof",
        statement="From where it stands when a window begins, or the wall, the virtual quantile "
        "rises by no more than (1 - alpha) eta for each false miss in the window, and falls by no "
        "more than alpha eta for each false cover.",
        formula=r"p_t \le \max(p_{T_0}, B+h(1-\alpha)\eta)+(1-\alpha)\eta F_t",
        machine="one event, both sides",
        by_hand="induction over the window",
        paper=_PAPER,
        errata=(16,),
        build=_inside,
    ),
    Certificate(
        name="window bound with lost and wrong feedback",
        kind="proof",
        statement="Of W scores in a row let M never be fed back, F be reported as false misses and "
        "G as false covers. The misses exceed alpha W by less than B / eta + h + (1 - alpha) M + G "
        "+ d, with d what the queue of false covers holds when the window begins; they fall short "
        "of it by less than B / eta + h + alpha M + F + c, with c what that of false misses holds.",
        formula=r"-\Bigl(\frac B\eta+h+\alpha M+F+c\Bigr) < N_W-\alpha W < "
        r"\frac B\eta+h+(1-\alpha)M+G+d",
        machine="both sides, from the ranges at both end points",
        by_hand="",
        paper=_PAPER,
        errata=(16,),
        build=_window,
    ),
)
