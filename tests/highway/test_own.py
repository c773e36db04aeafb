"""The engine's own arithmetic against highway-env: every decision the same, last bits counted."""

import numpy as np
import pytest

from cpl.wasm import AGREEMENT
from tests.highway.test_fixtures import DIGESTS, INJECTED, STAGES, load


def test_every_decision_is_highway_envs_and_last_bits_are_counted(oracle, engine_runs):
    total = dict.fromkeys(("rows", *DIGESTS, "action", "ended"), 0)
    farthest = 0.0
    for arrays, first, rows in _played(oracle, engine_runs):
        table, stop = oracle.make_table(rows), first + len(rows)
        total["rows"] += len(rows)
        for name in (*DIGESTS, "action", "ended"):
            total[name] += int((table[name] != arrays[name][first:stop]).sum())
        farthest = max(farthest, float(np.abs(table["ego_x"] - arrays["ego_x"][first:stop]).max()))
    # Floats differ where libm rounds a number that lies halfway, to a few hundredths of an ulp, the
    # other way. That is carried on: one such bit marks the rest of its episode.
    assert total == {**AGREEMENT, "action": 0, "ended": 0}
    assert total["discrete"] == 0
    assert farthest < 1e-12  # [m]


def test_the_path_is_chosen_by_name_only():
    from cpl.highway import PAPER, Engine

    assert Engine(PAPER, 1, path="own").path == "own"
    assert Engine(PAPER, 1).path != "own"
    with pytest.raises(ValueError, match="path must be one of"):
        Engine(PAPER, 1, path="other")


def _played(oracle, engine_runs):
    """Every group of every stage: the fixture, where the group begins in it, and our rows."""
    for stage in STAGES:
        arrays, manifest = load(stage)
        first = 0
        for group in manifest["groups"]:
            sessions, steps = len(group["seeds"]), sum(group["lengths"])
            rows = sessions * (steps + len(group["lengths"]))
            taken = arrays["action"][first : first + rows].reshape(sessions, -1)
            actions = taken[taken != oracle.NO_ACTION].reshape(sessions, steps)
            yield arrays, first, engine_runs.sessions(group, actions, "own")
            first += rows
    for stage in INJECTED:
        arrays, manifest = load(stage)
        first = cars_before = cases_before = 0
        for group in manifest["groups"]:
            cases, steps = group["cases"], group["steps"]
            cars = group["options"]["vehicles_count"] + 1
            states = {}
            for name in (name for name in arrays if name.startswith("state_")):
                once = len(arrays[name]) != len(arrays["state_x"])
                start, shape = (cases_before, (cases,)) if once else (cars_before, (cases, cars))
                values = arrays[name][start : start + int(np.prod(shape))]
                states[name.removeprefix("state_")] = values.reshape(shape)
            actions = arrays["action"][first : first + cases * steps].reshape(cases, steps)
            yield arrays, first, engine_runs.injected(group["options"], actions, states, "own")
            first += cases * steps
            cars_before += cases * cars
            cases_before += cases
