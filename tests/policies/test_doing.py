"""Interventions on the quantile, saliency of inputs, and the threshold that losses move."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from cpl.network import MLP
from cpl.policies.adaptive import RiskControl, near_miss
from cpl.policies.doing import Do, freeze, natural, replay
from cpl.policies.saliency import flips, gradients, saliency
from cpl.policies.switch import Moment


def moment(setting, episode, step, *, obs=None, l_hat=None, u=None):
    n = len(setting)
    return Moment(
        setting=np.array(setting),
        episode=np.array(episode),
        step=np.array(step),
        obs=np.zeros((n, 5, 5), np.float32) if obs is None else obs,
        l_hat=np.zeros(n) if l_hat is None else np.array(l_hat),
        u=np.zeros(n) if u is None else np.array(u),
        ready=np.ones(n, np.bool_),
        engine=SimpleNamespace(),
    )


def closing(n, rows):
    """A car 15 m ahead that comes nearer by 8 m/s, on some roads."""
    obs = np.zeros((n, 5, 5), np.float32)
    obs[rows, 1] = 1.0, 15 / 200, 0.0, -8 / 80, 0.0
    return obs


def test_each_setting_has_its_own_intervention():
    donors = np.array([[0.1, 0.2], [0.3, 0.4]])
    do = Do([natural, freeze(0.7), replay(donors)])
    shown = do(np.array([0.5, 0.5, 0.5, 0.5]), moment([0, 1, 2, 2], [0, 0, 1, 2], [3, 3, 1, 9]))
    # The third road is in episode 1, step 1; the last wraps to donor 0, beyond its last step.
    np.testing.assert_allclose(shown, [0.5, 0.7, 0.4, 0.2])


def test_the_tracked_quantiles_are_left_alone():
    q = np.array([0.5, 0.5])
    Do([freeze(0.0)])(q, moment([0, 0], [0, 1], [0, 0]))
    assert q.tolist() == [0.5, 0.5]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Do([]), "doings"),
        (lambda: freeze(np.nan), "value must be finite"),
        (lambda: replay([[0.1, np.nan]]), "donors must be finite"),
        (lambda: replay([0.1]), "donors must be finite"),
        (lambda: RiskControl([1.5]), "epsilon"),
        (lambda: RiskControl([0.1], eta=0.0), "eta"),
    ],
)
def test_impossible_interventions_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_car_beside_or_going_away_is_no_near_miss():
    obs = closing(3, [0, 1, 2])
    obs[1, 1, 2] = 4 / 16  # in the next lane
    obs[2, 1, 3] = 8 / 80  # faster than the ego car
    assert near_miss(obs, 2.0).tolist() == [True, False, False]


def test_the_threshold_moves_by_the_loss_of_the_decision_before():
    control = RiskControl([0.1, 0.4], eta=0.5, start=0.5, decisions=40)
    first = control(moment([0, 1], [0, 0], [0, 0], l_hat=[0.6, 0.4]))
    assert first.tolist() == [True, False]
    np.testing.assert_allclose(control.threshold, 0.5)  # nothing has happened yet
    control(moment([0, 1], [0, 0], [1, 1], obs=closing(2, [0])))
    np.testing.assert_allclose(control.threshold, [0.5 + 0.5 * (0.1 - 1), 0.5 + 0.5 * 0.4])
    # The first road crashed in its second decision; the other stands still.
    control(moment([0, 1], [1, 0], [0, 1]))
    np.testing.assert_allclose(control.threshold, [0.5 + 2 * 0.5 * (0.1 - 1), 0.7])


def test_the_end_of_an_episode_by_the_clock_is_no_loss():
    control = RiskControl([0.2], eta=1.0, decisions=2)
    for step in (0, 1, 0):
        control(moment([0], [0], [step]))
    np.testing.assert_allclose(control.threshold, [0.5 + 2 * 0.2])


def test_mean_loss_is_what_the_threshold_says():
    rng = np.random.default_rng(0)
    control, losses = RiskControl([0.3], eta=0.05, decisions=10_000), []
    for step in range(200):
        hit = bool(rng.random() < 0.5)
        control(moment([0], [0], [step], obs=closing(1, [0] if hit else [])))
        losses += [hit] if step else []
    mean = 0.3 - (control.threshold[0] - 0.5) / (0.05 * len(losses))
    assert mean == pytest.approx(np.mean(losses))


@pytest.fixture
def network():
    rng = np.random.default_rng(3)
    sizes = (6, 16, 16, 4)
    weights = tuple(rng.normal(size=pair).astype(np.float32) for pair in pairwise(sizes))
    weights[0][5] = 0.0  # the last input leads nowhere
    return MLP(weights, tuple(rng.normal(size=k).astype(np.float32) for k in sizes[1:]))


def test_gradients_are_those_of_finite_differences(network):
    rng = np.random.default_rng(1)
    x = rng.normal(size=(20, 6)).astype(np.float32)
    found = gradients(network, x)
    chosen = network(x).argmax(axis=1)

    def advantage(z):
        values = network(z)
        return values[np.arange(len(z)), chosen] - values.mean(axis=1)

    for i in range(6):
        step = np.zeros(6, np.float32)
        step[i] = 1e-3
        slope = (advantage(x + step) - advantage(x - step)) / 2e-3
        # A rectifier's kink may lie within the step at a few points.
        assert np.mean(np.abs(slope - found[:, i]) < 2e-2) > 0.8


def test_an_input_that_leads_nowhere_has_no_weight(network):
    x = np.random.default_rng(2).normal(size=(300, 6)).astype(np.float32)
    groups = {"all": slice(0, 5), "nowhere": slice(5, 6)}
    weights = saliency(network, x, groups)
    changed = flips(network, x, groups, np.random.default_rng(0))
    assert weights["nowhere"] == changed["nowhere"] == 0.0
    assert weights["all"] > 0
    assert changed["all"] > 0.2
