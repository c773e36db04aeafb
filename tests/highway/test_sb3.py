"""Many roads for Stable-Baselines3: the same as its own vector environment over single ones."""

import numpy as np
import pytest
from stable_baselines3 import DQN
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from cpl.highway import Config, HighwayEnv
from cpl.highway.sb3 import HighwayVecEnv

SMALL = {"vehicles_count": 5, "lanes_count": 2, "duration": 4, "vehicles_density": 2}


def test_same_as_dummy_vec_env():
    ours = HighwayVecEnv(3, **SMALL)
    theirs = DummyVecEnv([lambda: HighwayEnv(**SMALL) for _ in range(3)])
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    for envs in (ours, theirs):
        envs.seed(4)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    assert ours.reset_infos == theirs.reset_infos
    rng, ended = np.random.default_rng(0), 0
    for _ in range(40):
        actions = rng.integers(5, size=3)
        mine, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(mine[:3], other[:3], strict=True):
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype
        for info, real in zip(mine[3], other[3], strict=True):
            assert info.keys() == real.keys()
            last = info.pop("terminal_observation", None)
            if last is not None:
                np.testing.assert_array_equal(last, real.pop("terminal_observation"))
                ended += 1
            assert info == real
        assert ours.reset_infos == theirs.reset_infos
    assert ended > 20


def test_learns():
    envs = VecMonitor(HighwayVecEnv(4, Config(), **SMALL))
    model = DQN("MlpPolicy", envs, learning_starts=20, buffer_size=200, batch_size=8, seed=0)
    model.learn(128)
    assert model.num_timesteps == 128
    assert len(model.ep_info_buffer) > 10


def test_attributes_and_refusals():
    envs = HighwayVecEnv(2, render_mode="rgb_array", **SMALL)
    assert envs.get_attr("render_mode") == ["rgb_array"] * 2
    assert envs.env_is_wrapped(object) == [False, False]
    envs.set_attr("mark", 3)
    assert envs.get_attr("mark", 1) == [3]
    with pytest.raises(ValueError, match="mark cannot be set"):
        envs.set_attr("mark", 3, [0])
    with pytest.raises(ValueError, match="'move'"):
        envs.env_method("move")
    with pytest.raises(ValueError, match="step before reset"):
        envs.step(np.array([1, 1]))
    envs.reset()
    assert envs.render().shape == (150 * 2, 600, 3)
    envs.set_options({"config": {}})
    with pytest.raises(ValueError, match="options of reset"):
        envs.reset()
    envs.close()
    with pytest.raises(ValueError, match="unknown option lane_count"):
        HighwayVecEnv(2, lane_count=3)
    with pytest.raises(ValueError, match="render_mode must be"):
        HighwayVecEnv(2, render_mode="human")
