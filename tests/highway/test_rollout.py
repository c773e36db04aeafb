"""Rollouts and episode tables, against episodes driven one by one."""

from itertools import islice, pairwise

import numpy as np
import pytest

from cpl.highway import Config, Engine, HighwayEnv, rollout, run_episodes

SMALL = {"vehicles_count": 6, "lanes_count": 2, "duration": 6, "vehicles_density": 2}


def hasty(obs):
    """Faster, and now and then to a side, from the observation alone."""
    return np.where(obs[:, 1, 1] < 0.12, 2, 3)


def test_transitions_chain_and_keep_the_last_observation():
    engine = Engine(Config(**SMALL), 3)
    steps = list(islice(rollout(engine, hasty, seeds=[0, 1, 2]), 20))
    ended = 0
    for now, then in pairwise(steps):
        over = now.terminated_t | now.truncated_t
        ended += over.sum()
        np.testing.assert_array_equal(then.obs_tm1[~over], now.obs_t[~over])
        assert all(not np.array_equal(then.obs_tm1[e], now.obs_t[e]) for e in np.flatnonzero(over))
    assert ended > 3
    assert steps[0].reward_t.dtype == np.float64


def test_one_episode_for_each_seed_whatever_the_batch():
    config, seeds = Config(**SMALL), list(range(40, 53))
    tables = [run_episodes(config, hasty, seeds, n_envs=n) for n in (1, 4, 50)]
    for table in tables:
        assert table.seed.tolist() == seeds
        for column in table:
            np.testing.assert_array_equal(table[column], tables[0][column])
    assert 0 < tables[0].crashed.sum() < len(seeds)


def test_table_is_what_the_episodes_were():
    table = run_episodes(Config(**SMALL), hasty, [3, 41, 44], n_envs=2)
    for row in table.itertuples():
        env = HighwayEnv(**SMALL)
        obs, info = env.reset(seed=row.seed)
        first = env.engine.state()
        speeds, rewards, over = [], [], False
        while not over:
            obs, reward, terminated, truncated, info = env.step(int(hasty(obs[None])[0]))
            speeds.append(info["speed"])
            rewards.append(reward)
            over = terminated or truncated
        last = env.engine.state()
        assert row.steps == row.duration_s == len(speeds)
        assert row.crashed == info["crashed"]
        assert row.episode_mean_speed_mps == pytest.approx(np.mean(speeds))
        counted = speeds[:-1] if row.crashed else speeds
        assert row.mean_speed_before_crash_mps == pytest.approx(np.mean(counted))
        assert row.episode_return == pytest.approx(sum(rewards))
        assert row.distance_m == last.x[0, 0] - first.x[0, 0]
        passed = (last.x[0, 1:] < last.x[0, 0]).sum() - (first.x[0, 1:] < first.x[0, 0]).sum()
        assert row.overtaken == passed


def test_bad_arguments():
    with pytest.raises(ValueError, match="seeds must be a list of at least one seed"):
        run_episodes(Config(**SMALL), hasty, [])
    with pytest.raises(ValueError, match="n_envs must be at least 1"):
        run_episodes(Config(**SMALL), hasty, [1], n_envs=0)
    with pytest.raises(ValueError, match="actions must be"):
        run_episodes(Config(**SMALL), lambda obs: obs, [1])
    with pytest.raises(ValueError, match="seeds must be integers of shape"):
        next(rollout(Engine(Config(**SMALL), 2), hasty, seeds=[1]))
