"""The engine against the golden fixtures: every digest of every step of highway-env, bit for bit.

The engine's arithmetic is libm's and so is the fixtures', which `make_fixtures.py` made with
numpy's own kernels switched off. No tolerance: positions, speeds, timers, pushes, observations and
rewards agree to the last bit, in ordinary traffic, through crashes and from states nobody drives.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FIXTURES = Path(__file__).resolve().parent / "fixtures"
STAGES = ("small", "long", "fast", "medium", "paper", "large", "options")
INJECTED = ("injected", "crowded")
DIGESTS = ("discrete", "floats", "output")


def load(stage):
    with np.load(FIXTURES / f"{stage}.npz", allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    return arrays, json.loads((FIXTURES / f"{stage}.json").read_text())


def compare(oracle, rows, arrays, first, what):
    """Rows of the engine against a stretch of a fixture; says where the first difference is."""
    table = oracle.make_table(rows)
    for name in ("action", "ended", *DIGESTS):
        expected = arrays[name][first : first + len(rows)]
        different = np.flatnonzero(table[name] != expected)
        assert not len(different), f"{what}: {len(different)} differ in {name}: {different[:8]}"
    for name in ("ego_x", "ego_speed", "reward"):
        np.testing.assert_array_equal(table[name], arrays[name][first : first + len(rows)], what)


@pytest.fixture(params=("fast", "portable"))
def path(request):
    """Both of the engine's arithmetics, whichever it would choose here."""
    return request.param


@pytest.mark.parametrize("stage", STAGES)
def test_episodes_are_highway_envs_bit_for_bit(stage, path, oracle, engine_runs):
    arrays, manifest = load(stage)
    first = 0
    for number, group in enumerate(manifest["groups"]):
        sessions, steps = len(group["seeds"]), sum(group["lengths"])
        rows = sessions * (steps + len(group["lengths"]))
        taken = arrays["action"][first : first + rows].reshape(sessions, -1)
        actions = taken[taken != oracle.NO_ACTION].reshape(sessions, steps)
        played = engine_runs.sessions(group, actions, path)
        compare(oracle, played, arrays, first, f"{stage} {number}")
        first += rows
    assert first == len(arrays["action"])


@pytest.mark.parametrize("stage", INJECTED)
def test_injected_states_go_on_as_in_highway_env(stage, path, oracle, engine_runs):
    arrays, manifest = load(stage)
    first = cars_before = cases_before = 0
    for number, group in enumerate(manifest["groups"]):
        cases, steps = group["cases"], group["steps"]
        cars = group["options"]["vehicles_count"] + 1
        states = {}
        for name in (name for name in arrays if name.startswith("state_")):
            once = len(arrays[name]) != len(arrays["state_x"])
            start, shape = (cases_before, (cases,)) if once else (cars_before, (cases, cars))
            values = arrays[name][start : start + int(np.prod(shape))]
            states[name.removeprefix("state_")] = values.reshape(shape)
        actions = arrays["action"][first : first + cases * steps].reshape(cases, steps)
        rows = engine_runs.injected(group["options"], actions, states, path)
        compare(oracle, rows, arrays, first, f"{stage} {number}")
        first += cases * steps
        cars_before += cases * cars
        cases_before += cases
    assert first == len(arrays["action"])


def test_fixtures_are_as_many_and_as_varied_as_promised():
    episodes, seen = 0, {}
    for stage in STAGES:
        manifest = load(stage)[1]
        assert manifest["versions"]["highway-env"] == "1.12.1"
        for group in manifest["groups"]:
            options = group["options"]
            episodes += len(group["seeds"]) * len(group["lengths"])
            speeds = options["action"]["target_speeds"]
            for name in ("lanes_count", "vehicles_density", "policy_frequency", "vehicles_count"):
                seen.setdefault(name, set()).add(options[name])
            seen.setdefault("range", set()).add((speeds[0], speeds[-1]))
            seen.setdefault("behind", set()).add(options["observation"]["see_behind"])
            seen.setdefault("normalised", set()).add(options["normalize_reward"])
            seen.setdefault("actions", set()).update(group["actions"])
    assert episodes >= 1000
    assert seen["range"] == {(20, 30), (20, 40), (20, 50)}
    assert seen["lanes_count"] == {2, 3, 4, 5}
    assert {1, 2} <= seen["policy_frequency"]
    assert min(seen["vehicles_density"]) == 0.5
    assert max(seen["vehicles_density"]) == 2.0
    assert min(seen["vehicles_count"]) == 5
    assert max(seen["vehicles_count"]) == 60
    assert {"random", "idle", "faster", "weave"} <= seen["actions"]
    assert seen["behind"] == seen["normalised"] == {True, False}
    assert sum(group["cases"] for stage in INJECTED for group in load(stage)[1]["groups"]) >= 2000


def test_fixtures_are_small():
    assert sum(path.stat().st_size for path in FIXTURES.iterdir()) <= 2_000_000


def test_some_episodes_ran_on_past_a_crash():
    arrays, _ = load("long")
    crashed = arrays["ended"] & 1
    assert (crashed[1:] & crashed[:-1]).sum() > 100


@pytest.mark.oracle
def test_fixtures_can_be_made_again(tmp_path):
    script = str(FIXTURES.parent / "make_fixtures.py")
    subprocess.run([sys.executable, script, "--out", tmp_path, "--stages", "fast"], check=True)
    arrays, manifest = load("fast")
    assert json.loads((tmp_path / "fast.json").read_text())["groups"] == manifest["groups"]
    with np.load(tmp_path / "fast.npz", allow_pickle=False) as again:
        assert sorted(again.files) == sorted(arrays)
        for name, values in arrays.items():
            np.testing.assert_array_equal(again[name], values, name)
