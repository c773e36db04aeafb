"""The learner: time a decision with its update, beside Stable-Baselines3, and where it goes."""

import itertools
from collections.abc import Iterator

import numpy as np

from cpl.highway import PAPER, Engine
from cpl.policies.dqn import DQNConfig, train
from cpl.policies.dqn.compiled import Learner
from cpl.policies.dqn.initial import initial_network
from cpl.policies.dqn.task import Task
from cpl.policies.dqn.tiles import address, multiply
from cpl.policies.dqn.update import GRADIENT, _adam, _clip, _forward, layout
from tests.bench.frame import Row, compare, fastest

PACKAGES = ("stable-baselines3", "torch")

COMPILED, REFERENCE = "cpl compiled", "Stable-Baselines3"
STEPS = {COMPILED: 800, REFERENCE: 200}  # decisions a round
CONFIG = DQNConfig(learning_starts=1)  # an update with every decision but the first
BATCH, WIDE, INPUTS, ACTIONS = CONFIG.batch_size, CONFIG.hidden[0], 25, 5
TIMES = 50  # calls a round of a part


def measure() -> Iterator[Row]:
    """Measure whole decisions, then their parts, then the matrix product beside BLAS."""
    yield from decisions()
    yield from parts()
    yield from products()


def decisions() -> Iterator[Row]:
    """One update a decision, 50 cars, two layers of 256, one core."""
    rounds = {
        COMPILED: lambda: train(_short(COMPILED), PAPER, seed=0),
        REFERENCE: lambda: train(_short(REFERENCE), PAPER, seed=0, learner="sb3"),
    }
    yield from compare(
        "learner: a decision with its update",
        fastest(rounds, rounds=5),
        per={name: float(steps) for name, steps in STEPS.items()},
        unit="us/decision",
        scale=1e6,
        peer=REFERENCE,
        limits={COMPILED: 400.0},
    )


def parts() -> Iterator[Row]:
    """What a decision of the compiled learner consists of, one part after the other."""
    rng = np.random.default_rng(0)
    learner = Learner(initial_network((INPUTS, *CONFIG.hidden, ACTIONS), 0), CONFIG)
    replay = rng.standard_normal((CONFIG.buffer_size, 2 * INPUTS + 3)).astype(np.float32)
    replay[:, 2 * INPUTS], replay[:, 2 * INPUTS + 2] = rng.integers(ACTIONS, size=len(replay)), 0
    index = itertools.cycle(rng.integers(len(replay), size=(100, BATCH)))
    draws, task, engine = np.random.RandomState(0), Task((PAPER,), None, 0), Engine(PAPER, 1)
    obs = task.reset()
    engine.reset([0])
    place = layout((INPUTS, *CONFIG.hidden, ACTIONS), BATCH)
    memory = learner._memory.copy()
    acts = rng.random(place.activations, dtype=np.float32)
    one = np.float32(1)

    def drive() -> None:
        out = task.step(4)
        if out.terminated or out.truncated:
            task.reset()

    calls = {
        "update, all of it": lambda: learner.learn(replay, next(index)),
        "update: a forward pass": lambda: _forward(memory[0], place.table, acts, BATCH),
        "update: the gradient's norm": lambda: _clip(memory[GRADIENT], one),
        "update: Adam": lambda: _adam(memory, one, np.float32(1e-5), one),
        "the best action": lambda: learner.best(obs),
        "the mini-batch's numbers": lambda: draws.randint(0, len(replay), size=BATCH),
        "the road": drive,
        "the road: the engine's own share": lambda: engine.step([4]),
    }
    rounds = {
        name: lambda call=call: [call() for _ in range(TIMES)] for name, call in calls.items()
    }
    for name, taken in fastest(rounds, rounds=15).items():
        yield Row(
            bench="learner: parts of a decision",
            subject=name,
            value=1e6 * taken / TIMES,
            unit="us",
        )


def products() -> Iterator[Row]:
    """The largest product of an update: 256 x 256 by 256 x 32."""
    rng = np.random.default_rng(0)
    w, x = (rng.standard_normal((WIDE, n)).astype(np.float32) for n in (WIDE, BATCH))
    ours, theirs = (np.zeros((WIDE, BATCH), np.float32) for _ in range(2))
    zeros = np.zeros(WIDE, np.float32)
    a, b, c, start = (address(m.ravel(), 0) for m in (w, x, ours, zeros))

    def tiles() -> None:
        for _ in range(TIMES):
            multiply(a, WIDE, 1, b, BATCH, c, start, WIDE, BATCH, WIDE)

    def blas() -> None:
        for _ in range(TIMES):
            np.dot(w, x, out=theirs)

    seconds = fastest({"cpl tiles": tiles, "numpy (OpenBLAS)": blas}, rounds=15)
    assert np.allclose(ours, theirs, atol=1e-3)
    yield from compare(
        "learner: a product of 256 x 256 by 256 x 32",
        seconds,
        per=TIMES,
        unit="us",
        scale=1e6,
        peer="numpy (OpenBLAS)",
    )


def _short(name: str) -> DQNConfig:
    return DQNConfig(steps=STEPS[name], learning_starts=1)
