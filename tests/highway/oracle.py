"""What is compared between highway-env and the engine, and the plan of the golden fixtures.

A *group* is one configuration; its *sessions* are environments that differ in their seed and
actions; a session is one seeded episode followed by unseeded ones in the same environment. Each
reset and each step is a *row*: three digests, one of everything discrete, one of the floats of the
state and one of what `step` returns, plus the ego's position, speed and the reward in the clear,
for comparisons at a tolerance and for finding where two runs part.

Nothing here knows the engine: rows are made from plain arrays.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cpl.highway.reference import CAR_FIELDS, read_state, reference_env, write_state

LIBM_FLAGS = "X86_V4 AVX512_ICL AVX512_SPR"
"""Value of NPY_DISABLE_CPU_FEATURES with which numpy's float64 maths is libm's."""

RANGES = ((20, 30), (20, 40), (20, 50))
IDLE, FASTER, NO_ACTION = 1, 3, 255
DISCRETE = ("lane", "target_lane", "crashed", "has_impact", "speed_index", "steps")
FLOATS = (
    *("x", "y", "heading", "speed", "target_speed", "timer", "delta"),
    *("impact_x", "impact_y", "time"),
)
COLUMNS = {
    "action": np.uint8,
    "discrete": np.uint64,
    "floats": np.uint64,
    "output": np.uint64,
    "ended": np.uint8,  # 1 terminated, 2 truncated
    "ego_x": np.float64,
    "ego_speed": np.float64,
    "reward": np.float64,
}


@dataclass(kw_only=True)
class Group:
    """One configuration, its sessions' seeds and kinds of actions, and its episodes' lengths."""

    options: dict[str, Any]
    fast: bool = False
    seeds: list[int] = field(default_factory=list)
    actions: list[str] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)


def digest(arrays) -> int:
    """Eight bytes of the bits of some arrays; a negative zero counts as zero."""
    hasher = hashlib.blake2b(digest_size=8)
    for array in arrays:
        kind = np.float64 if array.dtype.kind == "f" else np.int64
        plain = np.ascontiguousarray(array, dtype=kind)
        hasher.update((plain + 0.0).tobytes() if kind is np.float64 else plain.tobytes())
    return int.from_bytes(hasher.digest(), "little")


def make_row(action, state, obs, reward, terminated, truncated) -> tuple:
    """One row of `COLUMNS`, from a state as `read_state` gives it and from what `step` returns."""
    flags = np.array([terminated, truncated])
    return (
        action,
        digest([*(state[name] for name in DISCRETE), flags]),
        digest([state[name] for name in FLOATS]),
        digest([np.asarray(obs, np.float32), np.array([reward], np.float64)]),
        int(terminated) + 2 * int(truncated),
        float(state["x"][0]),
        float(state["speed"][0]),
        float(reward),
    )


def make_table(rows) -> dict[str, np.ndarray]:
    """Rows as columns."""
    columns = zip(*rows, strict=True)
    return {
        name: np.array(list(values), dtype=kind)
        for (name, kind), values in zip(COLUMNS.items(), columns, strict=True)
    }


def draw_actions(kind: str, seed: int, length: int) -> np.ndarray:
    """The documented stream of a session's actions: PCG64 seeded with [seed, 2023]."""
    rng = np.random.default_rng([seed, 2023])
    choices = {
        "random": [0, 1, 2, 3, 4],
        "idle": [IDLE],
        "faster": [FASTER],
        "weave": [0, 2, 0, 2, FASTER],
        "hasty": [0, 2, FASTER, FASTER, FASTER, IDLE],
        "slow": [4, 4, IDLE, 0, 2],
    }[kind]
    return np.array(choices, dtype=np.uint8)[rng.integers(len(choices), size=length)]


def run_session(env, seed: int, actions, lengths):
    """Drive highway-env through a session; yields rows and never stops at a crash."""
    start = 0
    for number, length in enumerate(lengths):
        obs, _ = env.reset(seed=seed if number == 0 else None)
        yield make_row(NO_ACTION, read_state(env), obs, 0.0, False, False)
        for action in actions[start : start + length]:
            obs, reward, terminated, truncated, _ = env.step(int(action))
            yield make_row(action, read_state(env), obs, reward, terminated, truncated)
        start += length


def run_group(group: Group):
    """All rows of a group in the order of its sessions."""
    env = reference_env(group.options, fast=group.fast)
    for seed, kind in zip(group.seeds, group.actions, strict=True):
        actions = draw_actions(kind, seed, sum(group.lengths))
        yield from run_session(env, seed, actions, group.lengths)


def draw_group(rng, *, vehicles, lengths, sessions=3, **fixed) -> Group:
    """Draw a configuration of highway-env; `fixed` overrides what is drawn."""

    def pick(*values):
        return values[rng.integers(len(values))]

    low, high = pick(*RANGES)
    lanes = pick(2, 3, 4, 5)
    frequency = pick((15, 1), (15, 1), (10, 2), (16, 2), (15, 3), (5, 1))
    observation: dict[str, Any] = {
        "type": "Kinematics",
        "vehicles_count": pick(5, 5, 6, 10, 2),
        "see_behind": pick(True, False),
    }
    odd = fixed.pop("odd_observation", False)
    speeds = np.linspace(low, high, pick(3, 3, 3, 5, 11)).tolist()
    options = {
        "vehicles_count": int(rng.integers(vehicles[0], vehicles[1] + 1)),
        "lanes_count": lanes,
        "vehicles_density": pick(0.5, 0.75, 1.0, 1.3, 1.6, 2.0),
        "duration": pick(4, 8, 15, 40),
        "simulation_frequency": frequency[0],
        "policy_frequency": frequency[1],
        "ego_spacing": pick(2, 2, 1.5, 1, 3),
        "initial_lane_id": pick(None, None, None, 0, lanes - 1),
        "collision_reward": pick(-1, -1, -5.5),
        "right_lane_reward": pick(0, 0.1),
        "high_speed_reward": pick(0.4, 0.5),
        "reward_speed_range": pick([20, 30], [low, high]),
        "normalize_reward": pick(True, False),
        "offroad_terminal": pick(False, False, True),
        "observation": observation,
        "action": {"type": "DiscreteMetaAction", "target_speeds": speeds},
    }
    fast = fixed.pop("fast", False)
    if odd:
        observation |= _draw_observation(rng)
    kinds = ["random", "idle", "faster", "weave", "hasty", "slow"]
    return Group(
        options=options | fixed,
        fast=fast,
        seeds=[int(s) for s in rng.integers(2**31, size=sessions)],
        actions=[pick(*kinds) for _ in range(sessions)],
        lengths=[int(n) for n in rng.permutation(lengths)],
    )


def _draw_observation(rng) -> dict[str, Any]:
    """Observations that no default asks for."""
    features = np.array(
        [
            *("presence", "x", "y", "vx", "vy", "heading", "cos_h", "sin_h", "cos_d", "sin_d"),
            *("long_off", "lat_off", "ang_off"),
        ]
    )
    ranges = {"x": [-100, 80], "y": [-9, 12], "vx": [-20.5, 20], "vy": [-3, 3], "heading": [-1, 1]}
    return {
        "features": rng.permutation(features)[: rng.integers(1, 14)].tolist(),
        "features_range": ranges if rng.random() < 0.4 else None,
        "absolute": bool(rng.random() < 0.4),
        "normalize": bool(rng.random() < 0.6),
        "clip": bool(rng.random() < 0.5),
        "order": "shuffled" if rng.random() < 0.4 else "sorted",
    }


def plan_stage(stage: str) -> list[Group]:
    """The groups of a stage of the golden fixtures."""
    rng = np.random.default_rng([3, *stage.encode()])
    paper = {"lanes_count": 4, "simulation_frequency": 15, "policy_frequency": 1}
    plans = {
        "small": (146, {"vehicles": (5, 12), "lengths": [10, 16]}),
        "medium": (14, {"vehicles": (13, 35), "lengths": [8, 14]}),
        "long": (14, {"vehicles": (5, 10), "lengths": [40], "sessions": 4}),
        "fast": (10, {"vehicles": (5, 20), "lengths": [8, 8], "fast": True}),
        "large": (8, {"vehicles": (40, 60), "lengths": [12]}),
        "paper": (8, {"vehicles": (50, 50), "lengths": [16], **paper}),
        "options": (40, {"vehicles": (5, 9), "lengths": [6, 6], "odd_observation": True}),
    }
    count, drawn = plans[stage]
    return [draw_group(rng, **drawn) for _ in range(count)]


STAGES = ("small", "long", "fast", "medium", "paper", "large", "options")


# Injected states: what natural traffic never does.

INJECTED = {"injected": range(40), "crowded": range(40, 48)}
INJECTED_CASES = 60


def plan_injected(number: int):
    """Group `number` of the injected states, with few cars below 40 and many from there on.

    Returns:
        The options, an array of actions (cases, steps), and the states as a dictionary of arrays
        (cases, cars), floats rounded to float32 so that a fixture keeps them exactly and small.
    """
    rng = np.random.default_rng([4, number])
    frame_by_frame = number % 2 == 0
    group = draw_group(
        rng,
        vehicles=(1, 7) if number < 40 else (8, 20),
        lengths=[1],
        lanes_count=int(rng.integers(1, 6)),
        simulation_frequency=15,
        policy_frequency=15 if frame_by_frame else 1,
        initial_lane_id=None,
    )
    options, cases = group.options, INJECTED_CASES
    actions = rng.integers(5, size=(cases, 5 if frame_by_frame else 2)).astype(np.uint8)
    states = [_draw_state(rng, options, number + case) for case in range(cases)]
    return options, actions, {name: np.stack([s[name] for s in states]) for name in states[0]}


def run_injected(options, actions, states):
    """Rows of highway-env for injected states, one for each step, in the order of the cases."""
    env = reference_env(options)
    for case, stream in enumerate(actions):
        env.reset(seed=case)
        write_state(env, {name: values[case] for name, values in states.items()})
        for action in stream:
            obs, reward, terminated, truncated, _ = env.step(int(action))
            yield make_row(action, read_state(env), obs, reward, terminated, truncated)


def closest_lanes(options, states) -> np.ndarray:
    """The present lane that highway-env finds for each injected car, int64 (cases, cars)."""
    env = reference_env(options)
    lanes = []
    for case in range(len(states["x"])):
        write_state(env, {name: values[case] for name, values in states.items()})
        lanes.append(read_state(env)["lane"])
    return np.array(lanes)


def _draw_state(rng, options, kind: int) -> dict[str, np.ndarray]:
    lanes, cars = options["lanes_count"], options["vehicles_count"] + 1
    speeds = options["action"]["target_speeds"]
    state = _draw_traffic(rng, lanes, cars)
    for strange in _STRANGE[kind % len(_STRANGE)]:
        strange(rng, state, lanes)
    index = int(rng.integers(len(speeds)))
    single = {n: v.astype(np.float32).astype(np.float64) for n, v in state.items() if n in FLOATS}
    state |= single
    state["target_speed"][0] = speeds[index]
    state["timer"][0] = state["delta"][0] = 0.0
    for axis in ("impact_x", "impact_y"):
        state[axis][~state["has_impact"]] = 0.0
    state = {name: state[name].astype(kind) for name, kind in CAR_FIELDS.items()}
    return state | {
        "speed_index": np.array(index),
        "time": np.array(float(rng.integers(3))),
        "steps": np.array(0),
    }


def _draw_traffic(rng, lanes, cars) -> dict[str, np.ndarray]:
    lane = rng.integers(lanes, size=cars)
    near = np.clip(lane + rng.integers(-1, 2, size=cars), 0, lanes - 1)
    return {
        "x": 100 + 12.0 * rng.permutation(cars) + rng.random(cars),
        "y": 4.0 * lane,
        "heading": np.where(rng.random(cars) < 0.5, 0.0, 0.1 * (rng.random(cars) - 0.5)),
        "speed": 15 + 20 * rng.random(cars),
        "target_speed": 15 + 20 * rng.random(cars),
        "lane": lane,
        "target_lane": np.where(rng.random(cars) < 0.6, lane, near),
        "timer": 1.2 * rng.random(cars),
        "delta": 3.5 + rng.random(cars),
        "crashed": np.zeros(cars, bool),
        "has_impact": np.zeros(cars, bool),
        "impact_x": rng.random(cars) - 0.5,
        "impact_y": rng.random(cars) - 0.5,
    }


def _tie(rng, state, lanes) -> None:
    """Same places, or edges of lanes where a comparison just holds or just fails."""
    cars = len(state["x"])
    state["x"] = 100.0 + rng.choice([0.0, 0.0, 5.0, 10.0, 12.0, 30.0], size=cars)
    state["y"] = 4.0 * rng.integers(lanes, size=cars) + rng.choice(
        [0.0, 0.0, 1.0, 2.0, -2.0, 3.0, -3.0, 4.0], size=cars
    )


def _crowd(rng, state, lanes) -> None:
    state["x"] = 500.0 + 9 * rng.random(len(state["x"]))
    state["y"] = 4.0 * lanes * rng.random(len(state["x"])) - 2.0


def _turn(rng, state, lanes) -> None:
    del lanes
    cars = len(state["heading"])
    right = np.array([np.pi, -np.pi, np.pi / 2, -np.pi / 2, 0.0, np.pi / 4, 3.2, -7.0])
    anything = 2 * np.pi * rng.random(cars) - np.pi
    state["heading"] = np.where(rng.random(cars) < 0.5, rng.choice(right, size=cars), anything)


def _rush(rng, state, lanes) -> None:
    del lanes
    cars = len(state["speed"])
    edges = [0.0, 0.005, -0.005, 0.01, -0.01, 0.5, -0.99, 1.0, -1.0, 40.0, -40.0, 40.5, 30.0]
    anything = 110 * rng.random(cars) - 50
    state["speed"] = np.where(rng.random(cars) < 0.5, rng.choice(edges, size=cars), anything)
    aims = [0.0, 0.005, -3.0, 20.0, 30.0, 30.5, 45.0]
    state["target_speed"] = rng.choice(aims, size=cars)


def _leave(rng, state, lanes) -> None:
    cars = len(state["y"])
    out = rng.choice([-40.0, -10.0, -6.0, -3.0, 3.0, 6.0, 10.0, 40.0], size=cars)
    state["y"] = np.where(rng.random(cars) < 0.6, out + 4.0 * (lanes - 1) * (out > 0), state["y"])


def _ends(rng, state, lanes) -> None:
    del lanes
    cars = len(state["x"])
    place = rng.choice([-5.0, 0.0, 9997.5, 10000.0, 10005.0])
    state["x"] = place + rng.choice([-20.0, -1.0, 0.0, 0.0, 0.5, 5.0, 9.0], size=cars)


def _wreck(rng, state, lanes) -> None:
    del lanes
    cars = len(state["crashed"])
    state["crashed"] = rng.random(cars) < 0.5
    state["has_impact"] = rng.random(cars) < 0.5


def _decide(rng, state, lanes) -> None:
    cars = len(state["timer"])
    frame = 1 / 15
    moments = [1.0, 1.0 - frame, 1.0 + frame, 1.01, 5.0, 0.0, 1.0 - 4 * frame]
    state["timer"] = rng.choice(moments, size=cars)
    state["target_lane"] = rng.integers(lanes, size=cars)


_STRANGE = (
    (_tie,),
    (_turn,),
    (_rush,),
    (_leave,),
    (_ends,),
    (_wreck,),
    (_decide,),
    (_crowd,),
    (_tie, _decide),
    (_tie, _rush),
    (_crowd, _turn),
    (_leave, _turn),
    (_ends, _tie),
    (_crowd, _wreck, _decide),
    (_rush, _turn, _decide),
    (_crowd, _rush),
    (_tie, _turn, _rush, _wreck),
    (_leave, _rush, _wreck, _decide),
    (_ends, _turn, _rush, _decide),
)
