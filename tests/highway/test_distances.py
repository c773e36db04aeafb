"""The nearest car of a whole batch: against the one-environment form and the observation."""

import numpy as np
import pytest

from cpl.highway import PAPER, Config, Engine, nearest_distances
from cpl.highway.distances import SIGHT
from cpl.highway.proximity import nearest_distance


@pytest.fixture(scope="module")
def driven():
    """A batch after some random decisions, with its last observation."""
    engine = Engine(PAPER, 64)
    obs = engine.reset(np.arange(64))
    rng = np.random.default_rng(0)
    for _ in range(14):
        obs = engine.step(rng.integers(0, 5, 64)).obs
    return engine, obs


def test_all_cars_count(driven):
    engine, _ = driven
    state = engine.state()
    places = np.stack([state.x, state.y], axis=-1)
    expected = nearest_distance(places[:, 0], places[:, 1:])
    np.testing.assert_allclose(nearest_distances(engine), expected, rtol=1e-13)


def test_observed_cars_are_those_of_the_observation(driven):
    engine, obs = driven
    shown = np.hypot(obs[:, 1:, 1] * 200.0, obs[:, 1:, 2] * 16.0)
    expected = np.where(obs[:, 1:, 0] > 0, shown, SIGHT).min(axis=1)
    found = nearest_distances(engine, "observed")
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert (found >= nearest_distances(engine)).all()
    assert (found > nearest_distances(engine)).any()  # else the variant would not matter


def test_a_car_far_out_of_sight_leaves_the_sight():
    engine = Engine(Config(vehicles_count=1, vehicles_density=0.05), 2)
    engine.reset([0, 1])
    assert (nearest_distances(engine) > SIGHT).all()
    assert (nearest_distances(engine, "observed") == SIGHT).all()


def test_bad_arguments_are_named():
    engine = Engine(Config(vehicles_count=0), 1)
    engine.reset([0])
    with pytest.raises(ValueError, match="vehicles_count must be >= 1 for a distance, got 0"):
        nearest_distances(engine)
    engine = Engine(Config(vehicles_count=2, order="shuffled"), 1)
    engine.reset([0])
    with pytest.raises(ValueError, match="order must be 'sorted'"):
        nearest_distances(engine, "observed")
    with pytest.raises(ValueError, match="got 'near'"):
        nearest_distances(engine, "near")
