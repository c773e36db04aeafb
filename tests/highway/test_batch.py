"""Laws of the batch: roads do not know of each other, and a state is all there is."""

from dataclasses import fields, replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.highway import Config, Engine, State

configs = st.builds(
    Config,
    vehicles_count=st.integers(0, 9),
    lanes_count=st.integers(1, 5),
    vehicles_density=st.floats(0.5, 4),
    duration=st.integers(2, 5),
    observation_vehicles_count=st.integers(1, 7),
    see_behind=st.booleans(),
    order=st.sampled_from(["sorted", "shuffled"]),
    observation_noise=st.sampled_from([0.0, 0.1]),
    observation_dropout=st.sampled_from([0.0, 0.5]),
    collisions=st.sampled_from(["all", "ego", "none"]),
)
action_table = st.lists(st.lists(st.integers(0, 4), min_size=3, max_size=3), max_size=6)


def assert_same(one, other):
    for mine, theirs in zip(one, other, strict=True):
        if isinstance(mine, tuple):
            assert_same(mine, theirs)
        else:
            np.testing.assert_array_equal(mine, theirs)


def part(state, e):
    return State(**{f.name: getattr(state, f.name)[e : e + 1] for f in fields(State)})


def assert_states_equal(one, other):
    for field in fields(State):
        np.testing.assert_array_equal(
            getattr(one, field.name), getattr(other, field.name), field.name
        )


@settings(max_examples=25, deadline=None)
@given(config=configs, actions=action_table, seed=st.integers(0, 2**62))
def test_a_batch_is_its_roads_one_by_one(config, actions, seed):
    seeds = [seed, seed + 1, 7]
    batch, singles = Engine(config, 3, threads=2), [Engine(config, 1) for _ in seeds]
    obs = batch.reset(seeds)
    for e, single in enumerate(singles):
        np.testing.assert_array_equal(single.reset([seeds[e]])[0], obs[e])
    for row in actions:
        out = batch.step(row)
        for e, single in enumerate(singles):
            alone = single.step([row[e]])
            for mine, theirs in zip(out[:4], alone[:4], strict=True):
                np.testing.assert_array_equal(mine[e], theirs[0])
            for mine, theirs in zip(out.info, alone.info, strict=True):
                assert mine[e] == theirs[0]
    for e, single in enumerate(singles):
        assert_states_equal(part(batch.state(), e), single.state())


@settings(max_examples=25, deadline=None)
@given(config=configs, actions=action_table, seed=st.integers(0, 2**62))
def test_a_state_is_all_there_is(config, actions, seed):
    first, second = Engine(config, 3), Engine(config, 3)
    first.reset([seed, 1, 2])
    for row in actions:
        first.step(row)
    second.set_state(first.state())
    for row in [*actions, [3, 1, 0]]:
        assert_same(first.step(row), second.step(row))
    np.testing.assert_array_equal(first.reset(), second.reset())
    assert_states_equal(first.state(), second.state())


@settings(max_examples=15, deadline=None)
@given(config=configs, mask=st.lists(st.booleans(), min_size=3, max_size=3))
def test_a_masked_reset_leaves_the_others_alone(config, mask):
    engine = Engine(config, 3)
    engine.reset([1, 2, 3])
    engine.step([3, 0, 2])
    before, chosen = engine.state(), np.array(mask)
    obs = engine.reset(None, chosen)
    after = engine.state()
    for e in np.flatnonzero(~chosen):
        assert_states_equal(part(before, e), part(after, e))
        assert not obs[e].any()
    assert (after.time[chosen] == 0).all()


def test_nothing_that_was_returned_changes_later():
    engine = Engine(Config(vehicles_count=3), 2)
    obs = engine.reset([0, 1])
    out, state = engine.step([3, 3]), engine.state()
    kept = [obs.copy(), out.obs.copy(), out.info.speed.copy(), state.x.copy()]
    engine.step([4, 0])
    for was, now in zip(kept, (obs, out.obs, out.info.speed, state.x), strict=True):
        np.testing.assert_array_equal(was, now)


def test_the_soft_cap_makes_50_forty():
    engine = Engine(Config(vehicles_count=0, target_speeds=(20, 35, 50), duration=100), 1)
    engine.reset([0])
    speeds = [engine.step([3]).info.speed[0] for _ in range(30)]
    assert 40 <= max(speeds) < 41
    assert abs(speeds[-1] - 40) < 0.5


def test_an_injected_ghost_state_is_refused_or_simulated_finitely():
    engine = Engine(Config(vehicles_count=2, lanes_count=2), 1)
    engine.reset([0])
    state = engine.state()
    same = np.zeros_like(state.x)
    engine.set_state(replace(state, x=same + 50.0, y=same, speed=same - 60.0, crashed=same == 0))
    for _ in range(3):
        out = engine.step([1])
        assert out.terminated[0]
        assert np.isfinite(out.obs).all()
        assert np.isfinite(out.reward).all()
