"""Does the quantile of a look-ahead's own error pay when the world changes without notice?

The book's own experiment, beside Section IV of the paper. Streams of episodes pass through eight
worlds; nothing tells the driver which. A gate lets pass what the base policy (pi_speed) likes best
among the actions whose plan tolerates a margin. The margin is a constant, or the tracked quantile
of the look-ahead's error, or one of the controls.

Protocol of the headline test, fixed before any test seed was driven:

- Settings (look-ahead, step, memory, alpha) are those below; they were chosen on validation seeds
  (environment seeds from 10,000,000 on, another schedule) with policy pairs 0 and 1.
- Data: profile `paper`: policy pairs 0 to 4, each 48 streams x 32 episodes = 1,536 episodes from
  environment seed 20,000,000 on, the same for all methods and pairs; each stream stays in each of
  the eight worlds once for four episodes, in an order of its own.
- Method: `quantile`, the tracked quantile in units of a running scale. Rivals: `constant`, all
  margins of the profile.
- Statistic: the share of episodes that crash, minus that of the best constant at the same pooled
  mean speed (sum of speeds over sum of decisions), read off straight lines between the constants.
- Interval: 95 %, hierarchical bootstrap over policy pairs, then streams (the same streams in all
  pairs: crossed), 2,000 resamples, Student's t with pairs - 1 degrees of freedom.
- The effect is there if the interval lies below 0. It is reported as it falls. The same against
  mixtures of constants (their lower convex hull) is reported beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from cpl.conformal import PI, Decaying, Fixed, RunningMax, TrailingRange
from cpl.experiments._gate import Floats, Gated, drive, schedule
from cpl.experiments._gate_drivers import Capped, Foresight, Plain, Scheduled, Switching
from cpl.experiments._need import Inputs, Need
from cpl.experiments._policies import base_policy, need_base_policies
from cpl.experiments._shard import Shard
from cpl.experiments.base_policies import PROFILES as MODELS
from cpl.highway import PAPER
from cpl.policies.gate import (
    Adaptive,
    Averaged,
    Constant,
    Decision,
    Gate,
    GateConfig,
    Margin,
    Recorded,
    Stacked,
    Tracked,
)
from cpl.rng import stream

__all__ = [
    "EXTENT",
    "LABEL",
    "PROFILES",
    "RTOL",
    "Config",
    "calibrated",
    "quantile",
    "run_shard",
    "shards",
    "summed",
    "upstream",
]

LABEL = "simulated"
EXTENT = ("pairs",)
RTOL = 1e-5  # sums of float32 networks' decisions; crashes and steps are compared exactly

_TEST, _VALIDATION = 20_000_000, 10_000_000
_ALONE = ("in", "to40", "noise", "bursts")  # worlds that are driven by themselves, too


@dataclass(frozen=True, kw_only=True)
class Config:
    """The streams, the rivals, and the tracker.

    Attributes:
        pairs: Policy pairs, each a training seed.
        models: Profile of the experiment that trained them.
        worlds: Worlds that the streams pass through.
        streams: Streams of episodes in each pair, a multiple of the number of worlds.
        stay: Episodes that a stream stays in a world.
        margins: The constants [m].
        alpha: Miscoverage aimed at [-].
        eta: Step of the quantile, in scales.
        memory: Decisions that the scale remembers.
    """

    pairs: int
    models: str = "paper"
    worlds: tuple[str, ...] = (
        "in", "to40", "to50", "noise", "dropout", "braking", "aggressive", "dense",
    )  # fmt: skip
    streams: int
    stay: int = 4
    margins: tuple[float, ...] = (
        -3.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.5, 5.9, 6.2, 7.0, 9.0, 13.0, 20.0,
    )  # fmt: skip
    alpha: float = 0.05
    eta: float = 0.3
    memory: float = 20.0

    def __post_init__(self) -> None:
        if self.pairs < 1 or self.pairs > MODELS[self.models].pairs:
            raise ValueError(
                f"pairs must be 1 to {MODELS[self.models].pairs} (those trained), got {self.pairs}"
            )
        if self.stay < 1:
            raise ValueError(f"stay must be >= 1, got {self.stay!r}")
        if len(self.margins) < 2:
            raise ValueError(f"margins must be at least two, got {self.margins!r}")


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", worlds=("in", "noise"), streams=4, stay=1, margins=(0.0, 6.0)
    ),
    "book": Config(pairs=1, streams=8, stay=1, margins=(0.0, 3.0, 5.5, 7.0, 13.0)),
    "paper": Config(pairs=5, streams=48),
}

_PARTS = ("constant", "tracked", "other", "alone")


def shards(config: Config) -> list[Shard]:
    """What decides the headline first, then the other controls, for each pair."""
    return [
        Shard(f"{part}-{pair}", {"part": part, "pair": pair})
        for part in _PARTS
        for pair in range(config.pairs)
    ]


def upstream(config: Config, shard: Shard) -> list[Need]:
    """The pair's trained policies."""
    return [need_base_policies(MODELS[config.models], [shard.number("pair")])]


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one pair's streams with some of the methods.

    Returns:
        One row a method, stream and visit to a world: `pair`, `setting` (changing, or alone),
        `method`, `value` (its margin, cap, time or share), `stream`, `visit`, `world`, `episodes`,
        `crashes`, `steps`, `speed_sum` [m/s, over steps], `scored`, `missed`, `margin_sum` [m],
        `changed`, `error_sum` [m].
    """
    part, pair = shard.text("part"), shard.number("pair")
    safe, speed = (_values(inputs, kind, pair) for kind in ("safe", "speed"))
    worlds = schedule(config.worlds, config.streams, config.stay, seed=1)
    if part == "constant":
        found = _constants(config, speed, worlds)
    elif part == "tracked":
        found = _tracked(config, speed, worlds)
    elif part == "other":
        found = _others(config, safe, speed, worlds)
    else:
        found = pd.concat([_alone(config, speed, world) for world in _ALONE])
    found.insert(0, "pair", np.int8(pair))
    return found.reset_index(drop=True)


def quantile(config: Config, n: int, **changes: Any) -> Tracked:  # noqa: ANN401
    """Return the headline's margin on n roads."""
    settings = {"alpha": config.alpha, "q0": 2.0, "memory": config.memory, **changes}
    return Tracked(Fixed(eta=config.eta), n, **settings)


def calibrated(
    values: Any,  # noqa: ANN401
    margin: Callable[[float, int], Margin],
    grid: Sequence[float],
    *,
    alpha: float,
    streams: int,
) -> float:
    """Tune one number in distribution, on validation seeds: the error rate is to be alpha.

    Args:
        values: The base policy's.
        margin: The margin for a number, on n roads.
        grid: Numbers to try, ascending; the error rate falls along them.
        alpha: The error rate wanted.
        streams: Episodes of each.
    """
    worlds = np.full((streams, 1), "in")
    parts = [margin(value, streams) for value in grid]
    gate = Gate(PAPER, streams * len(grid), Stacked(parts, [streams] * len(grid)))
    names = [str(k) for k in range(len(grid))]
    table = drive([Gated(names, gate, values)], worlds, first_seed=_VALIDATION)
    missed, scored = (
        table[name].to_numpy(np.float64).reshape(1, len(grid), streams).sum(axis=(0, 2))
        for name in ("missed", "scored")
    )
    rate = missed / np.maximum(scored, 1.0)
    return float(np.interp(-alpha, -np.minimum.accumulate(rate), grid))


def summed(table: pd.DataFrame, setting: str, stay: int) -> pd.DataFrame:
    """Add episodes up over each visit to a world."""
    table = table.assign(visit=(table["round"] // stay).astype(np.int16))
    keys = ["method", "value", "stream", "visit", "world"]
    found = table.groupby(keys, sort=False, as_index=False).agg(
        episodes=("crashed", "size"),
        crashes=("crashed", "sum"),
        **{
            name: (name, "sum")
            for name in (
                "steps", "speed_sum", "scored", "missed", "margin_sum", "changed", "error_sum",
            )
        },
    )  # fmt: skip
    small = dict.fromkeys(("episodes", "crashes", "steps", "scored", "missed", "changed"), "int32")
    found = found.astype({**small, "speed_sum": float, "margin_sum": float, "error_sum": float})
    found.insert(0, "setting", setting)
    return found


def _values(inputs: Inputs, kind: str, pair: int) -> Any:  # noqa: ANN401
    driver = base_policy(inputs, kind, pair)
    return lambda obs: driver.values(obs)


def _run(
    config: Config,
    drivers: Sequence[Any],
    worlds: Any,  # noqa: ANN401
    setting: str = "changing",
) -> pd.DataFrame:
    """Drive, and take the value out of names such as "constant 5.5"."""
    table = drive(drivers, worlds, first_seed=_TEST)
    parts = table["method"].str.rpartition(" ")
    told = pd.Series(pd.to_numeric(parts[2], errors="coerce"))
    method = np.where(told.notna(), parts[0], table["method"])
    stay = config.stay if setting == "changing" else worlds.shape[1]
    return summed(table.assign(method=method, value=told.fillna(0.0)), setting, stay)


def _gated(
    names: Sequence[str],
    margins: Sequence[Margin],
    streams: int,
    values: Any,  # noqa: ANN401
    look: GateConfig | None = None,
) -> Gated:
    n = len(names) * streams
    gate = Gate(PAPER, n, Stacked(list(margins), [streams] * len(names)), look)
    return Gated(names, gate, values)


def _constants(config: Config, speed: Any, worlds: Any) -> pd.DataFrame:  # noqa: ANN401
    n = config.streams
    names = [f"constant {margin:g}" for margin in config.margins]
    margins = [Constant(margin, n) for margin in config.margins]
    return _run(config, [_gated(names, margins, n, speed)], worlds)


def _tracked(config: Config, speed: Any, worlds: Any) -> pd.DataFrame:  # noqa: ANN401
    """Trackers first; then what replays their margins."""
    n, a = config.streams, config.alpha
    spread = calibrated(
        speed,
        lambda k, m: Averaged(m, memory=config.memory, deviations=k, start=(1.0, 2.0)),
        (0.0, 0.5, 1.0, 1.5, 2.0, 3.0),
        alpha=a,
        streams=2 * n,
    )
    frozen = calibrated(
        speed, Constant, (-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0), alpha=a, streams=2 * n
    )
    plain: Any = {"alpha": a, "q0": 2.0}
    trackers: dict[str, Margin] = {
        "quantile": quantile(config, n),
        "quantile, plain": Tracked(Fixed(eta=1.5), n, **plain),
        "frozen": Constant(frozen, n),
        "EWMA": Averaged(n, memory=config.memory, deviations=spread, start=(1.0, 2.0)),
        "ACI": Adaptive(n, alpha=a, gamma=0.01, window=60, start=2.0, top=40.0),
        "PI": Tracked(PI(Fixed(eta=0.5), K_I=5.0, C_sat=5.0), n, **plain),
        "running maximum": Tracked(RunningMax(c=0.05), n, **plain),
        "trailing range": Tracked(TrailingRange(lr=0.1, window=40), n, **plain),
        "decaying": Tracked(Decaying(c=5.0, power=0.6), n, **plain),
        "decision theory": Decision(n, eta=2.0, epsilon=0.02, near=0.5, start=2.0),
    }
    driver = _gated(list(trackers), list(trackers.values()), n, speed)
    driver.margins = []
    first = _run(config, [driver], worlds)
    q = np.stack(driver.margins)[:, :n]
    replays = _replays(q, worlds)
    names, margins = list(replays), [Recorded(rows) for rows in replays.values()]
    return pd.concat([first, _run(config, [_gated(names, margins, n, speed)], worlds)])


def _replays(q: Floats, worlds: Any) -> dict[str, Floats]:  # noqa: ANN401
    """Margins with parts of what the quantile knows: its regime, its distribution, its mean.

    Args:
        q: The quantile's margins, one row a decision (40 an episode), a column a stream.
        worlds: By stream and round.
    """
    here = np.repeat(worlds.T, len(q) // worlds.shape[1], axis=0)
    donor, mean = q.copy(), np.empty_like(q)
    for world in np.unique(worlds):
        mean[here == world] = q[here == world].mean()
    for row, names in zip(donor, here, strict=True):
        for world in np.unique(names):
            mine = np.flatnonzero(names == world)
            row[mine] = row[np.roll(mine, 1)]
    mixed = stream(0, "gate", "shuffle").permuted(q, axis=1)
    return {
        "donor quantile": donor,
        "shuffled quantile": mixed,
        "mean quantile of the world": mean,
        "mean quantile": np.full_like(q, q.mean()),
    }


def _others(config: Config, safe: Any, speed: Any, worlds: Any) -> pd.DataFrame:  # noqa: ANN401
    n, filtered = config.streams, GateConfig(filtered=0.02)
    kalman = [f"Kalman filter, constant {m:g}" for m in config.margins[1::3]]
    margins: list[Margin] = [Constant(m, n) for m in config.margins[1::3]]
    drivers = [
        _gated(["Kalman filter, quantile", *kalman], [quantile(config, n), *margins], n, speed,
               filtered),
        Plain("pi_safe", safe),
        Plain("pi_speed", speed),
        *(Capped(f"speed cap {cap:g}", speed, cap) for cap in (20.0, 25.0, 30.0)),
        *(Scheduled(f"clock {t}", safe, speed, until=t) for t in (10, 20, 30)),
        *(
            Scheduled(f"coin {p:g}", safe, speed, until=None, share=p)
            for p in (0.25, 0.5, 0.75)
        ),
        *(
            Switching(f"pi_switch {level:g}", safe, speed, n, q_safe=level)
            for level in (0.3, 0.6, 0.9)
        ),
        Foresight("oracle", speed),
    ]  # fmt: skip
    return _run(config, drivers, worlds)


def _alone(config: Config, speed: Any, world: str) -> pd.DataFrame:  # noqa: ANN401
    """One world for ever: the quantile beside constants."""
    n = config.streams
    worlds = np.full((n, config.stay), world)
    chosen = config.margins[1::2]
    names = ["quantile", *(f"constant {margin:g}" for margin in chosen)]
    margins = [quantile(config, n), *(Constant(margin, n) for margin in chosen)]
    return _run(config, [_gated(names, margins, n, speed)], worlds, world)
