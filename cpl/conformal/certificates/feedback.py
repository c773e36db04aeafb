"""Certificates about delayed feedback and about step sizes that vary."""

# Inequalities are written as in the mathematics, whichever side is the constant.
# ruff: noqa: SIM300
from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

from cpl.conformal.certificates.frame import Certificate, Obligation
from cpl.conformal.certificates.symbols import as_number, setting, step

__all__ = ["CERTIFICATES"]


def _delayed_range(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    p, pending, s, d = z3.Reals("p pending s d")
    q = p - here.eta * pending
    after = p + here.eta * (as_number(z3, s > q) - here.alpha)
    low = -(d + 1) * here.alpha * here.eta
    high = here.B + (d + 1) * (1 - here.alpha) * here.eta
    given = (
        *here.given,
        *here.bounded(s),
        d >= 0,
        pending >= -d * here.alpha,
        pending <= d * (1 - here.alpha),
        p >= low,
        p < high,
    )
    yield Obligation(name="no step leaves it below", given=given, goal=after >= low)
    yield Obligation(name="no step leaves it above", given=given, goal=after < high)


def _delayed_pending(z3: ModuleType) -> Iterator[Obligation]:
    alpha, pending, d = z3.Reals("alpha pending d")
    err = z3.Bool("err")
    yield Obligation(
        name="one more error on its way",
        given=(
            alpha > 0,
            alpha < 1,
            d >= 0,
            pending >= -d * alpha,
            pending <= d * (1 - alpha),
        ),
        goal=z3.And(
            pending + as_number(z3, err) - alpha >= -(d + 1) * alpha,
            pending + as_number(z3, err) - alpha <= (d + 1) * (1 - alpha),
        ),
    )


def _delayed_window(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    first, last, N, W, h = z3.Reals("p_first p_last N W h")
    ends = [
        z3.And(
            p >= -h * here.alpha * here.eta,
            p < here.B + h * (1 - here.alpha) * here.eta,
        )
        for p in (first, last)
    ]
    deviation = here.eta * (N - here.alpha * W)
    given = (*here.given, *ends, h >= 1, last == first + deviation)
    yield Obligation(name="upper side", given=given, goal=deviation < here.B + h * here.eta)
    yield Obligation(name="lower side", given=given, goal=deviation > -(here.B + h * here.eta))


def _delay_breaks_prompt_bound(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    s_1, s_2 = z3.Reals("s_1 s_2")
    misses = as_number(z3, s_1 > 0) + as_number(z3, s_2 > 0)
    yield Obligation(
        name="W = 2 from the start with delay 2, so both scores meet q = 0",
        given=(*here.given, *here.bounded(s_1, s_2), here.eta == 1, here.alpha == z3.Q(1, 10)),
        goal=here.eta * (misses - 2 * here.alpha) >= here.B + here.eta,
    )


def _interleaved(z3: ModuleType) -> Iterator[Obligation]:
    total, one, width, j = z3.Reals("total one width j")
    yield Obligation(
        name="one more tracker",
        given=(
            j >= 1,
            width > 0,
            total < j * width,
            total > -j * width,
            one < width,
            one > -width,
        ),
        goal=z3.And(total + one < (j + 1) * width, total + one > -(j + 1) * width),
    )
    ratio, h = z3.Reals("ratio h")
    yield Obligation(
        name="one tracker that waits is never worse",
        given=(ratio > 0, h >= 1),
        goal=ratio + h <= h * (ratio + 1),
    )


def _variable_range(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s, H = z3.Reals("q s H")
    _, (_, after) = step(z3, here, q, [s])
    low, high = -here.alpha * H, here.B + (1 - here.alpha) * H
    given = (*here.given, *here.bounded(s), H >= here.eta, q >= low, q < high)
    yield Obligation(
        name="no step of size at most H leaves it",
        given=given,
        goal=z3.And(after >= low, after < high),
    )


def _variable_sum(z3: ModuleType) -> Iterator[Obligation]:
    # x is q measured from the lower end of its range, w = 1 / eta, M the width of the range.
    x, after, w, w_before, total, V, M, y = z3.Reals("x x_after w w_before total V M x_first")
    worse = z3.If(w > w_before, w - w_before, z3.RealVal(0))
    total_after, V_after = total + w * (after - x), V + worse
    world = (M > 0, w > 0, w_before > 0, x >= 0, x < M, after >= 0, after < M, y >= 0, y < M)
    yield Obligation(
        name="first term",
        given=(*world, V == w, total == w * (x - y)),
        goal=z3.And(total <= w * x + M * (V - w), total >= w * x - M * V),
    )
    upper = total <= w_before * x + M * (V - w_before)
    yield Obligation(
        name="one more term, upper side",
        given=(*world, upper),
        goal=total_after <= w * after + M * (V_after - w),
    )
    yield Obligation(
        name="one more term, lower side",
        given=(*world, total >= w_before * x - M * V),
        goal=total_after >= w * after - M * V_after,
    )
    yield Obligation(
        name="what the invariant says at the end",
        given=(*world, total <= w * x + M * (V - w), total >= w * x - M * V),
        goal=z3.And(total <= M * V, total >= -M * V),
    )


def _running_maximum(z3: ModuleType) -> Iterator[Obligation]:
    c, top, s, B, w, w_after, V = z3.Reals("c top s B w w_after V")
    larger = z3.If(s > top, s, top)
    given = (c > 0, top > 0, s >= 0, s <= B, top <= B, w * c * top == 1, w_after * c * larger == 1)
    yield Obligation(
        name="the step never shrinks, so V keeps its first value",
        given=given,
        goal=V + z3.If(w_after > w, w_after - w, z3.RealVal(0)) == V,
    )
    yield Obligation(name="no step exceeds c B", given=given, goal=c * larger <= c * B)


CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="range of the virtual quantile",
        kind="proof",
        statement="Add to q the effect of the errors that are still on their way. This virtual "
        "quantile p stays in [-(d+1) alpha eta, B + (d+1)(1 - alpha) eta) if at most d errors are "
        "on their way, in whatever order they arrive. With feedback in order q_t = p_(t-d), so q "
        "stays there too.",
        formula=r"p_t = q_t+\eta\!\!\sum_{\text{pending}}\!(\mathrm{err}-\alpha),\quad "
        r"-(d+1)\alpha\eta \le p_t < B+(d+1)(1-\alpha)\eta",
        machine="one step from anywhere in the range, for all real d at once",
        by_hand="induction over t",
        paper="tacit; the highway scores a prediction 3 steps later, the robot 2",
        errata=(16,),
        build=_delayed_range,
    ),
    Certificate(
        name="what can be pending",
        kind="proof",
        statement="d errors on their way add between -d alpha and d (1 - alpha).",
        formula=r"-d\alpha \le \sum_{\text{pending}}(\mathrm{err}-\alpha) \le d(1-\alpha)",
        machine="one more error on its way",
        by_hand="induction over d",
        paper="tacit",
        errata=(16,),
        build=_delayed_pending,
    ),
    Certificate(
        name="window bound with delay",
        kind="proof",
        statement="With delay h the number of misses in W steps differs from alpha W by less than "
        "B / eta + h.",
        formula=r"|N_W-\alpha W| < \frac B\eta+h",
        machine="both sides, from the range of the virtual quantile at both end points",
        by_hand="",
        paper="Theorem 1 with the delay that the experiments have",
        errata=(16,),
        build=_delayed_window,
    ),
    Certificate(
        name="delay breaks the prompt bound",
        kind="counterexample",
        statement="With delay 2, Theorem 1 without a delay term is false.",
        formula=r"N_2 \ge 2\alpha+\frac B\eta+1",
        machine="two scores and B, with alpha = 1/10 and eta = 1",
        by_hand="",
        paper="Theorem 1",
        errata=(16,),
        build=_delay_breaks_prompt_bound,
    ),
    Certificate(
        name="interleaved trackers",
        kind="proof",
        statement="h trackers that take turns deviate by less than h (B / eta + 1) together; one "
        "tracker that waits for its feedback is never worse.",
        formula=r"|N_W-\alpha W| < h\Bigl(\frac B\eta+1\Bigr),\qquad "
        r"\frac B\eta+h \le h\Bigl(\frac B\eta+1\Bigr)",
        machine="one more tracker, and the comparison",
        by_hand="induction over h",
        paper="not in the paper",
        errata=(16,),
        build=_interleaved,
    ),
    Certificate(
        name="range with a variable step",
        kind="proof",
        statement="With steps of at most H the quantile stays in [-alpha H, B + (1 - alpha) H), "
        "however the steps are chosen.",
        formula=r"-\alpha H \le q_t < B+(1-\alpha)H,\qquad H=\max_t\eta_t",
        machine="one step from anywhere in the range",
        by_hand="induction over t",
        paper="'eta_t = 0.1 B_hat_t ... trivial to get a guarantee'",
        errata=(11,),
        build=_variable_range,
    ),
    Certificate(
        name="misses with a variable step",
        kind="proof",
        statement="The deviation is at most (B + H) V, where V is the first inverse step plus "
        "whatever the inverse steps rise later.",
        formula=r"\Bigl|\sum(\mathrm{err}_t-\alpha)\Bigr| \le (B+H)V,\quad V=\frac1{\eta_{T_0}}"
        r"+\sum\Bigl(\frac1{\eta_t}-\frac1{\eta_{t-1}}\Bigr)_+",
        machine="the first term, one more term on both sides, the conclusion",
        by_hand="induction over W (this is Abel summation, one term at a time)",
        paper="'eta_t = 0.1 B_hat_t ... trivial to get a guarantee'",
        errata=(11,),
        build=_variable_sum,
    ),
    Certificate(
        name="running maximum",
        kind="proof",
        statement="If the step is c times the running maximum it never shrinks, so the deviation "
        "is at most (1 + c) B divided by the first step of the window.",
        formula=r"\eta_t=c\max_{i\le t}s_i \;\Rightarrow\; "
        r"\Bigl|\sum(\mathrm{err}_t-\alpha)\Bigr| \le \frac{B+cB}{\eta_{T_0}}",
        machine="the step never shrinks and never exceeds c B",
        by_hand="'misses with a variable step' with V = 1 / eta at the first time",
        paper="'eta_t = 0.1 B_hat_t ... trivial to get a guarantee', for the reading that is true",
        errata=(11,),
        build=_running_maximum,
    ),
)
