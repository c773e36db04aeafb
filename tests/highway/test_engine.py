"""The engine beside highway-env itself: equal bits where numpy uses libm, 1e-9 elsewhere.

Run as a script, this file compares the two engines over many drawn settings:
    NPY_DISABLE_CPU_FEATURES="X86_V4 AVX512_ICL AVX512_SPR" python tests/highway/test_engine.py 50
"""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from cpl.highway import PAPER, Config, Engine

LIBM_ONLY = "X86_V4 AVX512_ICL AVX512_SPR"  # numpy's AVX-512 kernels differ from libm by 1 ulp
REALS = ("x", "y", "heading", "speed", "target_speed")
CODES = ("lane", "target_lane", "crashed", "has_impact")


def oracle_of(config):
    """highway-env with a config's options, as it registers itself."""
    from highway_env.envs.highway_env import HighwayEnv, HighwayEnvFast

    kind = HighwayEnv if config.collisions == "all" else HighwayEnvFast
    names = [
        *("lanes_count", "vehicles_count", "initial_lane_id", "duration", "ego_spacing"),
        *("vehicles_density", "collision_reward", "right_lane_reward", "high_speed_reward"),
        *("reward_speed_range", "normalize_reward", "offroad_terminal"),
        *("simulation_frequency", "policy_frequency"),
    ]
    options = {name: getattr(config, name) for name in names}
    options["action"] = {
        "type": "DiscreteMetaAction",
        "target_speeds": list(config.target_speeds),
    }
    options["observation"] = {
        "type": "Kinematics",
        "vehicles_count": config.observation_vehicles_count,
        "features": list(config.features),
        "see_behind": config.see_behind,
        "absolute": config.absolute,
        "normalize": config.normalize,
        "clip": config.clip,
        "order": config.order,
    }
    return kind(options)


def oracle_state(env):
    """Arrays of highway-env's vehicles, named as in `State`."""
    cars = env.road.vehicles
    blank = np.zeros(2)
    columns = {
        "x": [v.position[0] for v in cars],
        "y": [v.position[1] for v in cars],
        "heading": [v.heading for v in cars],
        "speed": [v.speed for v in cars],
        "target_speed": [v.target_speed for v in cars],
        "timer": [getattr(v, "timer", 0.0) for v in cars],
        "lane": [v.lane_index[2] for v in cars],
        "target_lane": [v.target_lane_index[2] for v in cars],
        "crashed": [v.crashed for v in cars],
        "has_impact": [v.impact is not None for v in cars],
        "impact_x": [(blank if v.impact is None else v.impact)[0] for v in cars],
        "impact_y": [(blank if v.impact is None else v.impact)[1] for v in cars],
    }
    return {name: np.array(column) for name, column in columns.items()}


def assert_same(config, env, engine, tolerance, where):
    ours, theirs = engine.state(), oracle_state(env)
    for name in CODES:
        assert np.array_equal(getattr(ours, name)[0], theirs[name]), (where, name)
    for name in (*REALS, "timer", "impact_x", "impact_y"):
        mine = getattr(ours, name)[0]
        if name == "timer":
            mine, theirs[name] = mine[1:], theirs[name][1:]
        if name.startswith("impact"):
            mine = np.where(ours.has_impact[0], mine, 0.0)
        gap = np.abs(mine - theirs[name]).max(initial=0.0)
        assert gap <= tolerance, (where, name, gap, config)


def drive(config, seed, actions, tolerance, resets=1):
    """Drive both engines through the same decisions; returns the number of crashes."""
    env, engine = oracle_of(config), Engine(config, 1)
    crashes = 0
    for episode in range(resets):
        seen, _ = env.reset(seed=seed if episode == 0 else None)
        mine = engine.reset(seeds=[seed] if episode == 0 else None)[0]
        assert_same(config, env, engine, tolerance, (seed, episode, "reset"))
        np.testing.assert_allclose(mine, seen, rtol=0, atol=tolerance)
        for t, action in enumerate(actions):
            seen, reward, terminated, truncated, info = env.step(int(action))
            out = engine.step([action])
            where = (seed, episode, t)
            assert_same(config, env, engine, tolerance, where)
            np.testing.assert_allclose(out.obs[0], seen, rtol=0, atol=tolerance, err_msg=str(where))
            assert abs(out.reward[0] - reward) <= tolerance, where
            assert (out.terminated[0], out.truncated[0]) == (terminated, truncated), where
            assert abs(out.info.speed[0] - info["speed"]) <= tolerance, where
            assert out.info.crashed[0] == info["crashed"], where
        crashes += int(out.info.crashed[0])
    return crashes


def drawn(seed):
    """A small setting and a few decisions, drawn from a seed."""
    g = np.random.default_rng([7, seed])
    top = float(g.choice([30, 40, 50]))
    policy = int(g.choice([1, 2, 5]))
    lanes = int(g.integers(1, 6))
    n = int(g.integers(3, 9))
    config = Config(
        lanes_count=lanes,
        vehicles_count=int(g.choice([0, 1, 5, 10, 20, 40])),
        vehicles_density=float(g.choice([0.5, 1.0, 1.5, 2.0])),
        ego_spacing=float(g.choice([1.0, 1.5, 2.0])),
        initial_lane_id=None if g.random() < 0.7 else int(g.integers(lanes)),
        target_speeds=tuple(np.linspace(20, top, int(g.choice([3, 5])))),
        policy_frequency=policy,
        simulation_frequency=15 if policy != 2 else 10,
        observation_vehicles_count=n,
        see_behind=bool(g.random() < 0.3),
        absolute=bool(g.random() < 0.2),
        normalize=bool(g.random() < 0.8),
        clip=bool(g.random() < 0.8),
        order="shuffled" if g.random() < 0.2 else "sorted",
        normalize_reward=bool(g.random() < 0.5),
        offroad_terminal=bool(g.random() < 0.5),
        collisions="ego" if g.random() < 0.2 else "all",
        features=("presence", "x", "y", "vx", "vy", "heading", "cos_h", "sin_h", "lat_off")
        if g.random() < 0.3
        else ("presence", "x", "y", "vx", "vy"),
        duration=10.0,
    )
    style = g.integers(4)
    steps = 12
    if style == 0:
        actions = g.integers(0, 5, steps)
    elif style == 1:
        actions = np.full(steps, 3)
    elif style == 2:
        actions = np.tile([0, 2], steps)[:steps]
    else:
        actions = np.where(g.random(steps) < 0.5, 3, g.integers(0, 3, steps))
    return config, actions


@pytest.mark.parametrize("seed", range(3))
def test_trajectories_equal_highway_env(seed):
    config, actions = drawn(seed)
    drive(config, seed, actions, 1e-9, resets=2)


def test_the_paper_setting_equals_highway_env():
    config = replace(PAPER, vehicles_count=20, target_speeds=(20.0, 30.0, 40.0))
    assert drive(config, 3, [3] * 8, 1e-9) == 1


def test_bits_equal_highway_env_where_numpy_uses_libm():
    environment = {**os.environ, "NPY_DISABLE_CPU_FEATURES": LIBM_ONLY}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", __file__, "4"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


if __name__ == "__main__":
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    total = 0
    for number in range(first, first + int(sys.argv[1])):
        total += drive(*drawn(number)[:1], number, drawn(number)[1], 0.0, resets=2)
    sys.stdout.write(f"equal bits in {sys.argv[1]} settings, {total} crashed episodes\n")
