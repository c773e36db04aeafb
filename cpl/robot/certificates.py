"""What is proved of the last steps before the cable, for all reals, on the functions that run.

`clamp`, `take`, `ask`, `hear` and `compare` are followed on all of their paths by
:mod:`cpl.robot.symbolic`, with any numbers for velocities, times and limits, and z3 is asked on
each path for numbers that break what is stated. Nothing here is a copy: change one of the
functions, and its proof fails or holds anew. What floats do to it is for the tests beside it, which
give the same functions whatever hypothesis invents.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from types import ModuleType

from cpl.conformal.certificates import Certificate, Obligation, Verdict
from cpl.robot import agreement, camera_clock, envelope, lease
from cpl.robot.agreement import Agreement, AgreementConfig, compare
from cpl.robot.camera_clock import CameraClock, hear
from cpl.robot.envelope import Envelope, clamp, within
from cpl.robot.interfaces import ZERO, Mode
from cpl.robot.lease import LeaseConfig, LeaseState, ask, end, take
from cpl.robot.packets import Order
from cpl.robot.symbolic import Follow, Number, follow

__all__ = ["CERTIFICATES", "check_all"]

_PAPER = "none: the paper does not say what stops its robot"
_MODULES = (agreement, camera_clock, envelope, lease)
_MODES = (Mode.IDLE, Mode.STAND, Mode.WALK)

Property = Callable[[Follow], bool]


def check_all() -> list[Verdict]:
    """Ask z3 for every proof.

    >>> {verdict.status for verdict in check_all()}
    {'proved'}
    """
    return [proof.check() for proof in CERTIFICATES]


def _proof(*properties: Property) -> Callable[[ModuleType], Iterator[Obligation]]:
    """Return the obligations of functions that must say True on each of their paths."""

    def build(z3: ModuleType) -> Iterator[Obligation]:
        for stated in properties:
            name = (stated.__doc__ or stated.__name__).strip()
            for number, path in enumerate(follow(stated, *_MODULES), 1):
                goal = z3.BoolVal(bool(path.result))
                if not path.result:  # then it must be a path that nothing can go
                    goal = z3.Not(z3.And(*path.conditions))
                given = path.conditions if path.result else ()
                yield Obligation(name=f"{name} (path {number})", given=given, goal=goal)

    return build


def _limits(run: Follow) -> Envelope:
    return Envelope(v_max_mps=run.real("v_max"), yaw_rate_max_radps=run.real("w_max"))


def _vector(run: Follow, name: str) -> Number:
    return tuple(run.real(f"{name}_{axis}") for axis in "xyw")


def _inside(run: Follow) -> bool:
    """A clamped velocity is inside the envelope."""
    limits = _limits(run)
    return within(clamp(_vector(run, "v"), limits), limits)


def _slower(run: Follow) -> bool:
    """No component of a clamped velocity is larger than it was, and none is turned around."""
    wanted = _vector(run, "v")
    sent = clamp(wanted, _limits(run))
    return all(
        0 <= out <= asked if asked >= 0 else asked <= out <= 0
        for out, asked in zip(sent, wanted, strict=True)
    )


def _lease(run: Follow) -> LeaseConfig:
    names = LeaseConfig.__dataclass_fields__
    return LeaseConfig(**{name: run.real(name) for name in names})


def _state(run: Follow, mode: Mode, tripped: str) -> LeaseState:
    return LeaseState(
        number=run.real("number"),
        since_s=run.real("since"),
        mode=mode,
        command=_vector(run, "u"),
        tripped=tripped,
        quiet_s=run.real("quiet"),
    )


def _asks(mode: Mode, tripped: str) -> Property:
    def stated(run: Follow) -> bool:
        config, state = _lease(run), _state(run, mode, tripped)
        now, answered = run.real("now"), run.real("answered")
        after, asked, command = ask(state, now, answered, config)
        if tripped and not after.tripped:
            return False
        if command == ZERO:
            return True
        fresh = 0 <= now - state.since_s < config.lease_s
        heard = now - answered <= config.answer_s
        return bool(asked is Mode.WALK and fresh and heard and not after.tripped)

    stated.__doc__ = f"asked in {mode.name}{', tripped' * bool(tripped)}"
    return stated


def _takes(mode: Mode, tripped: str, wanted: Mode, last: bool) -> Property:
    def stated(run: Follow) -> bool:
        config, state, limits = _lease(run), _state(run, mode, tripped), Envelope()
        now, heard = run.real("now"), run.real("heard")
        order = Order(
            run=1,
            hello=1,
            number=run.real("n"),
            heard_s=heard,
            mode=wanted,
            command=_vector(run, "v"),
            last=last,
        )
        after = take(state, order, now, config, limits)
        if after is state:
            return True
        newer = order.number > state.number and not state.tripped
        if last:
            return bool(newer and after.tripped)
        fresh = 0 <= now - heard < config.lease_s
        same = after.since_s is heard and after.mode is wanted and after.tripped == ""
        return bool(newer and fresh and same and within(after.command, limits))

    words = f"an order to {wanted.name}{', the last' * last}"
    stated.__doc__ = f"{words}, taken in {mode.name}{', tripped' * bool(tripped)}"
    return stated


def _ends(run: Follow) -> bool:
    """An end stays the first one, and nothing but it is changed."""
    state = _state(run, Mode.WALK, "")
    first = end(state, run.real("now"), "told to end")
    return end(first, run.real("later"), "its second is gone") is first


def _ages(run: Follow) -> bool:
    """No pose is younger than its packet, and a clock that was faulty stays so."""
    clock = CameraClock(
        least_s=run.real("least"),
        device_s=run.real("device"),
        sent_s=run.real("sent"),
        settled_s=run.real("settled"),
        fault="",
    )
    sent = run.real("sent2")
    after = hear(clock, run.real("device2"), sent)
    return bool(after.taken_s <= sent and after.late_s >= 0)


def _waits(run: Follow) -> bool:
    """A pose that waited for d longer than the fastest is d late, whatever d is."""
    least, sent, wait = run.real("least"), run.real("sent"), run.real("wait")
    if not wait >= 0:
        return True
    clock = CameraClock(least_s=least, device_s=sent - least, sent_s=sent)
    after = hear(clock, sent - least, sent + wait)
    allowed = camera_clock.CREEP * wait  # the drift that is allowed for
    return bool(wait - allowed <= after.late_s <= wait)


def _parts(run: Follow) -> bool:
    """While camera and odometry agree they are no farther apart than the limit."""
    config = AgreementConfig()
    before = tuple((run.real(f"t{k}"), run.real(f"x{k}"), run.real(f"y{k}")) for k in range(2))
    broken = run.real("broken") > 0
    state = Agreement(
        parts=before,
        walked_m=run.real("walked"),
        last=(0.0, 0.0),
        broken=broken,
    )
    x, y, now = run.real("x"), run.real("y"), run.real("now")
    after = compare(state, now, (x, y), (0.0, 0.0), config)
    if broken or after.broken:
        return after.broken
    return bool(x * x + y * y <= config.apart_m**2)


CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="clamp stays inside the envelope",
        kind="proof",
        statement="Whatever velocity is wanted, the clamped one is inside disc and interval.",
        formula=r"\|\lambda (v_x, v_y)\| \le v_{\max},\ |\mu\,\omega| \le \omega_{\max}",
        machine="`within(clamp(v))` on all paths, for all velocities and limits",
        by_hand="what rounding does; tests",
        paper=_PAPER,
        build=_proof(_inside),
    ),
    Certificate(
        name="clamp can only slow down",
        kind="proof",
        statement="No component becomes larger, and none is turned around.",
        formula=r"0 \le \lambda v / v \le 1",
        machine="`clamp` on all paths",
        by_hand="what rounding does; tests",
        paper=_PAPER,
        build=_proof(_slower),
    ),
    Certificate(
        name="only a fresh order moves",
        kind="proof",
        statement="A velocity other than zero is asked for only while an order is fresh, the robot "
        "answers and nothing has tripped; what tripped stays so.",
        formula=r"u \ne 0 \Rightarrow 0 \le t - t_{\text{decided}} < \ell",
        machine="`ask` on all paths, from any state, at any time, for any limits",
        by_hand="that the process asks before each command that it sends",
        paper=_PAPER,
        build=_proof(*(_asks(mode, trip) for mode in _MODES for trip in ("", "told to end"))),
    ),
    Certificate(
        name="orders are taken in order, fresh, and inside the envelope",
        kind="proof",
        statement="An order changes something only if it is newer than the last and was decided "
        "less than a lease ago; after a trip nothing does.",
        formula=r"n > n_{\text{last}},\ 0 \le t - t_{\text{decided}} < \ell",
        machine="`take` and `end` on all paths, from any state",
        by_hand="seal, run and sender are looked at before; tests",
        paper=_PAPER,
        build=_proof(
            _ends,
            *(
                _takes(mode, trip, wanted, last)
                for mode, trip, wanted, last in product(
                    _MODES, ("", "told to end"), _MODES, (False, True)
                )
            ),
        ),
    ),
    Certificate(
        name="a pose is as old as its camera says",
        kind="proof",
        statement="No pose is younger than its packet, and one that waited d longer than the "
        "fastest one is d late, less the drift that is allowed for.",
        formula=r"(1 - \rho)\, d \le \text{late} \le d",
        machine="`hear` on all paths, for any clock",
        by_hand="that the fastest way was met before the run began; odometry",
        paper=_PAPER,
        build=_proof(_ages, _waits),
    ),
    Certificate(
        name="legs and camera agree, or the run is over",
        kind="proof",
        statement="While the gate is open the two places are no farther apart than its limit; once "
        "shut it stays shut.",
        formula=r"\|p_{\text{camera}} - p_{\text{legs}}\| \le 1.5\,\text{m}",
        machine="`compare` on all paths, with two remembered differences",
        by_hand="any number of remembered differences is the same comparison again",
        paper=_PAPER,
        build=_proof(_parts),
    ),
)
