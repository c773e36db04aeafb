"""The road: steps a second beside EnvPool and highway-env, same setting, same run, one core."""

import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from cpl.highway import Config, Engine, active_path
from tests.bench.frame import Row, fastest

PACKAGES = ("highway-env", "envpool", "gymnasium", "llvmlite")

BATCH = 64  # environments that step together, in the engine and in EnvPool
STEPS = 40  # decisions a round: an episode's length
CARS = (10, 25, 50, 100, 200)
ENGINE, POOL, ORACLE = f"cpl Engine ({active_path()})", "EnvPool", "highway-env"

START = """
import time
begun = time.process_time()
import numpy as np
import cpl.highway as highway
print(time.process_time() - begun)
engine = highway.Engine(highway.PAPER, 2)
engine.reset(np.arange(2))
engine.step(np.zeros(2, np.int64))
print(time.process_time() - begun)
"""

ALONE = """
import time
from tests.bench.bench_highway import BATCH, STEPS, Config, engine_round
play = engine_round(Config(), batch=BATCH)
play()
best = float("inf")
for _ in range(40):
    begun = time.perf_counter()
    play()
    best = min(best, time.perf_counter() - begun)
print(BATCH * STEPS / best)
"""


def measure() -> Iterator[Row]:
    """Measure three ways of driving beside the peers, then sizes, threads, the start and memory."""
    yield from driving()
    yield from sizes()
    yield from threads()
    yield from processes()
    yield from start()
    yield memory()


def decisions(kind: str, batch: int, steps: int = 50 * STEPS) -> np.ndarray:
    """Random decisions, or ones that keep changing lanes."""
    choices = np.array({"random": [0, 1, 2, 3, 4], "weaving": [0, 2, 0, 2, 3]}[kind])
    return choices[np.random.default_rng(0).integers(len(choices), size=(steps, batch))]


def engine_round(
    config: Config,
    kind: str = "random",
    *,
    batch: int = BATCH,
    run_on: bool = False,
    **options: Any,
) -> Callable[[], None]:
    """One round of a batch, resets included; past a crash when `run_on`."""
    engine = Engine(config, batch, **options)
    engine.reset(np.arange(batch))
    actions = iter(decisions(kind, batch))

    def play() -> None:
        for _ in range(STEPS):
            out = engine.step(next(actions))
            done = out.truncated if run_on else out.terminated | out.truncated
            if done.any():
                engine.reset(mask=done)

    return play


def pool_round(kind: str) -> Callable[[], None]:
    """One round of EnvPool, which resets by itself."""
    import envpool

    pool = envpool.make_gymnasium(
        "Highway-v0", num_envs=BATCH, batch_size=BATCH, num_threads=1, seed=0
    )
    pool.reset()
    actions = iter(decisions(kind, BATCH).astype(np.int32))

    def play() -> None:
        for _ in range(STEPS // 4):
            pool.step(next(actions))

    return play


def oracle_round(kind: str, steps: int) -> Callable[[], None]:
    """Some steps of highway-env, resets included."""
    from highway_env.envs.highway_env import HighwayEnv

    env = HighwayEnv()
    env.reset(seed=0)
    actions = iter(decisions(kind, 1)[:, 0])

    def play() -> None:
        for _ in range(steps):
            _, _, terminated, truncated, _ = env.step(int(next(actions)))
            if terminated or truncated:
                env.reset()

    return play


def driving() -> Iterator[Row]:
    """Random decisions, lane weaving, and episodes that run on past their crash."""
    config = Config()
    for kind in ("random", "weaving"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rounds = {
                ENGINE: engine_round(config, kind),
                "cpl Engine (portable)": engine_round(config, kind, path="portable"),
                POOL: pool_round(kind),
                ORACLE: oracle_round(kind, 4),
            }
            if kind == "random":
                name = f"{ENGINE}, run on past crashes"
                rounds[name] = engine_round(config, kind, run_on=True)
            taken = fastest(rounds, rounds=6)
        done = {POOL: BATCH * (STEPS // 4), ORACLE: 4}
        speeds = {name: done.get(name, BATCH * STEPS) / taken[name] for name in rounds}
        for name, speed in speeds.items():
            for peer in (POOL, ORACLE):
                if name != peer and (name, peer) != (ORACLE, POOL):
                    yield Row(
                        bench=f"highway: 50 cars, {kind} decisions",
                        subject=name,
                        value=speed,
                        unit="steps/s",
                        peer=peer,
                        ratio=speed / speeds[peer],
                    )


def sizes() -> Iterator[Row]:
    """Steps a second by the number of cars."""
    rounds = {str(n): engine_round(Config(vehicles_count=n)) for n in CARS}
    for name, taken in fastest(rounds, rounds=5).items():
        yield Row(
            bench="highway: by number of cars, random decisions",
            subject=f"{name} cars",
            value=BATCH * STEPS / taken,
            unit="steps/s",
        )


def threads() -> Iterator[Row]:
    """Two threads beside one, by the clock on the wall."""
    batch = 4 * BATCH
    rounds = {f"{n} threads": engine_round(Config(), batch=batch, threads=n) for n in (1, 2)}
    taken = fastest(rounds, rounds=9, clock=time.perf_counter)
    yield Row(
        bench="highway: threads",
        subject="2 threads",
        value=batch * STEPS / taken["2 threads"],
        unit="steps/s",
        peer="1 thread",
        ratio=taken["1 threads"] / taken["2 threads"],
    )


def processes() -> Iterator[Row]:
    """Two processes at once beside one, by the clock on the wall; each says its best round."""
    rates: dict[int, float] = {}
    for count in (1, 2):
        running = [
            subprocess.Popen([sys.executable, "-c", ALONE], stdout=subprocess.PIPE, text=True)
            for _ in range(count)
        ]
        said = [process.communicate(timeout=120)[0] for process in running]
        rates[count] = sum(float(line) for line in said)
    yield Row(
        bench="highway: processes",
        subject="2 processes",
        value=rates[2],
        unit="steps/s",
        peer="1 process",
        ratio=rates[2] / rates[1],
    )


def start() -> Iterator[Row]:
    """Processor seconds of the import and of the first step, without and with the cache."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        for when, import_limit, step_limit in (("first", 20.0, 20.0), ("later", 1.0, 1.0)):
            done = subprocess.run(
                [sys.executable, "-c", START],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            seconds = [float(line) for line in done.stdout.split()]
            for what, value, limit in zip(
                ("import", "import and step"), seconds, (import_limit, step_limit), strict=True
            ):
                yield Row(
                    bench="highway: start",
                    subject=f"{when} {what}",
                    value=value,
                    unit="s",
                    limit=limit,
                )


def memory() -> Row:
    """Bytes that one more environment takes."""
    sizes = [sum(array.nbytes for array in Engine(Config(), n)._memory) for n in (1, 101)]
    return Row(
        bench="highway: memory",
        subject="50 cars",
        value=(sizes[1] - sizes[0]) / 100 / 1024,
        unit="KB/environment",
        limit=64.0,
    )
