"""The proofs go through, they are about the functions that run, and they can fail."""

from math import hypot

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.robot import agreement, camera_clock, certificates, envelope, lease
from cpl.robot.certificates import CERTIFICATES
from cpl.robot.symbolic import follow

NAMES = [proof.name for proof in CERTIFICATES]


@pytest.mark.parametrize("proof", CERTIFICATES, ids=NAMES)
def test_every_proof_goes_through(proof):
    verdict = proof.check()
    assert verdict.holds, verdict
    assert verdict.queries >= 10


# One change of the code that runs for each proof, which must notice it.
def wide(command, limits):
    return tuple(1.5 * each for each in command)


def turned(command, limits):
    return tuple(-each for each in command)


def late(state, now, answered_s, config):
    return state, state.mode, state.command


def stale(state, order, now, config, limits):
    return lease.replace(state, number=order.number, since_s=now, command=order.command)


def prompt(clock, device_s, sent_s):
    return lease.replace(clock, sent_s=sent_s, late_s=0.0)


def agreed(state, t_s, camera, odometry, config):
    return state


WRONG = {
    "clamp stays inside the envelope": ("clamp", wide),
    "clamp can only slow down": ("clamp", turned),
    "only a fresh order moves": ("ask", late),
    "orders are taken in order, fresh, and inside the envelope": ("take", stale),
    "a pose is as old as its camera says": ("hear", prompt),
    "legs and camera agree, or the run is over": ("compare", agreed),
}


@pytest.mark.parametrize("proof", CERTIFICATES, ids=NAMES)
def test_a_wrong_function_is_refuted(proof, monkeypatch):
    name, function = WRONG[proof.name]
    monkeypatch.setattr(certificates, name, function)
    assert proof.check().status == "refuted"


def test_all_paths_are_followed_and_refusals_are_none():
    def steps(run):
        x = run.real("x")
        if x < 0:
            raise ValueError("x must not be negative")
        return 0 if x == 0 else 1 if x < 10 else 2

    assert sorted(path.result for path in follow(steps)) == [0, 1, 2]
    with pytest.raises(RuntimeError, match="more than 2 paths"):
        list(follow(steps, limit=2))


def test_lengths_and_quotients_are_what_they_are_in_numbers():
    def stated(run):
        x, y = run.real("x"), run.real("y")
        length = envelope.hypot(x, y)
        if length == 0:
            return True
        return length >= x and abs((x / length) * length - x) == 0

    assert all(path.result for path in follow(stated, envelope))


def test_what_is_replaced_is_put_back():
    def raises(run):
        raise KeyError

    with pytest.raises(KeyError):
        list(follow(raises, envelope, lease, agreement, camera_clock))
    assert envelope.hypot is hypot


@settings(max_examples=15, deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.01, 5))
def test_a_path_of_the_clamp_is_the_one_that_floats_go(x, y, limit):
    """The proof's reals and the code's floats give the same numbers, but for rounding."""
    import z3

    def stated(run):
        wanted = (run.real("x"), run.real("y"), 0.0)
        limits = envelope.Envelope(v_max_mps=run.real("v"), yaw_rate_max_radps=1.0)
        return envelope.clamp(wanted, limits)

    sent = envelope.clamp((x, y, 0.0), envelope.Envelope(v_max_mps=limit, yaw_rate_max_radps=1.0))
    given_ = [
        z3.Real(n) == z3.Q(*v.as_integer_ratio()) for n, v in zip("xyv", (x, y, limit), strict=True)
    ]
    found = 0
    for path in follow(stated, envelope):
        solver = z3.Solver()
        solver.add(*path.conditions, *given_)
        if solver.check() != z3.sat:
            continue
        found += 1
        for out, number in zip(path.result[:2], sent[:2], strict=True):
            solver.push()
            term = getattr(out, "term", out)
            solver.add(z3.Or(term > number + 1e-9, term < number - 1e-9))
            assert solver.check() == z3.unsat
            solver.pop()
    assert found == 1
