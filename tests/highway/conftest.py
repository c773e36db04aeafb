"""The oracle module, and the engine's runs told in its rows."""

import importlib.util
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from cpl.highway import Engine, State
from cpl.highway.options import make_config
from cpl.highway.reference import CAR_FIELDS, EGO_FIELDS

HERE = Path(__file__).resolve().parent


def _load_oracle():
    spec = importlib.util.spec_from_file_location("highway_oracle", HERE / "oracle.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def oracle():
    """tests/highway/oracle.py, which the script that makes the fixtures uses too."""
    return _load_oracle()


class EngineRuns:
    """Drives the engine and tells it in the oracle's rows and states."""

    def __init__(self, oracle):
        self.oracle = oracle

    @staticmethod
    def config(options, fast=False):
        """highway-env's nested dictionary as the engine's configuration."""
        return make_config(**options, collisions="ego" if fast else "all")[0]

    @staticmethod
    def states(engine):
        """The states of a batch as the oracle's dictionaries, the ego's unused fields 0."""
        state = engine.state()
        arrays = {name: getattr(state, name).copy() for name in (*CAR_FIELDS, *EGO_FIELDS)}
        arrays["timer"][:, 0] = arrays["delta"][:, 0] = 0.0
        for axis in ("impact_x", "impact_y"):
            arrays[axis][~arrays["has_impact"]] = 0.0
        return [{name: array[e] for name, array in arrays.items()} for e in range(engine.n_envs)]

    @staticmethod
    def inject(engine, states):
        """Put the oracle's states, arrays (cases, cars), into a batch that was reset."""
        present = engine.state()
        parts = {field.name: getattr(present, field.name) for field in fields(State)}
        for name, values in states.items():
            parts[name] = np.array(values).astype(parts[name].dtype)
        engine.set_state(State(**parts))

    def step(self, engine, actions):
        """One step: the outcome, and a row for each environment."""
        out = engine.step(actions)
        rows = [
            self.oracle.make_row(int(a), state, out.obs[e], out.reward[e], end, cut)
            for e, (a, state, end, cut) in enumerate(
                zip(actions, self.states(engine), out.terminated, out.truncated, strict=True)
            )
        ]
        return out, rows

    def sessions(self, group, actions, path=None):
        """All sessions of a group at once; rows in the oracle's order (session, row)."""
        config = self.config(group["options"], group["fast"])
        engine = Engine(config, len(group["seeds"]), path=path)
        table, start = [[] for _ in group["seeds"]], 0
        for number, length in enumerate(group["lengths"]):
            obs = engine.reset(np.array(group["seeds"]) if number == 0 else None)
            for e, state in enumerate(self.states(engine)):
                none = self.oracle.NO_ACTION
                row = self.oracle.make_row(none, state, obs[e], 0.0, False, False)
                table[e].append(row)
            for t in range(start, start + length):
                for e, row in enumerate(self.step(engine, actions[:, t])[1]):
                    table[e].append(row)
            start += length
        return [row for rows in table for row in rows]

    def injected(self, options, actions, states, path=None):
        """Steps from injected states; rows in the oracle's order (case, step)."""
        engine = Engine(self.config(options), len(actions), path=path)
        engine.reset(np.zeros(len(actions), dtype=np.int64))
        self.inject(engine, states)
        steps = [self.step(engine, column)[1] for column in actions.T]
        return [steps[t][case] for case in range(len(actions)) for t in range(len(steps))]


@pytest.fixture(scope="session")
def engine_runs(oracle):
    """The engine told in the oracle's rows."""
    return EngineRuns(oracle)
