"""The engine beside highway-env itself: equal bits where numpy uses libm, 1e-9 elsewhere.

Run as a script, this file compares the two engines over many drawn settings:
    NPY_DISABLE_CPU_FEATURES="X86_V4 AVX512_ICL AVX512_SPR" python tests/highway/test_engine.py 50
"""

import os
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction

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


def dot_is_fused():
    """Whether this machine's BLAS rounds a sum of two products as the engine does."""
    for a, b in np.random.default_rng(0).normal(size=(200, 2, 2)):
        fused = Fraction(a[1]) * Fraction(b[1]) + Fraction(a[0] * b[0])
        if a @ b != float(fused):
            return False
    return True


@pytest.mark.skipif(not dot_is_fused(), reason="this BLAS rounds both products of a dot")
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


CROWD = Config(vehicles_count=12, vehicles_density=2.0, lanes_count=3)


def run(engine, steps, seed=0, first=None):
    g = np.random.default_rng(seed)
    engine.reset(np.arange(engine.n_envs) if first is None else first)
    return [engine.step(g.integers(0, 5, engine.n_envs)) for _ in range(steps)]


def assert_equal_runs(ours, theirs):
    for one, other in zip(ours, theirs, strict=True):
        for a, b in zip((*one[:4], *one.info), (*other[:4], *other.info), strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_batch_equals_its_environments_one_by_one():
    together = run(Engine(CROWD, 6), 10, seed=1)
    g = np.random.default_rng(1)
    actions = np.array([g.integers(0, 5, 6) for _ in range(10)])
    for e in range(6):
        alone = Engine(CROWD, 1)
        alone.reset([e])
        for t in range(10):
            np.testing.assert_array_equal(
                alone.step(actions[t, e : e + 1]).obs[0], together[t].obs[e]
            )


def test_threads_and_paths_do_not_change_results():
    plain = run(Engine(CROWD, 7, path="fast"), 10)
    assert_equal_runs(run(Engine(CROWD, 7, threads=3, path="fast"), 10), plain)
    assert_equal_runs(run(Engine(CROWD, 7, path="portable"), 10), plain)


def test_a_state_continues_bit_for_bit_and_through_a_reset():
    engine, twin = Engine(CROWD, 3), Engine(CROWD, 3)
    run(engine, 6)
    twin.set_state(engine.state())
    for action in ([0, 1, 2], [3, 3, 4], [2, 2, 0]):
        assert_equal_runs([engine.step(action)], [twin.step(action)])
    np.testing.assert_array_equal(engine.reset(), twin.reset())


def test_a_masked_reset_leaves_the_others_alone():
    engine = Engine(CROWD, 3)
    run(engine, 4)
    before = engine.state()
    obs = engine.reset(mask=np.array([False, True, False]))
    after = engine.state()
    assert not obs[[0, 2]].any()
    assert obs[1].any()
    np.testing.assert_array_equal(before.x[[0, 2]], after.x[[0, 2]])
    assert after.steps.tolist() == [60, 0, 60]


def test_a_crashed_episode_runs_on_to_a_standstill():
    engine = Engine(replace(CROWD, target_speeds=(20.0, 40.0)), 8)
    engine.reset(np.arange(8))
    for _ in range(30):
        out = engine.step(np.full(8, 3))
    assert out.terminated.sum() > 3
    assert np.abs(out.info.speed[out.terminated]).max() < 20
    assert not np.isnan(engine.state().x).any()


def test_noise_and_dropout_have_their_own_stream():
    plain, noisy = Engine(CROWD, 4), Engine(replace(CROWD, observation_noise=0.1), 4)
    blind = Engine(replace(CROWD, observation_dropout=1.0), 4)
    runs = [run(engine, 5) for engine in (plain, noisy, blind)]
    for engine in (noisy, blind):
        np.testing.assert_array_equal(engine.state().x, plain.state().x)
        np.testing.assert_array_equal(engine.state().generator, plain.state().generator)
    np.testing.assert_array_equal(plain.state().noise_generator[:, 4:], 0)
    last, noised, blinded = (steps[-1].obs for steps in runs)
    np.testing.assert_array_equal(last[:, 0], noised[:, 0])
    assert not blinded[:, 1:].any()
    shifted = np.abs(noised[:, 1:, 1:] - last[:, 1:, 1:])
    assert 0.01 < shifted[shifted > 0].mean() < 0.2


def test_a_policy_of_collisions_is_kept():
    ghosts = Engine(replace(CROWD, collisions="none"), 8)
    for out in run(ghosts, 20):
        assert not out.terminated.any()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("lanes_count", 0),
        ("lanes_count", 2.5),
        ("vehicles_count", -1),
        ("vehicles_density", -1.0),
        ("vehicles_density", float("nan")),
        ("target_speeds", ()),
        ("target_speeds", (20.0,)),
        ("target_speeds", (30.0, 20.0)),
        ("simulation_frequency", 16 - 1 + 0.5),
        ("policy_frequency", 16),
        ("initial_lane_id", 4),
        ("duration", 0),
        ("features", ("speed",)),
        ("features", ()),
        ("order", "nearest"),
        ("collisions", True),
        ("see_behind", 1),
        ("observation_dropout", 1.5),
        ("reward_speed_range", (30, 30)),
        ("features_range", {"x": (1, 1)}),
        ("delta_range", (4.5, 3.5)),
    ],
)
def test_an_impossible_config_is_named(field, value):
    with pytest.raises(ValueError, match=field):
        Config(**{field: value})


@pytest.mark.parametrize(
    "actions", [[0], [0, 5], [0, -1], [0.0, 1.0], [True, False], [[0, 1]], ["a", "b"]]
)
def test_wrong_actions_are_named(actions):
    engine = Engine(CROWD, 2)
    engine.reset([0, 1])
    with pytest.raises(ValueError, match="actions"):
        engine.step(actions)


def test_wrong_calls_are_named():
    engine = Engine(CROWD, 2)
    with pytest.raises(ValueError, match="reset"):
        engine.step([0, 0])
    with pytest.raises(ValueError, match="seeds"):
        engine.reset([1])
    with pytest.raises(ValueError, match="seeds must not be negative, got -1"):
        engine.reset([1, -1])
    with pytest.raises(ValueError, match="mask"):
        engine.reset(mask=[0, 1])
    engine.reset([0, 1])
    state = engine.state()
    for name, value in {"lane": 9, "x": np.nan, "speed_index": -1}.items():
        wrong = getattr(state, name).copy()
        wrong.flat[0] = value
        with pytest.raises(ValueError, match=f"state.{name}"):
            engine.set_state(replace(state, **{name: wrong}))
    for name, value in {"n_envs": 0, "threads": 0.5, "path": "quick"}.items():
        with pytest.raises(ValueError, match=name):
            Engine(CROWD, **{"n_envs": 1, name: value})


def test_memory_per_environment():
    small, large = Engine(PAPER, 1), Engine(PAPER, 1001)
    total = [sum(a.nbytes for a in engine._memory) for engine in (small, large)]
    assert (total[1] - total[0]) / 1000 < 64 * 1024


if __name__ == "__main__":
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    crashed = 0
    for number in range(first, first + int(sys.argv[1])):
        crashed += drive(*drawn(number)[:1], number, drawn(number)[1], 0.0, resets=2)
    sys.stdout.write(f"equal bits in {sys.argv[1]} settings, {crashed} crashed episodes\n")
