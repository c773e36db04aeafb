"""Inference beside the road: what a switching policy computes between two steps of a batch."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from cpl.conformal import BatchTracker, RunningMax
from cpl.forecast.history import History
from cpl.forecast.methods import Certificates, Dropout, Ensemble, Forecaster, Heteroscedastic, Plain
from cpl.highway import PAPER, Engine, nearest_distances
from cpl.highway.proximity import proximity
from cpl.network import MLP
from cpl.policies.greedy import Greedy
from tests.bench.frame import Row, fastest

BATCH = 256
STEP = "one step of the road"
PREDICTOR = (125, 64, 128, 64)


def measure() -> Iterator[Row]:
    """Measure everything that a switching policy computes between two steps, for each method."""
    rng = np.random.default_rng(0)
    engine = Engine(PAPER, BATCH)
    obs = engine.reset(np.arange(BATCH))
    actions = rng.integers(0, 5, (400, BATCH))
    for row in actions[:8]:
        obs = engine.step(row).obs
    drivers = [Greedy(network(rng, (25, 256, 256, 5))) for _ in range(2)]
    turn = iter(np.tile(actions, (10, 1)))

    def step() -> None:
        out = engine.step(next(turn))
        ended = out.terminated | out.truncated
        if ended.any():
            engine.reset(mask=ended)

    def inference(make: Forecaster, tracked: bool):
        history = History(BATCH)
        trackers = BatchTracker(RunningMax(c=0.1), BATCH, alpha=0.1, delay=3)

        def run() -> None:
            for drive in drivers:
                drive(obs)
            history.push(obs)
            l_hat, _ = make(history.flat)
            l_tilde = proximity(nearest_distances(engine))
            if tracked:
                trackers.update(np.abs(l_tilde - l_hat))

        return run

    plain = network(rng, (*PREDICTOR, 1), "sigmoid")
    weight = rng.normal(size=(128, 100)).astype(np.float32)
    methods: dict[str, Forecaster] = {
        "conformal": Plain(plain),
        "none": Plain(plain),
        "dropout": Dropout(plain, rng),
        "ensemble": Ensemble([plain] * 5),
        "hau": Heteroscedastic(network(rng, (*PREDICTOR, 2))),
        "certificates": Certificates(plain, weight, np.zeros(100, np.float32)),
    }
    rounds = {name: inference(make, name == "conformal") for name, make in methods.items()}
    taken = fastest({STEP: step, **rounds}, rounds=60)
    for name, seconds in taken.items():
        alone = name == STEP
        yield Row(
            bench=f"inference: two policies, forecast and tracker, {BATCH} roads",
            subject=name,
            value=1e6 * seconds / BATCH,
            unit="us/road",
            peer="" if alone else STEP,
            ratio=None if alone else taken[STEP] / seconds,
            limit=1e6 * taken[STEP] / BATCH if name == "conformal" else None,
        )


def network(rng: np.random.Generator, sizes: tuple[int, ...], output="linear") -> MLP:
    """Return a network of random weights: time does not depend on them."""
    pairs = list(pairwise(sizes))
    weights = tuple(rng.normal(size=pair).astype(np.float32) / 10 for pair in pairs)
    return MLP(weights, tuple(np.zeros(n, np.float32) for _, n in pairs), output)
