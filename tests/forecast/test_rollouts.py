"""Rollouts to learn from: the same as driving one by one, and histories without copies."""

import numpy as np
import pytest

from cpl.forecast.errors import NoRolloutsError
from cpl.forecast.history import History
from cpl.forecast.rollouts import collect, join
from cpl.highway import Engine, nearest_distances
from cpl.highway.proximity import proximity


def test_the_batch_does_not_matter(small_road, weaving, rollouts):
    alone = collect(small_road, weaving, np.arange(60), n_envs=1)
    for name in ("obs", "l_tilde", "speed", "steps", "crashed"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(rollouts, name))
    assert rollouts.crashed.any()
    assert not rollouts.crashed.all()


def test_an_episode_is_what_the_road_does(small_road, weaving, rollouts):
    engine, history = Engine(small_road, 1), History(1)
    obs = engine.reset([7])
    for step in range(rollouts.steps[7] + 1):
        history.push(obs)
        np.testing.assert_array_equal(rollouts.obs[7, step], obs.ravel())
        near = proximity(nearest_distances(engine))[0]
        assert rollouts.l_tilde[7, step] == np.float32(near)
        if history.ready[0]:
            place = 7 * rollouts.obs.shape[1] + step
            np.testing.assert_array_equal(rollouts.histories(5)[place - 4], history.flat[0])
        out = engine.step(weaving(obs))
        obs = out.obs
    assert not rollouts.obs[7, rollouts.steps[7] + 1 :].any()


def test_moments_stay_within_their_episode(rollouts):
    places = rollouts.moments(length=5, horizon=3)
    episode, time = np.divmod(places, rollouts.obs.shape[1])
    assert time.min() == 4
    assert (time + 3 <= rollouts.steps[episode]).all()
    assert len(places) == np.maximum(rollouts.steps - 6, 0).sum()
    chosen = np.arange(60) < 3
    assert set(rollouts.moments(length=5, horizon=3, episodes=chosen)) <= set(places)


def test_histories_share_memory(rollouts):
    view = rollouts.histories(5)
    assert np.shares_memory(view, rollouts.obs)
    assert not view.flags.writeable
    assert view.nbytes > 4 * rollouts.obs.nbytes


def test_rollouts_are_put_together_in_order(rollouts):
    both = join([rollouts, rollouts])
    assert len(both) == 120
    np.testing.assert_array_equal(both.steps, np.tile(rollouts.steps, 2))


def test_nothing_to_learn_from_is_named(small_road, weaving, rollouts):
    with pytest.raises(NoRolloutsError, match=r"seeds must name at least one episode, got \[\]"):
        collect(small_road, weaving, [])
    with pytest.raises(NoRolloutsError, match="at least one set of rollouts"):
        join([])
    with pytest.raises(NoRolloutsError, match="must have an episode of 44 steps"):
        rollouts.moments(length=5, horizon=40)
