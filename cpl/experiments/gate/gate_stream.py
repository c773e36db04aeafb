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
  margins of the profile. Beside them `frozen`, the constant that covers 1 - alpha in distribution,
  and `EWMA`, an average plus deviations, tuned to the same. Other controls: `gate_controls`.
- Statistic: the share of episodes that crash, minus that of the best constant at the same pooled
  mean speed (sum of speeds over sum of decisions), read off straight lines between the constants.
- Interval: 95 %, hierarchical bootstrap over policy pairs, then streams (the same streams in all
  pairs: crossed), 2,000 resamples, Student's t with pairs - 1 degrees of freedom.
- The effect is there if the interval lies below 0. It is reported as it falls. The same against
  mixtures of constants (their lower convex hull) is reported beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.experiments.gate.streams import schedule
from cpl.experiments.gate.study import Streams, averaged, frozen, gated, quantile, run, values
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained.policies import need_policies_of_pair
from cpl.policies.gate import Constant, Margin

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Streams):
    """The streams, the rivals, and the tracker; see `Streams`."""

    stay: int = 4
    margins: tuple[float, ...] = (
        0.0, 2.0, 4.0, 5.0, 5.9, 6.2, 7.0, 9.0, 13.0,
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.margins) < 2:
            raise ValueError(f"margins must be at least two, got {self.margins!r}")


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", worlds=("in", "noise"), streams=4, stay=1, margins=(0.0, 6.0)
    ),
    "book": Config(pairs=1, streams=8, stay=1, margins=(0.0, 4.0, 5.9, 6.2, 13.0)),
    "paper": Config(pairs=5, streams=48),
}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one pair's streams with the constants and the quantile.

    Returns:
        One row a method, stream and visit to a world: `pair`, `setting` ("changing"), `method`,
        `value` (of a constant [m]), `stream`, `visit`, `world`, `episodes`, `crashes`, `steps`,
        `speed_sum` [m/s, over steps], `scored`, `missed`, `margin_sum` [m], `changed`,
        `error_sum` [m].
    """
    pair, n, alpha = shard.number("pair"), config.streams, config.alpha
    speed = values(inputs, "speed", pair)
    worlds = schedule(config.worlds, n, config.stay, seed=1)
    margins: dict[str, Margin] = {
        "quantile": quantile(n, alpha=alpha, eta=config.eta, memory=config.memory),
        "frozen": frozen(speed, n, alpha=alpha),
        "EWMA": averaged(speed, n, alpha=alpha, memory=config.memory),
        **{f"constant {margin:g}": Constant(margin, n) for margin in config.margins},
    }
    driver = gated(list(margins), list(margins.values()), n, speed)
    found = run([driver], worlds, stay=config.stay)
    found.insert(0, "pair", np.int8(pair))
    return found


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair-{pair}", pair="pairs"),
    needs=need_policies_of_pair,
    label="simulated",
    extent=("pairs",),
    rtol=1e-5,  # sums of float32 numbers; crashes and steps are compared exactly
)
