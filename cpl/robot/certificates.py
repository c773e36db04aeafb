"""What is proved of the last step before the cable: clamp, fence, stops and lease, for all reals.

The clamp's factor and the watchdog's lease are proved as they are in the code, with reals for
floats; `tests/robot` holds the same functions, in floats, against whatever hypothesis invents.
The fence is proved by induction: one step from *any* state, so no sequence of poses and policy
outputs can do what one step cannot.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

from cpl.conformal.certificates import Certificate, Obligation, Verdict
from cpl.conformal.certificates.frame import Term

__all__ = ["CERTIFICATES", "check_all"]

_PAPER = "none: the paper does not say what keeps its robot in the room"


def check_all() -> list[Verdict]:
    """Ask z3 for every proof.

    >>> [verdict.status for verdict in check_all()]
    ['proved', 'proved', 'proved', 'proved']
    """
    return [proof.check() for proof in CERTIFICATES]


def _factor(z3: ModuleType, name: str, speed: Term, limit: Term) -> tuple[Term, Term]:
    """Return limit / max(speed, limit) and what defines it, without a division."""
    share, larger = z3.Real(f"share_{name}"), z3.Real(f"larger_{name}")
    return share, z3.And(
        larger >= speed,
        larger >= limit,
        z3.Or(larger == speed, larger == limit),
        share * larger == limit,
    )


def _clamp(z3: ModuleType) -> Iterator[Obligation]:
    x, y, w, v_max, w_max, speed = z3.Reals("x y w v_max w_max speed")
    linear, is_linear = _factor(z3, "linear", speed, v_max)
    turn, is_turn = _factor(z3, "turn", z3.If(w >= 0, w, -w), w_max)
    length = z3.And(speed >= 0, speed * speed == x * x + y * y)
    # The square is taken apart for the solver: |share (x, y)| = share * speed.
    scaled = z3.And(linear > 0, linear <= 1)
    yield Obligation(
        name="the share of the speed lies in (0, 1] and brings it under the limit",
        given=(v_max > 0, speed >= 0, is_linear),
        goal=z3.And(scaled, linear * speed <= v_max),
    )
    yield Obligation(
        name="then the scaled velocity is inside the disc",
        given=(v_max > 0, length, scaled, linear * speed <= v_max),
        goal=(linear * speed) * (linear * speed) <= v_max * v_max,
    )
    yield Obligation(
        name="its length is the scaled speed",
        given=(length, scaled),
        goal=(linear * x) * (linear * x) + (linear * y) * (linear * y)
        == (linear * speed) * (linear * speed),
    )
    yield Obligation(
        name="the yaw rate is inside its interval, with its sign",
        given=(w_max > 0, is_turn),
        goal=z3.And(turn * w <= w_max, turn * w >= -w_max, turn > 0, turn <= 1),
    )


def _slower(z3: ModuleType) -> Iterator[Obligation]:
    value, share = z3.Reals("value share")
    sent = share * value
    yield Obligation(
        name="a share in [0, 1] of a velocity is no larger and never reversed",
        given=(share >= 0, share <= 1),
        goal=z3.And(sent * sent <= value * value, sent * value >= 0),
    )


def _fence(z3: ModuleType) -> Iterator[Obligation]:
    fenced, stopped, outside, stop, hold = z3.Bools("fenced stopped outside stop hold")
    x, y, half, wanted, clamped = z3.Reals("x y half wanted clamped")
    beyond = z3.Or(x > half, x < -half, y > half, y < -half)
    fenced_next, stopped_next = z3.Or(fenced, outside), z3.Or(stopped, stop)
    sent = z3.If(z3.Or(fenced_next, stopped_next, hold), 0, clamped)
    step = (outside == beyond, half > 0)
    yield Obligation(
        name="a pose outside stops the robot in the same step",
        given=(*step, beyond),
        goal=z3.And(sent == 0, fenced_next),
    )
    yield Obligation(
        name="tripped stays tripped, and a tripped fence sends zero",
        given=(*step, fenced),
        goal=z3.And(fenced_next, sent == 0),
    )
    yield Obligation(
        name="stopped stays stopped, and a stop sends zero",
        given=(*step, stopped),
        goal=z3.And(stopped_next, sent == 0),
    )
    limit = z3.Real("limit")
    yield Obligation(
        name="whatever was wanted, what is sent stays inside if the clamp does",
        given=(*step, limit > 0, clamped <= limit, clamped >= -limit, wanted == wanted),
        goal=z3.And(sent <= limit, sent >= -limit),
    )


def _lease(z3: ModuleType) -> Iterator[Obligation]:
    now, since, lease, zero, order = z3.Reals("now since lease zero order")
    tripped = z3.Bool("tripped")
    age = now - since
    late = age >= lease + zero
    tripped_next = z3.Or(tripped, late)
    sent = z3.If(z3.And(z3.Not(tripped_next), age >= 0, age < lease), order, 0)
    limits = (lease > 0, zero > 0)
    yield Obligation(
        name="an order is obeyed for less than the lease",
        given=(*limits, age >= lease),
        goal=sent == 0,
    )
    yield Obligation(
        name="after lease and zero time the watchdog is tripped",
        given=(*limits, late),
        goal=z3.And(tripped_next, sent == 0),
    )
    yield Obligation(
        name="tripped stays tripped and sends zero, whatever is ordered",
        given=(*limits, tripped),
        goal=z3.And(tripped_next, sent == 0),
    )


CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="clamp stays inside the envelope",
        kind="proof",
        statement="Whatever velocity is wanted, the clamped one is inside disc and interval.",
        formula=r"\|\lambda (v_x, v_y)\| \le v_{\max},\ |\mu\,\omega| \le \omega_{\max}",
        machine="length, share and scaled components, for all reals",
        by_hand="floating point: the code scales by 1 - 2^-40 more; property tests check it",
        paper=_PAPER,
        build=_clamp,
    ),
    Certificate(
        name="guard can only slow down",
        kind="proof",
        statement="Scaling by a share in [0, 1] makes no component larger and turns none around.",
        formula=r"0 \le \lambda \le 1 \Rightarrow |\lambda v| \le |v|,\ \lambda v \cdot v \ge 0",
        machine="one component, for all reals",
        by_hand="that every path of the code is such a scaling; property tests check it",
        paper=_PAPER,
        build=_slower,
    ),
    Certificate(
        name="fence and stops are latched",
        kind="proof",
        statement="Outside the fence, or once stopped, zero is sent in this and every later step.",
        formula=r"\text{outside}_t \Rightarrow u_s = 0\ \forall s \ge t",
        machine="the inductive step, from any state",
        by_hand="induction over the steps",
        paper=_PAPER,
        build=_fence,
    ),
    Certificate(
        name="lease ends every order",
        kind="proof",
        statement="No order is obeyed for as long as the lease, and a tripped watchdog obeys none.",
        formula=r"\text{age} \ge \ell \Rightarrow u = 0",
        machine="one query of the lease, from any state and at any time",
        by_hand="that the process asks the lease before every command it sends",
        paper=_PAPER,
        build=_lease,
    ),
)
