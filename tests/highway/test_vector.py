"""Many roads: the same as Gymnasium's own vector environment over single ones."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from cpl.highway import HighwayEnv, HighwayVectorEnv

SMALL = {"vehicles_count": 5, "lanes_count": 2, "duration": 4, "vehicles_density": 2}
MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED]


def pair(number, mode, **options):
    ours = HighwayVectorEnv(number, autoreset_mode=mode, **SMALL, **options)
    makers = [lambda: HighwayEnv(**SMALL, **options) for _ in range(number)]
    return ours, SyncVectorEnv(makers, autoreset_mode=mode)


def assert_same(ours, theirs):
    for mine, other in zip(ours, theirs, strict=True):
        assert_equal(mine, other)


def assert_equal(mine, other, where="result"):
    if isinstance(other, dict):
        assert mine.keys() == other.keys(), where
        for name in other:
            assert_equal(mine[name], other[name], f"{where}[{name!r}]")
    elif isinstance(other, np.ndarray) and other.dtype == object:
        for a, b in zip(mine, other, strict=True):
            assert (a is None) == (b is None), where
            assert a is None or np.array_equal(a, b), where
    else:
        assert data_equivalence(mine, other, exact=True), f"{where}: {mine} is not {other}"


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("options", [{}, {"order": "shuffled"}, {"observation_noise": 0.2}])
def test_same_as_gymnasiums_vector_environment(mode, options):
    ours, theirs = pair(4, mode, **options)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert_same(ours.reset(seed=5), theirs.reset(seed=5))
    rng = np.random.default_rng(0)
    for _ in range(30):
        actions = rng.integers(5, size=4)
        mine, other = ours.step(actions), theirs.step(actions)
        assert_same(mine, other)
        ended = mine[2] | mine[3]
        if mode is AutoresetMode.DISABLED and ended.any():
            resets = [envs.reset(options={"reset_mask": ended.copy()}) for envs in (ours, theirs)]
            assert_same(*resets)
    assert_same(ours.reset(), theirs.reset())
    assert_same(ours.reset(seed=[9, None, 8, None]), theirs.reset(seed=[9, None, 8, None]))


def test_made_by_gymnasium():
    envs = gymnasium.make_vec("cpl/highway-v0", num_envs=3, **SMALL)
    assert isinstance(envs, HighwayVectorEnv)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    sync = gymnasium.make_vec("cpl/highway-v0", num_envs=3, vectorization_mode="sync", **SMALL)
    assert_same(envs.reset(seed=1), sync.reset(seed=1))
    envs.close()
    sync.close()


def test_wrappers_of_gymnasium_hold():
    envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(HighwayVectorEnv(3, **SMALL))
    envs.reset(seed=0)
    lengths = []
    for _ in range(12):
        *_, infos = envs.step(np.array([1, 1, 4]))
        lengths += [n for n in infos.get("episode", {}).get("l", []) if n]
    assert max(lengths) == 4


def test_results_are_not_written_to_again_and_do_not_hang_on_threads():
    one, many = (HighwayVectorEnv(5, threads=n, **SMALL) for n in (1, 3))
    results = [envs.reset(seed=3) for envs in (one, many)]
    first = results[0][0].copy()
    for action in (3, 0, 2, 3, 1, 1):
        assert_same(one.step(np.full(5, action)), many.step(np.full(5, action)))
    np.testing.assert_array_equal(results[0][0], first)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda e: e.step(np.ones(3, int)), "actions must be integers of shape"),
        (lambda e: e.step(np.ones(2)), "actions must be integers of shape"),
        (lambda e: e.step(np.array([1, 7])), "actions must be in"),
        (lambda e: e.reset(seed=[1, 2, 3]), "seed has 3 entries for 2 environments"),
        (lambda e: e.reset(seed=-1), "seed must be an integer"),
        (lambda e: e.reset(seed=[1, -1]), "seed must be an integer"),
        (lambda e: e.reset(options={"reset_mask": [True, True]}), "reset_mask must be a bool"),
        (lambda e: e.reset(options={"reset_mask": np.array([True])}), "reset_mask must have shape"),
        (lambda e: e.reset(options={"masque": None}), "unknown option of reset: masque"),
    ],
)
def test_bad_calls(call, message):
    envs = HighwayVectorEnv(2, **SMALL)
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        call(envs)


def test_bad_batches():
    with pytest.raises(ValueError, match="step before reset"):
        HighwayVectorEnv(2, **SMALL).step(np.array([1, 1]))
    for number in (0, -1, 1.5, True):
        with pytest.raises(ValueError, match="n_envs must be a positive integer"):
            HighwayVectorEnv(number, **SMALL)
    with pytest.raises(ValueError, match="Sometimes"):
        HighwayVectorEnv(2, autoreset_mode="Sometimes", **SMALL)
    envs = HighwayVectorEnv(2, autoreset_mode="Disabled", **SMALL)
    envs.reset(seed=0)
    ended = False
    while not ended:
        _, _, terminated, truncated, _ = envs.step(np.array([4, 4]))
        ended = (terminated | truncated).any()
    with pytest.raises(ValueError, match="have ended; reset them"):
        envs.step(np.array([4, 4]))


def test_pictures_of_every_road():
    envs = HighwayVectorEnv(2, render_mode="rgb_array", **SMALL)
    envs.reset(seed=0)
    one, two = envs.render()
    assert one.shape == two.shape == (150, 600, 3)
    assert not np.array_equal(one, two)
    envs.close()
