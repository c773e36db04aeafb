"""What each member promises, on drawn sequences; and what its variants lose."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.conformal import track
from cpl.conformal.attack import attack, counts_worst
from cpl.conformal.family import (
    ACI,
    COP,
    ECI,
    KT,
    MEMBERS,
    PID,
    SFOGD,
    UPOCP,
    VARIANTS,
    CostAware,
    DecisionTheory,
)
from cpl.conformal.state import Running

few = settings(max_examples=40)
unit = st.lists(st.sampled_from([0.0, 0.3, 1.0]) | st.floats(0, 1), min_size=1, max_size=150)
level = st.sampled_from([0.05, 0.1, 0.3, 0.5, 0.8])


@few
@given(scores=st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=200), alpha=level,
       gamma=st.floats(0.005, 0.5), window=st.integers(1, 20))  # fmt: skip
def test_aci_keeps_its_bound_on_any_scores(scores, alpha, gamma, window):
    rule = ACI(gamma=gamma, window=window)
    err = track(scores, rule, alpha=alpha).err
    bound = (max(alpha, 1 - alpha) + gamma) / gamma
    assert abs(err.sum() - alpha * len(scores)) <= bound + 1e-9
    assert err.sum() <= rule.most_errors(alpha=alpha, B=1.0, T=len(scores))


@few
@given(scores=unit, alpha=level, eta=st.floats(0.02, 2), window=st.integers(1, 20))
def test_cop_keeps_its_bound_in_every_window(scores, alpha, eta, window):
    rule = COP(eta=eta, window=window)
    excess = np.concatenate([[0.0], np.cumsum(track(scores, rule, alpha=alpha).err - alpha)])
    assert np.abs(excess[:, None] - excess[None, :]).max() < 1 / eta + 2 + 1e-9


@few
@given(scores=unit, alpha=level, eta=st.floats(0.02, 1), cost=st.floats(0, 5))
def test_cost_and_errors_are_bounded_together(scores, alpha, eta, cost):
    rule = CostAware(eta=eta, cost=cost, reach=0.5)
    q, err = track(scores, rule, alpha=alpha)
    costs = np.where(err, 1 + cost * np.minimum((np.array(scores) - q) / 0.5, 1.0), 0.0)
    bound = alpha * len(scores) + (1 + (1 + cost - alpha) * eta) / eta
    assert err.sum() <= costs.sum() <= bound + 1e-9
    assert err.sum() <= rule.most_errors(alpha=alpha, B=1.0, T=len(scores))


@few
@given(scores=unit, alpha=level, eta=st.floats(0.02, 1), reach=st.floats(0.1, 2))
def test_the_mean_loss_of_decision_theory_is_bounded(scores, alpha, eta, reach):
    q, _ = track(scores, DecisionTheory(eta=eta, reach=reach), alpha=alpha)
    loss = np.clip((np.array(scores) - q) / reach, 0, 1)
    assert loss.sum() <= alpha * len(scores) + (1 + eta) / eta + 1e-9


LONG_RUN = [
    SFOGD(scale=1.0), KT(wealth=1.0), UPOCP(wealth=1.0), ECI(eta=0.1, window=0),
    ECI(eta=0.1, window=0, decay=0.95),
    PID(eta=0.05, K_I=0.5, C_sat=5.0, level=0.1, trend=0.0),
    *(MEMBERS[name].make(1.0) for name in ("aci", "cop", "fixed", "running_max", "decaying", "pi")),
]  # fmt: skip


@pytest.mark.parametrize("rule", LONG_RUN, ids=repr)
@pytest.mark.parametrize("seed", range(3))
def test_in_the_long_run_the_errors_are_as_many_as_asked_for(rule, seed):
    """On bounded scores whose level changes by chance, far from iid."""
    rng = np.random.default_rng(seed)
    scale = np.repeat(rng.random(200), rng.integers(10, 200, 200))
    scores = scale * rng.random(scale.size)
    assert track(scores, rule, alpha=0.1).err.mean() == pytest.approx(0.1, abs=0.02)


def test_up_ocp_follows_scores_that_grow():
    scores = np.arange(1, 20_001) ** 1.5 * np.random.default_rng(0).random(20_000)
    assert track(scores, UPOCP(wealth=1.0), alpha=0.1).err.mean() == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_loses_what_the_rule_keeps(name):
    trap = VARIANTS[name]
    scores = trap.scores(np.random.default_rng(0).random(4000))
    sound, variant = (track(scores, rule, alpha=0.1).err.mean() for rule in trap.rules)
    assert sound == pytest.approx(0.1, abs=0.015)
    assert abs(variant - 0.1) > 0.05


def test_the_accumulated_form_of_eci_errs_by_the_mean_of_its_term():
    """The telescoped sum: mean error - alpha = (q_T - q_0) / (eta T) - mean term, exactly."""
    eta, scores = 0.05, np.random.default_rng(1).random(5000)
    q, err = track(scores, ECI(eta=eta, window=0, form="accumulated"), alpha=0.1)
    f = 1 / (1 + np.exp(-(scores - q)))
    term = (scores - q) * f * (1 - f)
    last = q[-1] + eta * (err[-1] - 0.1 + term[-1])
    assert err.mean() - 0.1 == pytest.approx(last / (eta * 5000) - term.mean(), abs=1e-9)
    assert term.mean() < -0.05


def test_the_wealth_of_bettors_stays_positive_however_late_feedback_is():
    scores = np.random.default_rng(2).random(3000)
    for rule in (KT(wealth=1.0), UPOCP(wealth=1.0)):
        running, met = Running(rule, 0.1, 0.0), []
        for t, score in enumerate(scores):
            met.append(running.q)
            if t >= 5:
                assert running.take(scores[t - 5], met[t - 5])
                assert running.state[1] > 0
            del score
        assert track(scores, rule, alpha=0.1, delay=6).err.mean() == pytest.approx(0.1, abs=0.05)


def test_a_gamblers_threshold_is_a_function_of_counts():
    """UP-OCP: the same errors in any order lead to the same threshold."""
    rule, ends = UPOCP(wealth=1.0), []
    for order in ([1] * 3 + [0] * 9, [0] * 9 + [1] * 3, [0, 1, 0, 0] * 3):
        running = Running(rule, 0.1, 0.0)
        for miss in order:
            running.take(running.q + 1.0 if miss else running.q, running.q)
        ends.append(running.q)
    assert ends == pytest.approx([ends[0]] * 3)


def test_adversaries_never_beat_what_is_exact():
    found = attack(UPOCP(wealth=1.0), alpha=0.5, W=10, steps=60)
    exact = counts_worst(lambda n, t: _portfolio(n, t, 0.5), W=10, T=60)
    assert 0 < found.misses <= exact


def _portfolio(misses, events, alpha):
    wealth = 1.0
    for n in range(events):  # in any order: first the misses
        b = (min(n, misses) + 0.5) / (n + 1)
        wealth *= b / alpha if n < misses else (1 - b) / (1 - alpha)
    share = (misses + 0.5) / (events + 1)
    return 0.0 if not events else wealth * (share - alpha) / (alpha * (1 - alpha))


def test_every_member_has_a_row_and_fits_any_scale():
    for name, member in MEMBERS.items():
        assert member.name == name
        assert member.title
        assert member.guarantee
        small, large = (member.make(scale) for scale in (1e-3, 1e3))
        assert type(small) is type(large)
        assert math.isfinite(track([0.0], small, alpha=0.1).q[0])
