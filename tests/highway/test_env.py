"""The Gymnasium environment: its contract, and highway-env's numbers."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from cpl.highway import PAPER, HighwayEnv, highway_env_options
from cpl.highway.reference import reference_env

SMALL = {"vehicles_count": 6, "lanes_count": 3, "duration": 12}


def test_passes_gymnasiums_checker_without_a_warning():
    check_env(gymnasium.make("cpl/highway-v0", **SMALL).unwrapped)
    check_env(gymnasium.make("cpl/highway-v0", render_mode="rgb_array", **SMALL).unwrapped)


def test_passes_stable_baselines3s_checker():
    from stable_baselines3.common.env_checker import check_env as check

    # Its one warning is about highway-env's shape: an observation is a table, not a vector.
    check(gymnasium.make("cpl/highway-v0", **SMALL).unwrapped, warn=False)


def test_options_of_the_issue():
    env = gymnasium.make(
        "cpl/highway-v0",
        vehicles_count=50,
        lanes_count=4,
        target_speeds=(20, 30, 40),
        see_behind=False,
    )
    assert env.unwrapped.engine.config.target_speeds == (20, 30, 40)
    assert env.observation_space.shape == (5, 5)
    assert env.action_space == gymnasium.spaces.Discrete(5)


@pytest.mark.parametrize(
    "config", [{}, {"normalize_reward": False, "observation": {"type": "Kinematics"}}]
)
def test_same_numbers_as_highway_env(config):
    ours = gymnasium.make("cpl/highway-v0", config=config, **SMALL)
    real = reference_env(config | SMALL)
    for seed in (3, None, 4):
        obs, info = ours.reset(seed=seed)
        real_obs, real_info = real.reset(seed=seed)
        np.testing.assert_array_equal(obs, real_obs)
        assert_infos(info, real_info, but=("action",))
        assert info["action"] == 1
        for action in (3, 0, 2, 4, 1):
            step, real_step = ours.step(action), real.step(action)
            np.testing.assert_allclose(step[0], real_step[0], rtol=0, atol=1e-7)
            assert step[1] == pytest.approx(real_step[1], abs=1e-12)
            assert step[2:4] == real_step[2:4]
            assert_infos(step[4], real_step[4])
            if step[2] or step[3]:
                break


def assert_infos(ours, real, but=()):
    assert ours.keys() == real.keys()
    for name in ours.keys() - {"rewards", *but}:
        assert ours[name] == pytest.approx(real[name], abs=1e-12), name
    assert ours["rewards"] == pytest.approx(real["rewards"], abs=1e-12)


def test_reset_takes_new_options_and_goes_on_with_the_random_numbers():
    ours, real = HighwayEnv(**SMALL), reference_env(SMALL)
    ours.reset(seed=8)
    real.reset(seed=8)
    change = {"config": {"vehicles_count": 4, "lanes_count": 2}}
    np.testing.assert_array_equal(ours.reset(options=change)[0], real.reset(options=change)[0])
    np.testing.assert_array_equal(ours.reset()[0], real.reset()[0])
    assert ours.engine.config.lanes_count == 2
    with pytest.raises(ValueError, match="unknown option lane_count=2"):
        ours.reset(options={"config": {"lane_count": 2}})


def test_unseeded_roads_differ_and_seeded_ones_do_not():
    roads = [HighwayEnv(**SMALL).reset()[0] for _ in range(3)]
    assert not np.array_equal(roads[0], roads[1])
    seeded = [HighwayEnv(**SMALL).reset(seed=2**63 + 5)[0] for _ in range(2)]
    np.testing.assert_array_equal(*seeded)


@pytest.mark.parametrize(
    ("space", "bounded"),
    [
        ({}, True),
        ({"clip": False}, False),
        ({"normalize": False}, False),
        ({"features": ("presence", "heading")}, False),
        ({"features": ("presence", "cos_h", "sin_h", "x")}, True),
        ({"features_range": {"x": (-1, 1)}}, False),
        ({"features_range": {"presence": (0, 0.1)}, "features": ("presence",)}, True),
        ({"features_range": {"presence": (0, 0.1)}, "clip": False}, False),
        ({"observation_noise": 0.1}, False),
    ],
)
def test_observation_space_holds_what_is_observed(space, bounded):
    env = HighwayEnv(**SMALL, **space)
    assert env.observation_space.is_bounded() == bounded
    obs, _ = env.reset(seed=0)
    assert env.observation_space.contains(obs)


@pytest.mark.parametrize("action", [5, -1, 1.5, "left", None, [0, 1]])
def test_bad_actions(action):
    env = HighwayEnv(**SMALL)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions? must be"):
        env.step(action)


def test_order_of_calls():
    env = HighwayEnv(**SMALL, render_mode="rgb_array")
    with pytest.raises(ValueError, match="step before reset"):
        env.step(1)
    with pytest.raises(ValueError, match="render before reset"):
        env.render()
    with pytest.raises(ValueError, match="render_mode must be"):
        HighwayEnv(render_mode="human")
    for seed in (2**64, -1, 1.5, "one", True):
        with pytest.raises(ValueError, match="seed must be an integer"):
            env.reset(seed=seed)


def test_paper_setting_by_name():
    env = HighwayEnv(**highway_env_options(PAPER))
    assert env.engine.config == PAPER


def test_importing_the_road_imports_nothing_heavy():
    program = (
        "import sys, gymnasium, cpl.highway; gymnasium.spec('cpl/highway-v0');"
        "heavy = {'highway_env', 'pygame', 'torch', 'stable_baselines3', 'pandas'};"
        "sys.exit(' '.join(heavy & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
