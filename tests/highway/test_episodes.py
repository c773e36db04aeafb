"""The loop over episodes: every one is driven once, to its end, wherever it falls."""

from collections import Counter
from itertools import islice, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.highway import Config, Engine, Info, Plan, Step, episodes

ROAD = Config(vehicles_count=12, lanes_count=3, duration=8)


class Clock:
    """Roads on which episode e, begun with the seed e, takes 1 + e % 5 decisions."""

    def __init__(self, n_envs):
        self.n_envs, self.left = n_envs, np.zeros(n_envs, np.int64)

    def reset(self, seeds, mask=None):
        mask = np.ones(self.n_envs, np.bool_) if mask is None else mask
        self.left = np.where(mask, 1 + seeds % 5, self.left)
        return np.where(mask, seeds, 0).astype(np.float32)[:, None, None]

    def step(self, actions):
        self.left -= 1
        ends, none = self.left == 0, np.zeros(self.n_envs)
        obs = actions.astype(np.float32)[:, None, None]
        return Step(obs, none, ends, ends & False, Info(*[none] * 5))


@given(
    number=st.integers(1, 9),
    roads=st.integers(1, 6),
    settings=st.integers(1, 3),
    streams=st.none() | st.integers(1, 4),
)
def test_every_episode_of_every_setting_is_driven_once_and_whole(number, roads, settings, streams):
    plan = Plan(number, roads, settings=settings, streams=streams)
    seeds, begun, done, lengths = np.arange(number) + 10, [], Counter(), []

    def act(now):
        assert (now.obs[now.began, 0, 0] == seeds[plan.episode[now.began]]).all()
        assert (now.step[now.began] == 0).all()
        begun.extend(zip(plan.setting[now.began], plan.episode[now.began], strict=True))
        return np.full(plan.roads, 99)

    for turn in episodes(Clock(plan.roads), act, seeds, plan):
        assert not (turn.ended & ~turn.active).any()
        ended = plan.setting[turn.ended], plan.episode[turn.ended]
        done.update(zip(*ended, strict=True))
        lengths += list(turn.step[turn.ended] - (1 + seeds[ended[1]] % 5))
    everything = [(k, e) for k in range(settings) for e in range(number)]
    assert Counter(begun) == done == Counter(everything)
    assert not any(lengths)


def test_streams_keep_to_their_road_in_order():
    plan, order = Plan(7, 99, settings=2, streams=3), {}
    roads = Clock(plan.roads)
    for turn in episodes(roads, lambda now: np.zeros(plan.roads), np.arange(7), plan):
        for road in np.flatnonzero(turn.ended).tolist():
            order.setdefault((road, int(plan.setting[road])), []).append(int(plan.episode[road]))
    assert order == {
        (0, 0): [0, 3, 6], (1, 0): [1, 4], (2, 0): [2, 5],
        (3, 1): [0, 3, 6], (4, 1): [1, 4], (5, 1): [2, 5],
    }  # fmt: skip


def test_without_a_plan_it_goes_on_with_the_roads_own_random_numbers():
    engine = Engine(ROAD, 2)
    turns = list(islice(episodes(engine, lambda now: np.full(2, 3), np.array([3, 4])), 30))
    assert sum(turn.ended.sum() for turn in turns) > 4
    assert all(turn.active.all() for turn in turns)
    for before, after in pairwise(turns):
        stays = ~before.ended
        np.testing.assert_array_equal(after.obs_tm1[stays], before.out.obs[stays])
        for begun, last in zip(after.obs_tm1[~stays], before.out.obs[~stays], strict=True):
            assert not np.array_equal(begun, last)


@pytest.mark.parametrize("roads", [1, 5])
def test_a_road_without_an_episode_stands_still(roads):
    plan = Plan(3, roads)
    turns = list(episodes(Clock(plan.roads), lambda now: np.ones(plan.roads), np.arange(3), plan))
    last = turns[-1]
    assert last.active.sum() == 1
    assert last.step.tolist() == ([3] if roads == 1 else [1, 2, 3])
