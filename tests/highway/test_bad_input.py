"""Impossible roads, actions, seeds, masks and states: an error that names them, and no change."""

from dataclasses import fields, replace

import numpy as np
import pytest

from cpl.highway import Config, Engine

NAN, INF = float("nan"), float("inf")
SMALL = Config(vehicles_count=4, lanes_count=2)

BAD_FIELDS = {
    "lanes_count": [0, -1, 2.5, True, "4", None, 10**9],
    "vehicles_count": [-1, 1.5, None, 10**9],
    "initial_lane_id": [-1, 4, 1.5, True],
    "duration": [0, -1, NAN, INF, "40", None],
    "ego_spacing": [0, -2, NAN],
    "vehicles_density": [0, -1, NAN, INF],
    "collision_reward": [NAN, INF, "no"],
    "reward_speed_range": [(30, 20), (20, 20), (20,), 20, (20, NAN)],
    "normalize_reward": [1, "yes", None],
    "offroad_terminal": [0],
    "simulation_frequency": [0, -15, 1.5],
    "policy_frequency": [0, 1.5],
    "target_speeds": [(), (20,), (30, 20), (20, 20, 30), (20, NAN), "fast", 20],
    "observation_vehicles_count": [0, -5, 2.5],
    "features": [(), ("x", "x"), ("speed",)],
    "features_range": [{"speed": (0, 1)}, {"x": (1, 1)}, {"x": 3}],
    "see_behind": [1, None],
    "order": ["random", None],
    "observation_noise": [-0.1, NAN],
    "observation_dropout": [-0.1, 1.1],
    "collisions": [True, "some"],
    "other_speed_range": [(24, 21), (NAN, 1)],
    "speed_limit": [0, NAN],
    "acc_max": [0, -6],
    "comfort_acc_min": [0, 5],
    "delta_range": [(4.5, 3.5)],
    "lane_change_delay": [0, -1],
}


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in BAD_FIELDS.items() for value in values]
)
def test_impossible_roads(name, value):
    with pytest.raises(ValueError, match=name):
        Config(**{name: value})


def test_a_decision_takes_a_frame_or_more():
    with pytest.raises(ValueError, match=r"simulation_frequency .*policy_frequency \(16\), got"):
        Config(simulation_frequency=15, policy_frequency=16)
    assert Config(simulation_frequency=15, policy_frequency=2).frames == 7


def test_a_reward_that_cannot_be_normalised():
    with pytest.raises(ValueError, match="collision_reward must differ"):
        Config(collision_reward=0.5, high_speed_reward=0.4, right_lane_reward=0.1)


@pytest.fixture
def engine():
    engine = Engine(SMALL, 3)
    engine.reset([1, 2, 3])
    return engine


def assert_unchanged(engine, before):
    after = engine.state()
    for field in fields(after):
        np.testing.assert_array_equal(getattr(after, field.name), getattr(before, field.name))


@pytest.mark.parametrize(
    "actions",
    [
        [1, 1],
        [1, 1, 1, 1],
        1,
        [[1, 1, 1]],
        [1, 1, 5],
        [1, -1, 1],
        np.array([1, 1, 2**63], dtype=np.uint64),
        [1.0, 1.0, 1.0],
        [1, NAN, 1],
        [True, False, True],
        ["1", "1", "1"],
        [None, 1, 1],
        None,
        [],
    ],
)
def test_bad_actions(engine, actions):
    before = engine.state()
    with pytest.raises(ValueError, match="actions must be"):
        engine.step(actions)
    assert_unchanged(engine, before)


@pytest.mark.parametrize("seeds", [[1, 2], 5, [1, 2, -3], [1.0, 2.0, 3.0], ["a", "b", "c"], []])
def test_bad_seeds(engine, seeds):
    before = engine.state()
    with pytest.raises(ValueError, match="seeds must"):
        engine.reset(seeds)
    assert_unchanged(engine, before)


@pytest.mark.parametrize("mask", [[True, True], [1, 0, 1], True, np.ones((3, 1), bool)])
def test_bad_masks(engine, mask):
    before = engine.state()
    with pytest.raises(ValueError, match="mask must be"):
        engine.reset(None, mask)
    assert_unchanged(engine, before)


def test_stepping_before_a_reset():
    engine = Engine(SMALL, 2)
    with pytest.raises(ValueError, match="step before reset: environment 0"):
        engine.step([1, 1])
    engine.reset(None, np.array([True, False]))
    with pytest.raises(ValueError, match="step before reset: environment 1"):
        engine.step([1, 1])


@pytest.mark.parametrize("number", [0, -1, 1.5, None, "2", True])
def test_bad_batches(number):
    with pytest.raises(ValueError, match="n_envs must be a positive integer"):
        Engine(SMALL, number)
    with pytest.raises(ValueError, match="threads must be a positive integer"):
        Engine(SMALL, 2, threads=number)


def test_a_road_that_is_no_config():
    with pytest.raises(ValueError, match=r"config must be a cpl\.highway\.Config"):
        Engine({"lanes_count": 4}, 1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("x", np.zeros((3, 4))),
        ("x", np.full((3, 5), NAN)),
        ("speed", np.full((3, 5), INF)),
        ("heading", np.full((3, 5), "north")),
        ("lane", np.full((3, 5), 2)),
        ("lane", np.full((3, 5), -1)),
        ("target_lane", np.full((3, 5), 2)),
        ("target_lane", np.zeros((3, 5))),
        ("crashed", np.zeros((3, 5))),
        ("speed_index", np.array([0, 1, 3])),
        ("time", np.array([0.0, 1.0])),
        ("ready", np.ones(3)),
    ],
)
def test_bad_states(engine, name, value):
    before = engine.state()
    with pytest.raises(ValueError, match=rf"state\.{name} must"):
        engine.set_state(replace(before, **{name: value}))
    assert_unchanged(engine, before)
