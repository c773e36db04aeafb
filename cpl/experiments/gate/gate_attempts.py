"""Can the look-ahead and its margin be made better? Each attempt on validation seeds first.

Every attempt changes one thing of `gate_stream`, on other environment seeds, another schedule and
two policy pairs. It is measured by what it is for: the crash rate beside constants of the same
look-ahead at the same mean speed, and beside the published setting's constants.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.conformal import Fixed
from cpl.experiments.gate import study as _gate_study
from cpl.experiments.gate.streams import Gated, drive, schedule
from cpl.experiments.gate.study import Streams, quantile, values
from cpl.experiments.run.spec import Experiment, Inputs, Shard
from cpl.experiments.trained.policies import need_policies_of_pair
from cpl.highway import PAPER
from cpl.policies.gate import (
    Constant,
    Decision,
    Gate,
    GateConfig,
    Margin,
    Outcome,
    Stacked,
    Tracked,
)
from cpl.policies.gate.margins import Floats

__all__ = ["ATTEMPTS", "EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Streams):
    """The streams; see `Streams`.

    Attributes:
        attempts: Which of `ATTEMPTS`.
    """

    attempts: tuple[str, ...] = ()
    stay: int = 2
    margins: tuple[float, ...] = (2.0, 5.0, 5.9, 6.2, 9.0, 13.0)


class Several:
    """Quantiles of the errors after one, two and three decisions, whichever asks for most.

    What a horizon asks for at its end, the margin's growth asks for at its own: the quantile of
    the errors after h of H decisions counts H / h times.
    """

    def __init__(self, parts: list[Tracked], factors: list[float]) -> None:
        self.parts, self.factors = parts, factors
        self.width = 1 + sum(part.width for part in parts)

    def issue(self) -> Floats:
        """Return the largest of the margins, and what each part has to remember."""
        issued = [part.issue() for part in self.parts]
        asked = [f * each[:, 0] for f, each in zip(self.factors, issued, strict=True)]
        return np.column_stack([np.max(asked, axis=0), *issued])

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Let each horizon learn from its own errors."""
        place = 1
        for part in self.parts:
            part.learn(outcome, issued[:, :, place : place + part.width])
            place += part.width


class Quantified(Tracked):
    """A quantile that rises by how much it was missed, too: an asymmetric step."""

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Move as the quantile does, then further up where it was missed."""
        super().learn(outcome, issued)
        known, error = outcome.known[:, -1], outcome.errors[:, -1]
        met, scale = issued[:, -1, 1], np.where(known, issued[:, -1, 2], 1.0)
        over = np.where(known, np.maximum(error / scale - met, 0.0), 0.0)
        self.lift = 0.9 * getattr(self, "lift", 0.0) + 0.1 * over

    def issue(self) -> Floats:
        """Return the margin, lifted."""
        issued = super().issue()
        issued[:, 0] += self.scale * getattr(self, "lift", 0.0)
        return issued


def _published(c: Config, n: int) -> Margin:
    return quantile(n, alpha=c.alpha, eta=c.eta, memory=c.memory)


def _plain(c: Config, n: int) -> Margin:
    return Tracked(Fixed(eta=1.5), n, alpha=c.alpha, q0=2.0)


def _horizons(chosen: tuple[int, ...]) -> Callable[[Config, int], Margin]:
    def make(c: Config, n: int) -> Margin:
        parts = [
            Tracked(Fixed(eta=c.eta), n, alpha=c.alpha, q0=2.0, memory=c.memory, scale0=h / 3, at=h)
            for h in chosen
        ]
        return Several(parts, [3 / h for h in chosen])

    return make


def _lifted(c: Config, n: int) -> Margin:
    return Quantified(Fixed(eta=c.eta), n, alpha=c.alpha, q0=2.0, memory=c.memory)


def _near_misses(epsilon: float) -> Callable[[Config, int], Margin]:
    return lambda c, n: Decision(n, eta=2.0, epsilon=epsilon, near=0.5, start=4.0)


ATTEMPTS: dict[str, tuple[GateConfig, Callable[[Config, int], Margin]]] = {
    "as published": (GateConfig(), _published),
    "error after one second only": (GateConfig(), _horizons((1,))),
    "errors after one, two and three seconds": (GateConfig(), _horizons((1, 2, 3))),
    "asymmetric step": (GateConfig(), _lifted),
    "plain, in metres": (GateConfig(), _plain),
    "across counts 6 times": (GateConfig(weight=6.0), _published),
    "cars at constant velocity": (GateConfig(forecast="velocity"), _published),
    "cars that follow (IDM)": (GateConfig(forecast="idm"), _published),
    "all of the margin at once": (GateConfig(growth=0.0), _published),
    "unseen cars forgotten": (GateConfig(memory=0), _published),
    "error of the nearest car": (GateConfig(error="clearance"), _published),
    "size of the error": (GateConfig(error="position"), _published),
    "decision theory: a near miss in 200 decisions": (GateConfig(), _near_misses(0.005)),
    "decision theory: a near miss in 1000 decisions": (GateConfig(), _near_misses(0.001)),
}
"""By name: the look-ahead, and the margin on n roads."""

PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", worlds=("in", "noise"), streams=2, stay=1,
        attempts=("as published", "asymmetric step"), margins=(2.0, 9.0),
    ),
    "book": Config(pairs=1, streams=8, stay=1, attempts=("as published", "asymmetric step")),
    "paper": Config(pairs=2, streams=16, attempts=tuple(ATTEMPTS)),
}  # fmt: skip


def _shards(config: Config) -> list[Shard]:
    """One attempt and pair a shard."""
    return [
        Shard(f"{re.sub(r'[^a-zA-Z0-9]+', '-', name)}-{pair}", {"attempt": name, "pair": pair})
        for name in config.attempts
        for pair in range(config.pairs)
    ]  # fmt: skip


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one pair's streams with one attempt, and with constants of the same look-ahead.

    Returns:
        One row a method and stream: `attempt`, `pair`, `method` ("quantile" or "constant"),
        `value` (of a constant [m]), `stream`, `episodes`, `crashes`, `steps`, `speed_sum`
        [m/s, over steps], `scored`, `missed`.
    """
    name, pair, n = shard.text("attempt"), shard.number("pair"), config.streams
    look, make = ATTEMPTS[name]
    margins: list[Margin] = [make(config, n), *(Constant(m, n) for m in config.margins)]
    names = ["quantile", *(f"constant {margin:g}" for margin in config.margins)]
    gate = Gate(PAPER, n * len(names), Stacked(margins, [n] * len(names)), look)
    worlds = schedule(config.worlds, n, config.stay, seed=2)
    driver = Gated(names, gate, values(inputs, "speed", pair))
    table = drive([driver], worlds, first_seed=_gate_study.VALIDATION + 1_000_000)
    found = table.groupby(["method", "stream"], sort=False, as_index=False).agg(
        episodes=("crashed", "size"),
        crashes=("crashed", "sum"),
        steps=("steps", "sum"),
        speed_sum=("speed_sum", "sum"),
        scored=("scored", "sum"),
        missed=("missed", "sum"),
    )
    parts = found["method"].str.split(" ")
    found["method"] = parts.str[0]
    found.insert(1, "value", parts.str[1].fillna("0").astype(float))
    found["speed_sum"] = found["speed_sum"].astype(float)
    whole = ("episodes", "crashes", "steps", "scored", "missed")
    found = found.astype(dict.fromkeys(whole, "int32"))
    found.insert(0, "pair", np.int8(pair))
    found.insert(0, "attempt", name)
    return found


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    needs=need_policies_of_pair,
    label="simulated",
    extent=("pairs",),
    rtol=1e-5,
)
