"""The errata of Section III, one by one: the printed statement fails, the corrected one holds.

A printed statement is a test that is expected to fail (strictly: if it passed, that would be an
error). It asserts what the paper prints, for the paper's own objects, and nothing else.
"""

import ast
import inspect
import sys
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import sympy

from cpl.claims.errata import ERRATA, as_table, erratum
from cpl.conformal import Fixed, RunningMax, TrailingMax, bounds, track, track_exact
from cpl.conformal.adversary import lower_worst_case, upper_worst_case
from cpl.conformal.certificates import CERTIFICATES, certificate
from cpl.conformal.reference import follow, follow_as_printed
from cpl.conformal.search import search_windows
from cpl.conformal.traps import every_dangerous_step_missed, printed_theorem

printed = pytest.mark.xfail(strict=True, raises=AssertionError)

ALPHA, ETA, B = Fraction(1, 10), Fraction(1, 10), Fraction(1)  # the paper's: eta = 0.1 B
EVEN = [Fraction(k * 7 % 20, 20) for k in range(20)] * 50  # scores spread over [0, 1)


def holds(name):
    return certificate(name).check().holds


# ---------------------------------------------------------------- 1: the update


@printed
def test_erratum_01_printed():
    path = follow_as_printed(EVEN, alpha=ALPHA, eta=ETA)
    assert abs(path.error_rate - ALPHA) < 0.02


def test_erratum_01_corrected():
    path = follow(EVEN, alpha=ALPHA, eta=ETA)
    assert abs(path.error_rate - ALPHA) < 0.02
    assert follow_as_printed(EVEN, alpha=ALPHA, eta=ETA).error_rate > 0.99
    assert holds("corrected update descends the quantile loss")
    assert holds("printed update absorbs misses")


# ---------------------------------------------------------------- 2: the sign in the proof


def test_erratum_02_note():
    # The proof's plus sign telescopes the corrected update, and contradicts the printed one.
    W = 40
    right, wrong = (f(EVEN, alpha=ALPHA, eta=ETA) for f in (follow, follow_as_printed))
    rates = [Fraction(path.errors(0, W), W) - ALPHA for path in (right, wrong)]
    slopes = [(path.q[W] - path.q[0]) / (ETA * W) for path in (right, wrong)]
    assert slopes[0] == rates[0]
    assert slopes[1] == -rates[1] != rates[1]
    assert holds("telescoping equality")
    assert holds("printed argument hides the wrong sign")


# ---------------------------------------------------------------- 3: W + 1 terms


@printed
def test_erratum_03_printed():
    trap = printed_theorem()
    limit = bounds.error_rate_bound(ALPHA, 1, Fraction(17, 20), W=1)
    assert bounds.window_errors_as_printed(trap.path.err, trap.start, 1) <= limit


def test_erratum_03_corrected():
    for alpha, ratio in product((ALPHA, Fraction(1, 3), Fraction(2, 5)), (Fraction(17, 20), 2, 10)):
        found = search_windows(alpha, 1, ratio, 60)
        for W, most in enumerate(found.most, start=1):
            assert most < W * bounds.error_rate_bound(alpha, 1, ratio, W)
    # The paper's own numbers survive even with W + 1 terms.
    most = search_windows(ALPHA, ETA, B, 201).most
    assert all(most[W] <= W * bounds.error_rate_bound(ALPHA, ETA, B, W) for W in range(1, 201))
    assert holds("printed window survives at alpha = 1/m")
    assert holds("window bound is strict and two-sided")


# ---------------------------------------------------------------- 4, 5, 6: the range


def extremes(alpha):
    """Return paths that drive the quantile to the two ends of its range."""
    up = follow([1] * 200, alpha=alpha, eta=ETA)
    down = follow([0] * 200, alpha=alpha, eta=ETA)
    return max(up.q), min(down.q)


@printed
def test_erratum_04_printed():
    highest, _ = extremes(ALPHA)
    assert highest <= B + ALPHA * ETA


def test_erratum_04_corrected():
    for alpha in (ALPHA, Fraction(1, 3), Fraction(9, 10)):
        highest, _ = extremes(alpha)
        assert B <= highest < B + (1 - alpha) * ETA
    assert holds("range of the quantile")


@printed
def test_erratum_05_printed():
    alpha = Fraction(3, 4)
    _, lowest = extremes(alpha)
    assert lowest >= -(1 - alpha) * ETA


def test_erratum_05_corrected():
    for alpha in (ALPHA, Fraction(1, 3), Fraction(3, 4)):
        _, lowest = extremes(alpha)
        assert lowest == -alpha * ETA
    assert holds("range of the quantile")
    assert holds("printed lower end is loose or false")
    assert holds("width survives the swapped ends")


@printed
def test_erratum_06_printed():
    # "Uniformly for all W": whatever q_1 is, as nothing is said about it.
    W = 40
    path = follow([1] * W, alpha=ALPHA, eta=ETA, q1=-5)
    assert Fraction(path.errors(0, W), W) <= bounds.error_rate_bound(ALPHA, ETA, B, W)


def test_erratum_06_corrected():
    W = 40
    for q1 in (-ALPHA * ETA, 0, Fraction(1, 2), B + (1 - ALPHA) * ETA - Fraction(1, 1000)):
        for score in (0, 1):
            path = follow([score] * W, alpha=ALPHA, eta=ETA, q1=q1)
            assert abs(path.errors(0, W) - ALPHA * W) < bounds.deviation_bound(ALPHA, ETA, B)
    held = bounds.quantile_range(ALPHA, ETA, B, q1=-5)
    path = follow([1] * W, alpha=ALPHA, eta=ETA, q1=-5)
    assert all(q in held for q in path.q)
    assert path.errors(0, W) - ALPHA * W < held.width / ETA
    assert holds("start value of the quantile")


# ---------------------------------------------------------------- 7: equality and strictness


@printed
def test_erratum_07_printed():
    # The first inequality of the display, with the sum that the paper prints.
    path = follow([0, *[1] * 50], alpha=ALPHA, eta=ETA)
    for W in range(1, 40):
        shown = Fraction(bounds.window_errors_as_printed(path.err, 1, W), W)
        assert shown <= ALPHA + (path.q[1 + W] - path.q[1]) / (ETA * W)


def test_erratum_07_corrected():
    for scores in (EVEN[:100], [0, *[1] * 99], [1] * 100):
        path = follow(scores, alpha=ALPHA, eta=ETA)
        for start, W in product((0, 1, 7), (1, 5, 40)):
            rate = Fraction(path.errors(start, W), W)
            assert rate == ALPHA + (path.q[start + W] - path.q[start]) / (ETA * W)
            assert rate < bounds.error_rate_bound(ALPHA, ETA, B, W)
    assert holds("telescoping equality")


# ---------------------------------------------------------------- 8: brackets


@printed
def test_erratum_08_printed():
    # A "finite sample correction" shrinks as the sample grows; read as printed it grows.
    shown = [(B + ETA) / ETA * W for W in (1, 10, 100)]
    assert shown == sorted(shown, reverse=True)


def test_erratum_08_corrected():
    meant = [(B + ETA) / (ETA * W) for W in (1, 10, 100)]
    assert meant == sorted(meant, reverse=True)
    assert [ALPHA + c for c in meant] == [
        bounds.error_rate_bound(ALPHA, ETA, B, W) for W in (1, 10, 100)
    ]
    path = follow(EVEN[:40], alpha=ALPHA, eta=ETA)
    slope = path.q[40] / (ETA * 40)
    assert slope == Fraction(sum(path.err), 40) - ALPHA
    assert slope != (sum(path.err) - ALPHA) / 40
    assert holds("printed brackets of the correction")


# ---------------------------------------------------------------- 9: the target


@printed
def test_erratum_09_printed():
    assert abs(follow(EVEN, alpha=ALPHA, eta=ETA).error_rate - (1 - ALPHA)) < 0.1


def test_erratum_09_corrected():
    for alpha in (Fraction(1, 20), ALPHA, Fraction(3, 10)):
        path = follow(EVEN, alpha=alpha, eta=ETA)
        assert abs(path.error_rate - alpha) < 0.02
    assert holds("mean error is near alpha, not 1 - alpha")


# ---------------------------------------------------------------- 10: P or I


def test_erratum_10_note():
    # The quantile is the integral of the error, symbolically and on a path.
    q, eta, alpha = sympy.symbols("q eta alpha")
    err = sympy.symbols("err_1:5")
    state = q
    for e in err:
        state = state + eta * (e - alpha)
    assert sympy.expand(state - (q + eta * (sum(err) - 4 * alpha))) == 0
    path = follow(EVEN[:50], alpha=ALPHA, eta=ETA)
    assert path.q[50] == ETA * sum(e - ALPHA for e in path.err)
    assert holds("not proportional control")


# ---------------------------------------------------------------- 11: the adaptive step


def frozen_scores():
    """Return one large score, one small, then zeros (a tie that floats hold exactly)."""
    return np.array([1.0, 0.5] + [0.0] * 398)


@printed
def test_erratum_11_printed():
    # A guarantee, read for a trailing maximum: the deviation is bounded whatever the length.
    _, err = track(frozen_scores(), TrailingMax(c=1.0, window=8), alpha=0.125)
    assert abs(err.sum() - 0.125 * err.size) <= bounds.running_maximum_bound(1, 1, 1)


def test_erratum_11_corrected():
    _, err = track(frozen_scores(), RunningMax(c=1.0), alpha=0.125)
    assert abs(err.sum() - 0.125 * err.size) <= bounds.running_maximum_bound(1, 1, 1)
    assert holds("misses with a variable step")
    assert holds("running maximum")


# ---------------------------------------------------------------- 12: all windows


@printed
def test_erratum_12_printed():
    # "For all possible windows the coverage will be met": at least one of the W is covered.
    for W in range(1, 60):
        assert upper_worst_case(ALPHA, ETA, B, W).errors < W


def test_erratum_12_corrected():
    for alpha, first in ((ALPHA, 13), (Fraction(1, 5), 14)):
        assert bounds.smallest_informative_window(alpha, ETA, B) == first
        most = search_windows(alpha, ETA, B, 60).most
        assert [W for W in range(1, 61) if most[W - 1] < W] == list(range(first, 61))
    assert holds("short windows promise nothing")
    # Even 4 s at 10 Hz are held to no more than 45 % errors (alpha = 0.2).
    assert search_windows(Fraction(1, 5), ETA, B, 40).most[-1] == Fraction(45, 100) * 40


# ---------------------------------------------------------------- 13, 14: the assumption


def policies():
    """Return policies of every temper: each makes the next score from the quantile."""
    rng = np.random.default_rng(7)
    return {
        "reckless": lambda _: 1.0,
        "spiteful": lambda q: 1.0 if q < 1 else 0.0,
        "careful": lambda q: max(0.0, 0.5 - q),
        "random": lambda _: rng.integers(0, 9) / 8,
    }


def close_the_loop(policy, T=4000):
    scores, misses, q = [], 0, 0.0  # dyadic numbers: exact
    for _ in range(T):
        scores.append(policy(q))
        q += 0.0625 * ((scores[-1] > q) - 0.125)
    path = track(np.array(scores), Fixed(eta=0.0625), alpha=0.125)
    misses = int(path.err.sum())
    return path, misses


@printed
def test_erratum_13_printed():
    # If the Corollary needed the assumption, some policy with bounded scores would break it.
    rates = [close_the_loop(policy)[1] / 4000 for policy in policies().values()]
    assert (
        max(abs(rate - 0.125) for rate in rates) > bounds.deviation_bound(0.125, 0.0625, 1) / 4000
    )


def test_erratum_13_corrected():
    for policy in policies().values():
        path, misses = close_the_loop(policy)
        assert abs(misses - 0.125 * 4000) < bounds.deviation_bound(0.125, 0.0625, 1)
        assert not path.err[path.q >= 1].any()  # Assumption 1 with q_floor = B, K = 1
    assert holds("bounded scores are eventually safe")


@printed
def test_erratum_14_printed():
    # "By design": a switch whose safe policy is not safe would still satisfy the assumption.
    def switch(q):
        return q + 1 if q >= 0.5 else q + 2  # the safe policy, chosen for q >= 0.5, fails too

    path, _ = close_the_loop(switch, T=200)
    assert path.err[path.q >= 0.5].mean() < 0.125


def test_erratum_14_corrected():
    def switch(q):
        return 0.25 if q >= 0.5 else q + 1  # a safe policy that is safe, a fast one that is not

    path, misses = close_the_loop(switch)
    assert not path.err[path.q >= 0.5].any()
    assert abs(misses - 500) < bounds.eventually_safe_deviation_bound(0.125, 0.0625, 0.5)
    assert holds("bounded scores are eventually safe")
    assert holds("unbounded scores need an assumption")


# ---------------------------------------------------------------- 15: its quantifiers


def test_erratum_15_note():
    # As printed (steps 1..K only) the assumption is satisfied here, and the bound is broken.
    assert holds("assumption about one block is too weak")
    path = follow([0, 0, 5, 5, 5, 5], alpha=ALPHA, eta=1)
    floor = Fraction(1, 2)
    assert path.q[0] < floor  # so the printed premise is empty for K = 1
    excess = path.errors(2, 4) - 4 * ALPHA
    assert excess >= bounds.eventually_safe_deviation_bound(ALPHA, 1, floor)
    assert holds("range under an eventually safe policy")


# ---------------------------------------------------------------- 16: delay


@printed
def test_erratum_16_printed():
    # The highway: alpha = 0.1, a delay of 3 steps, 4 seconds at 10 Hz.
    worst = upper_worst_case(ALPHA, ETA, B, 40, delay=3)
    assert worst.errors <= 40 * bounds.error_rate_bound(ALPHA, ETA, B, 40)


def test_erratum_16_corrected():
    for (alpha, delay), W in product(((ALPHA, 3), (Fraction(1, 5), 2)), (5, 40, 150)):
        most, least = (
            f(alpha, ETA, B, W, delay=delay) for f in (bounds.max_errors, bounds.min_errors)
        )
        assert upper_worst_case(alpha, ETA, B, W, delay=delay).errors == most
        assert lower_worst_case(alpha, ETA, B, W, delay=delay).errors == least
    found = search_windows(ALPHA, 1, 2, 60, delay=3)
    for W in range(1, 61):
        assert found.most[W - 1] <= bounds.max_errors(ALPHA, 1, 2, W, delay=3)
        assert found.least[W - 1] >= bounds.min_errors(ALPHA, 1, 2, W, delay=3)
    assert holds("window bound with delay")
    assert holds("delay breaks the prompt bound")
    # The robot: a delay of 2 steps reaches the prompt bound, which is strict.
    robot = upper_worst_case(Fraction(1, 5), ETA, B, 40, delay=2)
    assert robot.errors == 40 * bounds.error_rate_bound(Fraction(1, 5), ETA, B, 40)


# ---------------------------------------------------------------- 17: the score


@printed
def test_erratum_17_printed():
    # With B the largest absolute value of a signed score.
    path = follow([-1, -1, 1, 1, 1], alpha=Fraction(1, 2), eta=2)
    assert path.errors(2, 3) < 3 * bounds.error_rate_bound(Fraction(1, 2), 2, 1, W=3)


def test_erratum_17_corrected():
    path = follow([-1, -1, 1, 1, 1], alpha=Fraction(1, 2), eta=2)
    assert path.errors(2, 3) < 3 * bounds.error_rate_bound(Fraction(1, 2), 2, 2, W=3)
    signed = np.random.default_rng(8).integers(-8, 9, 20_000) / 8
    _, err = track(signed, Fixed(eta=0.0625), alpha=0.125)
    assert abs(err.sum() - 0.125 * err.size) < bounds.deviation_bound(0.125, 0.0625, 2)
    # The absolute score, seen from the side the switch looks at: never missed if l_tilde < l_hat.
    below = -np.abs(signed)
    q, both = track(np.abs(below), Fixed(eta=0.0625), alpha=0.125)
    upper = below > q
    assert both.mean() == pytest.approx(0.125, abs=0.01)
    assert not upper[q >= 0].any()
    assert holds("scores with a sign")
    assert holds("upper side alone is covered more often")
    assert holds("upper side alone has no guarantee from below")


# ---------------------------------------------------------------- 18: indices


def test_erratum_18_note():
    # Read literally, {(X_1, Y_1)} for i = 1..n is one pair, and sum_i err_t is T times one term.
    i, t, T = sympy.symbols("i t T", integer=True, positive=True)
    err = sympy.Function("err")
    assert sympy.summation(err(t), (i, 1, T)) == T * err(t)
    assert sympy.Sum(err(t), (t, 1, T)).doit() != T * err(t)
    pairs = list(zip("abc", "xyz", strict=True))
    assert len({pairs[0] for _ in pairs}) == 1 < len(set(pairs))


# ---------------------------------------------------------------- 19: PID


def test_erratum_19_note():
    # P and PI are different controllers with different bounds: which was run must be said.
    constants = {"alpha": 0.1, "eta": 0.1, "B": 1, "K_I": 1, "C_sat": 1}
    _, fixed_step = bounds.pi_error_range(1000, **constants | {"C_sat": 1000})
    _, saturated = bounds.pi_error_range(40, **constants)
    _, lagged = bounds.pi_error_range(40, **constants, lag=1)
    assert saturated < lagged
    assert saturated < fixed_step == pytest.approx(10.9)
    assert holds("saturated integrator without lag")
    assert holds("saturated integrator with lag")
    assert holds("lag breaks the range without lag")


# ---------------------------------------------------------------- 20: coverage and safety


@printed
def test_erratum_20_printed():
    # Coverage read as safety: 90 % of the dangerous steps would be covered.
    assert every_dangerous_step_missed().danger_error_rate <= 0.15


def test_erratum_20_corrected():
    trap = every_dangerous_step_missed()
    assert trap.error_rate == 0.1001
    assert trap.danger_error_rate == 1
    err = track_exact([float(s) for s in trap.path.scores], Fixed(eta=0.1), alpha=0.1).err
    assert err[sorted(trap.danger)].all()
    assert holds("every dangerous step missed")


# ---------------------------------------------------------------- the table itself


def test_the_errata_are_complete():
    assert [row.number for row in ERRATA] == list(range(1, 21))
    assert {row.number for row in ERRATA if row.kind == "wording"} == {2, 10, 15, 18, 19}
    assert erratum(7).number == 7
    with pytest.raises(ValueError, match="number must lie between 1 and 20, got 21"):
        erratum(21)


def test_every_named_check_exists():
    here = sys.modules[__name__]
    for row in ERRATA:
        for name in row.tests:
            check = getattr(here, name)
            marks = [mark.name for mark in getattr(check, "pytestmark", [])]
            assert ("xfail" in marks) == name.endswith("_printed")
        for name in row.certificates:
            assert name in CERTIFICATES
            assert row.number in certificate(name).errata, (row.number, name)
        if "proof" in row.evidence:
            assert any(certificate(name).kind == "proof" for name in row.certificates)


def test_no_check_is_left_out_of_the_table():
    named = {name for row in ERRATA for name in row.tests}
    tree = ast.parse(Path(inspect.getfile(test_no_check_is_left_out_of_the_table)).read_text())
    present = {
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_erratum_")
    }
    assert present == named
    for proof in CERTIFICATES.values():
        for number in proof.errata:
            assert proof.name in erratum(number).certificates, (number, proof.name)


def test_the_errata_are_a_table():
    table = as_table()
    assert len(table) == 20
    assert table.set_index("number").loc[3, "tests"] == (
        "test_erratum_03_printed, test_erratum_03_corrected"
    )
