"""Agents that hear: what they are shown and paid in training is what a ride computes."""

from dataclasses import replace

import numpy as np
import pytest

from cpl.conformal import RunningMax
from cpl.highway import PAPER, Engine, nearest_distances
from cpl.highway.proximity import proximity
from cpl.network import MLP
from cpl.policies.controls import slower
from cpl.policies.dqn import DQNConfig, train
from cpl.policies.evaluate import Drivers, Tracking, drive
from cpl.policies.listen import Hearing, Listening, Penalty, View, best, by_chooser, ride
from cpl.policies.switch import Switch

ROAD = replace(PAPER, target_speeds=(20.0, 30.0, 40.0), vehicles_count=12, duration=20.0)
SEEDS = np.arange(20_000_000, 20_000_006)
TRACKING = Tracking(rule=RunningMax(c=0.1), alpha=0.1)
QUICK = DQNConfig(steps=160, hidden=(32, 16), learning_starts=40, batch_size=16, curve_every=40)


def weaving(obs):
    """Faster, and to the left of a near car."""
    return np.where(obs[:, 1, 1] < 0.1, 0, 3)


def guess(flat):
    """A forecast that is a smooth function of the history."""
    return 0.5 + 0.5 * np.tanh(flat[:, 106] - flat[:, 6]), None


def hearing(**changes):
    return Hearing(**({"forecast": guess, "tracking": TRACKING} | changes))


def taught(lesson, seed, policy=weaving):
    """Drive one episode through the training wrapper; return what it showed and paid."""
    engine = Engine(ROAD, 1)
    obs = engine.reset([seed])[0]
    shown, paid = [lesson.reset(engine, obs)], []
    while True:
        choice = int(policy(obs[None])[0])
        out = engine.step([lesson.action(choice)])
        obs = out.obs[0]
        seen, reward = lesson.step(engine, obs, float(out.reward[0]))
        paid.append(float(out.reward[0]) - reward)
        if out.terminated[0] or out.truncated[0]:
            return np.array(shown), np.array(paid)
        shown.append(seen)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"tracking": replace(TRACKING, alpha=0.3, delay=5)},
        {"tracking": replace(TRACKING, signed=True, issued=False)},
        {"tracking": replace(TRACKING, carry=True, streams=1)},
        {"view": View(observations=3, quantiles=4, q_scale=10.0)},
        {"view": View(observations=0, l_hat=False)},
        {"view": View(l_hat=False, quantiles=0), "more": lambda flat: flat[:, :2] + 1},
    ],
    ids=["default", "late", "signed", "carried on", "stacked", "q alone", "further inputs"],
)
def test_what_is_seen_in_training_is_what_is_seen_on_a_ride(changes):
    hears = hearing(**changes)
    lesson = Listening(ROAD, hears)
    seen = []

    def choose(moment, shown):
        seen.append((int(moment.episode[0]), shown[0].copy()))
        return weaving(moment.obs)

    rides = ride(ROAD, hears, choose, SEEDS[:3], n_envs=1, record=True)
    heard = []
    for number, seed in enumerate(SEEDS[:3].tolist()):
        expected, _ = taught(lesson, seed)
        found = np.array([shown for episode, shown in seen if episode == number])
        assert found.shape == expected.shape == (len(expected), lesson.size)
        np.testing.assert_allclose(found, expected, atol=1e-6)
        heard.append(len(expected))
    assert lesson.heard["q"].nunique() > 4
    np.testing.assert_allclose(lesson.heard["q"], rides.steps["q"], atol=1e-6)
    np.testing.assert_allclose(lesson.heard["l_hat"], rides.steps["l_hat"], atol=1e-6)
    assert rides.episodes["steps"].tolist() == heard


def test_a_score_is_fed_back_when_it_can_be_known_and_not_before():
    delay = 4
    lesson = Listening(ROAD, hearing(tracking=replace(TRACKING, delay=delay)))
    shown, _ = taught(lesson, SEEDS[1], slower)
    q = shown[:, -1]
    # The first forecast is made at decision 4, its outcome seen at 7; with this delay it counts
    # at 8. A perfect forecast until then changes nothing, and what comes later cannot either.
    assert (q[:8] == 0).all()
    assert q[8] != 0


def test_the_first_scores_are_those_of_the_definition():
    lesson = Listening(ROAD, hearing())
    engine = Engine(ROAD, 1)
    obs = engine.reset([int(SEEDS[2])])
    seen, near = [obs.ravel()], [float(proximity(nearest_distances(engine))[0])]
    shown = [lesson.reset(engine, obs[0])]
    for _ in range(8):
        obs = engine.step([lesson.action(1)]).obs
        seen.append(obs.ravel())
        near.append(float(proximity(nearest_distances(engine))[0]))
        shown.append(lesson.step(engine, obs[0], 0.0)[0])
    l_hat = float(guess(np.concatenate(seen[:5])[None])[0][0])
    score = abs(near[7] - l_hat)
    assert shown[6][-1] == 0
    assert shown[7][-1] == pytest.approx(0.1 * score * 0.9)  # a miss: eta (1 - alpha)
    assert [row[-2] for row in shown[:4]] == [0, 0, 0, 0]
    assert shown[4][-2] == pytest.approx(l_hat)


def test_penalties_are_taken_off_the_reward_by_the_state_reached():
    weights = Penalty(q=2.0, product=7.0)
    shown, paid = taught(Listening(ROAD, hearing(), penalty=weights), SEEDS[0], slower)
    l_hat, q = shown[1:, -2].astype(float), shown[1:, -1].astype(float)
    np.testing.assert_allclose(paid[:-1], 2 * abs(q) + 7 * q * l_hat, atol=1e-6)
    assert paid.max() > 0.01
    _, free = taught(Listening(ROAD, hearing()), SEEDS[0], slower)
    assert (free == 0).all()


def test_a_ride_adds_up_what_the_road_pays():
    rides = ride(ROAD, hearing(), lambda m, s: weaving(m.obs), SEEDS, record=True)
    steps = rides.steps
    later = steps.groupby("seed")["speed"].shift(-1)
    earned = (0.05 * (later - 20)).clip(0, 0.5).groupby(steps["seed"]).sum()
    episodes = rides.episodes.set_index("seed")
    last = (0.05 * (episodes["last_speed"] - 20)).clip(0, 0.5)
    gap = episodes["reward_sum"] - (earned + last - episodes["crashed"])
    assert gap.abs().max() < 0.1  # speeds along the road, not along the heading, are paid


def test_choices_may_be_policies():
    hears = hearing(policies=(slower, weaving))
    lesson = Listening(ROAD, hears)
    assert lesson.actions == 2
    engine = Engine(ROAD, 1)
    obs = engine.reset([5])[0]
    lesson.reset(engine, obs)
    assert [lesson.action(0), lesson.action(1)] == [4, int(weaving(obs[None])[0])]


def test_the_switch_rides_as_it_drives():
    drivers = Drivers(safe=slower, speed=weaving)
    chooser = Switch([0.4, 0.7])
    how = {"settings": 2, "n_envs": 5}
    driven = drive(ROAD, drivers, chooser, SEEDS, forecast=guess, tracking=TRACKING, **how).episodes
    ridden = ride(
        ROAD, hearing(policies=(slower, weaving)), by_chooser(chooser), SEEDS, **how
    ).episodes
    assert ridden[list(driven)].equals(driven)
    assert ridden["fast_steps"].sum() > 0


def q_of(seen):
    """Brake if the quantile that is shown is large."""
    return np.where(seen[:, -1] > 0.02, 4, 3)


def test_an_intervention_changes_what_is_shown_and_nothing_else():
    levels = np.array([0.0, 0.5])
    rides = ride(
        ROAD, hearing(), lambda moment, seen: q_of(seen), SEEDS, settings=2, record=True,
        intervene=lambda q, moment: levels[moment.setting],
    )  # fmt: skip
    steps, episodes = rides.steps, rides.episodes
    assert (steps["shown"] == levels[steps["setting"]]).all()
    assert set(steps.loc[steps["setting"] == 0, "action"]) == {3}
    assert set(steps.loc[steps["setting"] == 1, "action"]) == {4}
    assert (episodes.groupby("setting")["fast_steps"].sum() > 0).tolist() == [True, False]
    same = ride(
        ROAD, hearing(), lambda moment, seen: q_of(seen), SEEDS,
        intervene=lambda q, moment: q,
    )  # fmt: skip
    own = ride(ROAD, hearing(), lambda moment, seen: q_of(seen), SEEDS, n_envs=2)
    assert same.episodes.equals(own.episodes)


def test_a_trace_tells_drivers_apart():
    one, other = (
        ride(ROAD, hearing(), choose, SEEDS).episodes["trace"]
        for choose in (lambda m, s: weaving(m.obs), lambda m, s: np.full(len(s), 3))
    )
    assert (one != other).any()
    again = ride(ROAD, hearing(), lambda m, s: weaving(m.obs), SEEDS, n_envs=2).episodes["trace"]
    assert again.equals(one)


def test_noise_on_the_forecast_is_drawn_by_episode():
    lesson = Listening(ROAD, hearing(), blur=(0.0, 0.2), seed=3)
    apart = []
    for seed in range(12):
        found, _ = taught(lesson, seed)
        plain, _ = taught(Listening(ROAD, hearing()), seed)
        apart.append(np.abs(found[:, -2] - plain[:, -2]).max())
    assert 0 < sum(gap > 0 for gap in apart) < 12
    assert max(apart) < 1


@pytest.mark.parametrize(
    "hears",
    [
        hearing(),
        hearing(policies=(slower, weaving), view=View(observations=2)),
    ],
    ids=["actions", "gate"],
)
def test_a_learner_learns_behind_the_wrapper_and_rides(hears):
    small = replace(ROAD, vehicles_count=6)
    lesson = Listening(small, hears, penalty=Penalty(q=1.0))
    trained = train(QUICK, [small, replace(small, vehicles_density=2.0)], seed=4, wrapper=lesson)
    assert trained.network.sizes[0] == lesson.size == hears.size(small)
    assert trained.network.sizes[-1] == hears.choices
    assert len(lesson.heard) == QUICK.steps
    assert np.isfinite(trained.curve["loss"].iloc[-1])
    rides = ride(small, hears, best(trained.network), SEEDS[:2])
    assert len(rides.episodes) == 2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: View(observations=-1), "observations"),
        (lambda: View(observations=0, l_hat=False, quantiles=0), "view"),
        (lambda: View(q_scale=np.inf), "q_scale"),
        (lambda: Penalty(q=np.nan), "q must be finite"),
        (lambda: hearing(view=View(observations=6)), "at most 5"),
        (lambda: hearing(tracking=replace(TRACKING, delay=2)), "delay"),
        (lambda: Listening(ROAD, hearing(), blur=(-0.1,)), "blur"),
        (lambda: Listening(ROAD, hearing(), blur=()), "blur"),
        (lambda: ride(ROAD, hearing(), lambda m, s: m.step, []), "seeds"),
    ],
)
def test_impossible_settings_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_networks_choose_the_greatest_value():
    net = MLP((np.array([[1.0, 0.0], [0.0, 1.0]], np.float32),), (np.zeros(2, np.float32),))
    seen = np.array([[0.0, 1.0], [2.0, 1.0]], np.float32)
    assert best(net)(None, seen).tolist() == [1, 0]
