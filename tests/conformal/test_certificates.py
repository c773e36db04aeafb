"""The proofs go through, quickly and for the right reason; the examples break what they say."""

import subprocess
import sys
import time
from dataclasses import replace
from fractions import Fraction

import pytest
import z3

from cpl.conformal import bounds, certificates
from cpl.conformal.certificates import CERTIFICATES, Certificate, Obligation, certificate, check_all
from cpl.conformal.reference import follow, follow_as_printed, trailing_maximum


@pytest.mark.parametrize("name", CERTIFICATES)
def test_it_holds(name):
    verdict = certificate(name).check()
    assert verdict.holds, str(verdict)
    assert verdict.status == ("proved" if verdict.kind == "proof" else "found")


def test_all_together_take_less_than_five_seconds():
    begun = time.process_time()
    verdicts = check_all()
    assert time.process_time() - begun < 5
    assert sum(verdict.queries for verdict in verdicts) > 100
    assert len(verdicts) > 50


def test_they_are_documented_and_name_their_errata():
    for proof in CERTIFICATES.values():
        assert proof.statement.endswith((".", ".)"))
        assert proof.formula
        assert proof.machine
        assert proof.paper
        assert all(1 <= number <= 20 for number in proof.errata)
        assert "<table>" in proof._repr_html_()
        assert proof.name in repr(proof)


def test_the_table_shows_all():
    table = certificates.as_table([certificate("telescoping equality").check()])
    assert table.loc[0, "by_hand"] == "induction over W"
    assert table.loc[0, "verdict"] == "proved"
    with pytest.raises(ValueError, match=r"name must be one of .*; got 'nonsense'"):
        certificate("nonsense")


def test_another_solver_could_check_them():
    text = certificate("integer strengthening").smtlib()
    assert text.count("(check-sat)") == 2
    solver = z3.Solver()
    solver.from_string(text.split("(check-sat)")[0])
    assert solver.check() == z3.unsat
    assert "(assert" in certificate("printed window of Theorem 1 fails").smtlib()


def test_importing_the_theory_does_not_import_z3():
    code = "import sys, cpl.conformal, cpl.conformal.certificates; sys.exit('z3' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# ------------------------------------------------------------ a certificate can fail


def obligation(*given, goal):
    def build(_):
        yield Obligation(name="the only step", given=given, goal=goal)

    return build


@pytest.fixture
def blank() -> Certificate:
    return replace(certificate("integer strengthening"), name="blank")


X = z3.Real("x")


def test_a_false_proof_is_refuted_with_numbers(blank):
    verdict = replace(blank, build=obligation(X > 0, goal=X >= 1)).check()
    assert (verdict.status, verdict.holds) == ("refuted", False)
    assert 0 < verdict.model["x"] < 1
    assert "at 'the only step'" in str(verdict)


def test_a_proof_from_a_contradiction_is_no_proof(blank):
    verdict = replace(blank, build=obligation(X > 0, X < 0, goal=X == 7)).check()
    assert (verdict.status, verdict.holds) == ("contradictory", False)


def test_a_counterexample_that_does_not_exist_is_refuted(blank):
    empty = replace(blank, kind="counterexample", build=obligation(X > 0, goal=X < 0))
    assert empty.check().status == "refuted"


def test_what_z3_cannot_decide_is_unknown(blank, monkeypatch):
    monkeypatch.setattr("cpl.conformal.certificates.frame.TIMEOUT", 1)
    a, b, c, n = z3.Ints("a b c n")
    hard = z3.And(a > 0, b > 0, c > 0, n > 2, a**n + b**n == c**n)
    for kind in ("proof", "counterexample"):
        assert (
            replace(blank, kind=kind, build=obligation(hard, goal=hard)).check().status == "unknown"
        )
    easy_given = replace(blank, build=obligation(a > 0, goal=z3.Not(hard)))
    assert easy_given.check().status == "unknown"


def test_irrational_and_logical_numbers_are_shown(blank):
    y, flag = z3.Real("y"), z3.Bool("flag")
    both = obligation(y * y == 2, y > 0, flag, goal=z3.BoolVal(True))
    model = replace(blank, kind="counterexample", build=both).check().model
    assert model["flag"] is True
    assert abs(model["y"] ** 2 - 2) < Fraction(1, 10**15)


# -------------------------------------------------- the examples, replayed without z3


def numbers(name):
    verdict = certificate(name).check()
    assert verdict.holds
    return verdict.model


def scores(model):
    names = sorted(key for key in model if key.startswith("s_"))
    return [model[key] for key in names]


def replay(model, q1=0):
    return follow(scores(model), alpha=model["alpha"], eta=model["eta"], q1=q1)


def limit(model, W):
    return bounds.error_rate_bound(model["alpha"], model["eta"], model["B"], W) * W


def test_replay_the_range():
    high, low = (
        numbers("printed upper end of the range fails"),
        numbers("printed lower end of the range fails"),
    )
    for model in (high, low):
        setting = model["alpha"], model["eta"], model["B"]
        path = replay(model)
        assert path.q[1] not in bounds.quantile_range_as_printed(*setting)
        assert path.q[1] in bounds.quantile_range(*setting)
    assert replay(high).q[1] > high["B"]
    assert replay(low).q[1] < 0


def test_replay_theorem_1():
    model = numbers("printed window of Theorem 1 fails")
    err = replay(model).err
    assert bounds.window_errors_as_printed(err, 1, 1) > limit(model, 1)
    assert bounds.window_errors(err, 1, 1) < limit(model, 1)
    far = numbers("start far outside breaks Theorem 1")
    assert sum(replay(far, q1=far["q_1"]).err) >= limit(far, 3)
    late = numbers("delay breaks the prompt bound")
    path = follow(scores(late), alpha=late["alpha"], eta=late["eta"], delay=2)
    assert sum(path.err) >= limit(late, 2)
    signed = numbers("scores with a sign break the printed bound")
    assert sum(replay(signed).err[2:]) >= limit(signed, 3)
    assert max(map(abs, scores(signed))) <= signed["B"]


def test_replay_the_update():
    model = numbers("printed update reaches the trap")
    path = follow_as_printed([*scores(model), 0, 0, 0], alpha=model["alpha"], eta=model["eta"])
    assert path.err[1:] == (True, True, True)
    memory = numbers("not proportional control")
    other = {key.replace("r_", "s_"): memory[key] for key in memory if not key.startswith("s_")}
    paths = replay(memory), replay(other)
    assert paths[0].err[1] == paths[1].err[1]
    assert paths[0].q[2] != paths[1].q[2]


def test_replay_the_frozen_maximum():
    model = numbers("trailing maximum can freeze below zero")
    rule = trailing_maximum(model["c"], 2)
    path = follow([*scores(model), *[0] * 50], alpha=model["alpha"], eta=rule)
    assert path.q[3] == path.q[-1] < 0
    assert all(path.err[3:])


def test_replay_the_assumption():
    model = numbers("assumption about one block is too weak")
    path = replay(model)
    bound = bounds.eventually_safe_deviation_bound(model["alpha"], model["eta"], model["q_floor"])
    assert sum(path.err) - 3 * model["alpha"] >= bound
    assert path.q[0] < model["q_floor"]
