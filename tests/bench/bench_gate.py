"""The gate: what looking ahead and tracking cost beside a step of the road, same run, one core."""

from collections.abc import Callable, Iterator

import numpy as np

from cpl.conformal import Fixed
from cpl.highway import PAPER, Engine
from cpl.policies.gate import Gate, Tracked
from tests.bench.frame import Row, fastest

BATCH = 256  # roads
STEPS = 40  # decisions a round: an episode's length
LIKED = np.tile([0.2, 0.5, 0.3, 1.0, 0.1], (BATCH, 1))
LIMIT = 2.0  # [engine steps] a gated decision may cost


def measure() -> Iterator[Row]:
    """Replay the same episodes: the road's steps alone, and the gate's decisions alone."""
    road, gate = recorded()
    seconds = fastest({"engine": road, "gate": gate}, rounds=7)
    each = {name: 1e6 * taken / (BATCH * STEPS) for name, taken in seconds.items()}
    bench = f"gate: one decision of {BATCH} roads, 50 cars"
    yield Row(bench=bench, subject="cpl Engine step", value=each["engine"], unit="us/decision")
    yield Row(
        bench=bench,
        subject="look-ahead, quantile and choice",
        value=each["gate"],
        unit="us/decision",
        peer="cpl Engine step",
        ratio=each["engine"] / each["gate"],
        limit=LIMIT * each["engine"],
    )


def recorded() -> tuple[Callable[[], None], Callable[[], None]]:
    """Drive once and remember; return what drives the same again without the other."""
    engine = Engine(PAPER, BATCH)
    gate = Gate(PAPER, BATCH, Tracked(Fixed(eta=0.3), BATCH, alpha=0.05, q0=2.0, memory=20))
    first = engine.reset(np.arange(BATCH))
    seen, done = [first], []
    gate.begin()
    for _ in range(STEPS):
        done.append(gate(seen[-1], LIKED))
        seen.append(engine.step(done[-1]).obs)

    def road() -> None:
        engine.reset(np.arange(BATCH))
        for actions in done:
            engine.step(actions)

    def look() -> None:
        gate.begin()
        for obs in seen[:-1]:
            gate(obs, LIKED)

    return road, look
