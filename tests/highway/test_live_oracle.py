"""The engine beside highway-env itself, step by step, on the numpy that is installed.

numpy's AVX-512 kernels may differ from libm in the last bit, so floats agree within 1e-9 here and
everything discrete exactly: lanes and target lanes, crashes and their step, speed levels,
terminations and truncations. `test_fixtures.py` and the last test here compare bits.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.highway import Engine, highway_env_options
from cpl.highway.reference import read_state, reference_env

HERE = Path(__file__).resolve().parent
TOLERANCE = 1e-9


class Pair:
    """highway-env and an engine of one, compared at every reset and step."""

    def __init__(self, oracle, engine_runs, options, fast=False):
        self.oracle, self.runs = oracle, engine_runs
        config = engine_runs.config(options, fast)
        # All options are spelled out: highway-fast-v0 has other defaults.
        self.real = reference_env(highway_env_options(config), fast=fast)
        self.engine = Engine(config, 1)

    def reset(self, seed):
        obs, _ = self.real.reset(seed=seed)
        ours = self.engine.reset(None if seed is None else [seed])
        self.compare(obs, ours[0], f"reset {seed}")

    def step(self, action, where):
        obs, reward, terminated, truncated, info = self.real.step(int(action))
        out = self.engine.step([int(action)])
        assert (bool(out.terminated[0]), bool(out.truncated[0])) == (terminated, truncated), where
        assert abs(out.reward[0] - reward) <= TOLERANCE, where
        assert abs(out.info.speed[0] - info["speed"]) <= TOLERANCE, where
        for name, term in info["rewards"].items():
            found = getattr(out.info, name.removesuffix("_reward"), out.info.crashed)[0]
            assert abs(found - term) <= TOLERANCE, (where, name)
        self.compare(obs, out.obs[0], where)
        return terminated

    def compare(self, obs, our_obs, where):
        real, ours = read_state(self.real), self.runs.states(self.engine)[0]
        for name in self.oracle.DISCRETE:
            np.testing.assert_array_equal(ours[name], real[name], f"{where}: {name}")
        for name in self.oracle.FLOATS:
            np.testing.assert_allclose(
                ours[name], real[name], rtol=0, atol=TOLERANCE, err_msg=f"{where}: {name}"
            )
        np.testing.assert_allclose(our_obs, obs, rtol=0, atol=1e-5, err_msg=f"{where}: obs")


def play(pair, group):
    """A group's sessions, driven on past crashes; how many episodes crashed."""
    crashed = 0
    for seed, kind in zip(group.seeds, group.actions, strict=True):
        actions = iter(pair.oracle.draw_actions(kind, seed, sum(group.lengths)))
        for number, length in enumerate(group.lengths):
            pair.reset(seed if number == 0 else None)
            ends = [pair.step(next(actions), f"{kind} {seed} step {t}") for t in range(length)]
            crashed += any(ends)
    return crashed


def draw_groups(oracle, name, count, **drawn):
    rng = np.random.default_rng([5, *name.encode()])
    return [oracle.draw_group(rng, **drawn) for _ in range(count)]


def test_small_roads(oracle, engine_runs):
    groups = draw_groups(oracle, "live", 6, vehicles=(5, 9), lengths=[10, 6], sessions=1)
    assert sum(play(Pair(oracle, engine_runs, g.options), g) for g in groups) > 0


@pytest.mark.parametrize("kind", ["weave", "faster"])
def test_the_papers_road(kind, oracle, engine_runs):
    (group,) = draw_groups(
        oracle,
        kind,
        1,
        vehicles=(50, 50),
        lengths=[7],
        sessions=1,
        lanes_count=4,
        simulation_frequency=15,
        policy_frequency=1,
    )
    group.actions = [kind]
    play(Pair(oracle, engine_runs, group.options), group)


def configurations():
    """highway-env's options, drawn so that hypothesis can shrink them."""
    observation = st.fixed_dictionaries(
        {"type": st.just("Kinematics"), "vehicles_count": st.integers(2, 8)},
        optional={
            "see_behind": st.booleans(),
            "absolute": st.booleans(),
            "normalize": st.booleans(),
            "clip": st.booleans(),
            "order": st.sampled_from(["sorted", "shuffled"]),
        },
    )
    low = st.integers(15, 25)
    speeds = st.tuples(low, st.integers(2, 7), st.sampled_from([2, 2.5, 5, 10])).map(
        lambda draw: [draw[0] + draw[2] * k for k in range(draw[1])]
    )
    return st.fixed_dictionaries(
        {
            "vehicles_count": st.integers(1, 8),
            "lanes_count": st.integers(1, 5),
            "action": st.fixed_dictionaries(
                {"type": st.just("DiscreteMetaAction"), "target_speeds": speeds}
            ),
            "observation": observation,
        },
        optional={
            "vehicles_density": st.floats(0.5, 4),
            "ego_spacing": st.floats(0.1, 4),
            "duration": st.integers(1, 6),
            "simulation_frequency": st.sampled_from([4, 8, 12, 20]),
            "policy_frequency": st.sampled_from([1, 2, 3, 4]),
            "right_lane_reward": st.floats(0, 1),
            "high_speed_reward": st.floats(0, 1),
            "collision_reward": st.floats(-10, -0.1),
            "normalize_reward": st.booleans(),
            "offroad_terminal": st.booleans(),
        },
    ).map(lambda options: {"simulation_frequency": 4} | options)


def drive_drawn(oracle, engine_runs, options, seed, actions, fast):
    pair = Pair(oracle, engine_runs, options, fast)
    pair.reset(seed)
    for t, action in enumerate(actions):
        pair.step(action, f"step {t}")
    pair.reset(None)


drawn_episode = given(
    options=configurations(),
    seed=st.integers(0, 2**63),
    actions=st.lists(st.integers(0, 4), min_size=1, max_size=8),
    fast=st.booleans(),
)


@settings(max_examples=25, deadline=None)
@drawn_episode
def test_drawn_configurations(oracle, engine_runs, options, seed, actions, fast):
    drive_drawn(oracle, engine_runs, options, seed, actions, fast)


@pytest.mark.oracle
@settings(max_examples=150, deadline=None)
@drawn_episode
def test_many_drawn_configurations(oracle, engine_runs, options, seed, actions, fast):
    drive_drawn(oracle, engine_runs, options, seed, actions, fast)


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("name", "count", "drawn"),
    [
        ("many", 40, {"vehicles": (5, 12), "lengths": [12, 20], "sessions": 1}),
        ("fast", 8, {"vehicles": (10, 20), "lengths": [15], "sessions": 1, "fast": True}),
        ("odd", 15, {"vehicles": (5, 9), "lengths": [10], "sessions": 1, "odd_observation": True}),
        ("wide", 5, {"vehicles": (30, 60), "lengths": [20], "sessions": 1}),
    ],
)
def test_many_live_episodes(name, count, drawn, oracle, engine_runs):
    for group in draw_groups(oracle, f"check {name}", count, **drawn):
        play(Pair(oracle, engine_runs, group.options, group.fast), group)


INJECT = """
import importlib.util, sys, numpy as np
spec = importlib.util.spec_from_file_location("highway_oracle", sys.argv[1])
oracle = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = oracle
spec.loader.exec_module(oracle)
for number in map(int, sys.argv[3:]):
    options, actions, states = oracle.plan_injected(number)
    table = oracle.make_table(oracle.run_injected(options, actions, states))
    lanes = oracle.closest_lanes(options, states)
    np.savez(f"{sys.argv[2]}/{number}.npz", lanes=lanes, **table)
"""


@pytest.mark.oracle
def test_fresh_injected_states_bit_for_bit(oracle, engine_runs, tmp_path):
    numbers = range(1000, 1006)
    command = [sys.executable, "-c", INJECT, str(HERE / "oracle.py"), str(tmp_path)]
    environ = os.environ | {"NPY_DISABLE_CPU_FEATURES": oracle.LIBM_FLAGS}
    subprocess.run([*command, *map(str, numbers)], env=environ, check=True)
    for number in numbers:
        options, actions, states = oracle.plan_injected(number)
        with np.load(tmp_path / f"{number}.npz", allow_pickle=False) as archive:
            lanes, expected = archive["lanes"], {n: archive[n] for n in oracle.COLUMNS}
        table = oracle.make_table(engine_runs.injected(options, actions, states | {"lane": lanes}))
        for name, values in expected.items():
            np.testing.assert_array_equal(table[name], values, f"injected {number}: {name}")
