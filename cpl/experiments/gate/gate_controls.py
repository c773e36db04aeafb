"""Which part of the look-ahead's quantile does the work, and what do simpler remedies achieve?

The streams of `gate_stream`, driven by everything that the quantile has to be compared with: other
trackers, its margins replayed in the wrong place, a Kalman filter, decision theory, drivers without
a gate, and a look-ahead that knows the future. Also worlds by themselves, among them one that
changes within an episode, faster than the quantile can follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import PI, Decaying, Fixed, RunningMax, TrailingRange
from cpl.experiments.gate.drivers import Capped, Foresight, Plain, Scheduled, Switching
from cpl.experiments.gate.replays import Recording, Replaying, replays
from cpl.experiments.gate.streams import schedule
from cpl.experiments.gate.study import Streams, averaged, frozen, gated, quantile, run, values
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained.policies import need_policies_of_pair
from cpl.policies.gate import (
    Adaptive,
    Constant,
    Decision,
    GateConfig,
    Margin,
    Recorded,
    Tracked,
)

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Streams):
    """The streams and the tracker, as in `gate_stream`.

    Attributes:
        alone: Worlds that are driven by themselves as well.
    """

    alone: tuple[str, ...] = ("to40", "noise", "bursts")
    stay: int = 4
    margins: tuple[float, ...] = (3.0, 5.9, 6.2, 9.0)


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", worlds=("in", "noise"), alone=("bursts",), streams=2, stay=1
    ),
    "book": Config(pairs=1, streams=8, stay=1),
    "paper": Config(pairs=3, streams=24),
}

_PARTS = ("trackers", "drivers", "alone")


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one pair's streams with some of the methods.

    Returns:
        One row a method, stream and visit to a world, the columns of `gate_stream`; `setting` is
        "changing" or the world that is driven by itself, `value` a constant's margin [m], a cap
        [m/s], a time [s], a share or a threshold.
    """
    part, pair = shard.text("part"), shard.number("pair")
    safe, speed = (values(inputs, kind, pair) for kind in ("safe", "speed"))
    worlds = schedule(config.worlds, config.streams, config.stay, seed=1)
    if part == "trackers":
        found = _trackers(config, speed, worlds)
    elif part == "drivers":
        found = _drivers(config, safe, speed, worlds)
    else:
        found = pd.concat([_alone(config, speed, world) for world in config.alone])
    found.insert(0, "pair", np.int8(pair))
    return found.reset_index(drop=True)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{part}-{pair}", part=_PARTS, pair="pairs"),
    needs=need_policies_of_pair,
    label="simulated",
    extent=("pairs",),
    rtol=1e-5,  # sums of float32 numbers; crashes and steps are compared exactly
)


def _quantile(config: Config) -> Tracked:
    return quantile(config.streams, alpha=config.alpha, eta=config.eta, memory=config.memory)


def _trackers(config: Config, speed: Any, worlds: NDArray[np.str_]) -> pd.DataFrame:  # noqa: ANN401
    """Trackers first; then what replays the quantile's margins."""
    n, a = config.streams, config.alpha
    plain: Any = {"alpha": a, "q0": 2.0}
    trackers: dict[str, Margin] = {
        "quantile": _quantile(config),
        "quantile, plain": Tracked(Fixed(eta=1.5), n, **plain),
        "frozen": frozen(speed, n, alpha=a),
        "EWMA": averaged(speed, n, alpha=a, memory=config.memory),
        "ACI": Adaptive(n, alpha=a, gamma=0.01, window=60, start=2.0, top=40.0),
        "PI": Tracked(PI(Fixed(eta=0.5), K_I=5.0, C_sat=5.0), n, **plain),
        "running maximum": Tracked(RunningMax(c=0.05), n, **plain),
        "trailing range": Tracked(TrailingRange(lr=0.1, window=40), n, **plain),
        "decaying": Tracked(Decaying(c=5.0, power=0.6), n, **plain),
        "decision theory": Decision(n, eta=2.0, epsilon=0.02, near=0.5, start=2.0),
        **{f"constant {margin:g}": Constant(margin, n) for margin in config.margins},
    }
    driver = Recording(gated(list(trackers), list(trackers.values()), n, speed))
    first = run([driver], worlds, stay=config.stay)
    played = replays(driver.margins()[:, :n], worlds)
    recorded = [Recorded(rows) for rows in played.values()]
    again = Replaying(gated(list(played), recorded, n, speed), recorded)
    return pd.concat([first, run([again], worlds, stay=config.stay)])


def _drivers(
    config: Config,
    safe: Any,  # noqa: ANN401
    speed: Any,  # noqa: ANN401
    worlds: NDArray[np.str_],
) -> pd.DataFrame:
    """A filter before the gate, drivers without a gate, and one that knows the future."""
    n = config.streams
    names = [f"Kalman filter, constant {margin:g}" for margin in config.margins]
    margins: list[Margin] = [Constant(margin, n) for margin in config.margins]
    drivers = [
        gated(
            ["Kalman filter, quantile", *names],
            [_quantile(config), *margins],
            n,
            speed,
            GateConfig(filtered=0.02),
        ),
        Plain("pi_safe", safe),
        Plain("pi_speed", speed),
        *(Capped(f"speed cap {cap:g}", speed, cap) for cap in (20.0, 25.0, 30.0)),
        *(Scheduled(f"clock {t}", safe, speed, until=t) for t in (10, 25)),
        *(Scheduled(f"coin {p:g}", safe, speed, until=None, share=p) for p in (0.3, 0.7)),
        *(
            Switching(f"pi_switch {level:g}", safe, speed, n, q_safe=level)
            for level in (0.3, 0.6, 0.9)
        ),
        Foresight("oracle", speed),
    ]
    return run(drivers, worlds, stay=config.stay)


def _alone(config: Config, speed: Any, world: str) -> pd.DataFrame:  # noqa: ANN401
    """One world for ever: the quantile beside constants."""
    n = config.streams
    worlds = np.full((n, 2 * config.stay), world)
    names = ["quantile", *(f"constant {margin:g}" for margin in config.margins)]
    margins: list[Margin] = [_quantile(config), *(Constant(m, n) for m in config.margins)]
    driver = gated(names, margins, n, speed)
    return run([driver], worlds, stay=2 * config.stay, setting=world)
