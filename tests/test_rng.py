from itertools import combinations

import numpy as np
import pytest

from cpl.rng import stream

PATHS = [(), ("a",), ("b",), ("a", "b"), ("ab",), ("a", 0), ("a", 1), (0,), ("0",), (1, 0), (10,)]


def test_streams_are_the_same_for_ever():
    """Golden values: a change here would silently change every published number."""
    assert stream(0).integers(0, 2**63, size=2).tolist() == GOLDEN[0]
    assert stream(7, "highway", 3).integers(0, 2**63, size=2).tolist() == GOLDEN[1]
    assert stream(2**70, "ü", -1).random(2).tolist() == GOLDEN[2]


def test_calling_again_starts_again():
    assert np.array_equal(stream(1, "x").random(5), stream(1, "x").random(5))


def test_a_stream_touches_nothing_global():
    np.random.seed(3)  # noqa: NPY002 - the global state is what is watched
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    stream(0, "x").random(100)
    assert np.array_equal(np.random.get_state()[1], before)  # noqa: NPY002


def test_paths_seeds_and_types_give_different_streams():
    seen = {tuple(stream(s, *p).integers(0, 2**62, 3).tolist()) for s in (0, 1) for p in PATHS}
    assert len(seen) == 2 * len(PATHS)


def test_streams_are_uncorrelated():
    """4,000 normals each: every pairwise correlation within 5 standard errors."""
    drawn = [stream(0, *path).standard_normal(4000) for path in PATHS]
    assert max(abs(np.corrcoef(a, b)[0, 1]) for a, b in combinations(drawn, 2)) < 5 / 4000**0.5


def test_neighbouring_seeds_and_numbers_are_uncorrelated():
    drawn = np.array([stream(s, "episode", i).random(200) for s in range(8) for i in range(8)])
    correlation = np.corrcoef(drawn) - np.eye(64)
    assert abs(correlation).max() < 5.5 / 200**0.5


@pytest.mark.parametrize("seed", [-1, 1.0, "1", True, None])
def test_bad_seeds_are_named(seed):
    with pytest.raises(ValueError, match=f"seed must be an integer >= 0, got {seed!r}"):
        stream(seed)


@pytest.mark.parametrize("name", [1.5, None, True, ("a",)])
def test_bad_names_are_named(name):
    with pytest.raises(ValueError, match="names must be text or integers"):
        stream(0, name)


def test_numpy_integers_are_integers():
    assert stream(np.int64(3), np.int32(2)).random() == stream(3, 2).random()


GOLDEN = (
    [2021737767253175358, 1262568494624265746],
    [3276526677944323175, 3331395825636699808],
    [0.6876991961171552, 0.5365538414055132],
)
