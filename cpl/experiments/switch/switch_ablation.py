"""What of the tracker matters to the switch: alpha, its step, its memory, its delay?

The switch of Section IV with the tracked quantile, one thing changed at a time, at the same
thresholds and on the same environment seeds. The paper shows one setting and does not say which
(its step is "0.1 B_hat", its tracker "PID", and delay and resets are not mentioned).
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from cpl.conformal import PI, Decaying, Fixed, RunningMax
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import (
    Setup,
    compact,
    curve,
    drivers_of,
    pairs_of,
    road_of,
    tracking_of,
)
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.needs import needs_of_pair
from cpl.policies.evaluate import Tracking
from cpl.policies.switch import Switch, thresholds

__all__ = ["EXPERIMENT", "PROFILES", "Config", "variants"]


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The variants.

    Attributes:
        q_safe: Thresholds of the switch, the same in all variants.
        alphas: Miscoverages aimed at beside the setup's own.
        late: A delay longer than the forecast's horizon [steps].
        streams: Streams that the episodes are dealt to where thresholds are carried on.
    """

    q_safe: tuple[float, ...] = (0.2, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 1.0)
    alphas: tuple[float, ...] = (0.02, 0.05, 0.2, 0.4)
    late: int = 8
    streams: int = 10

    def __post_init__(self) -> None:
        super().__post_init__()
        thresholds(self.q_safe)
        if self.late <= self.delay:
            raise ValueError(f"late must exceed the delay {self.delay}, got {self.late!r}")
        variants(self)


def variants(config: Config) -> dict[str, Tracking]:
    """Return the trackers by name; the first is the one that the others are compared with."""
    base = tracking_of(config)
    c = config.share
    other = {f"alpha {alpha:g}": replace(base, alpha=alpha) for alpha in config.alphas}
    return {
        "default": base,
        **other,
        "fixed step": replace(base, rule=Fixed(eta=c)),
        "large fixed step": replace(base, rule=Fixed(eta=5 * c)),
        "decaying step": replace(base, rule=Decaying(c=5 * c, power=0.6)),
        "PI": replace(base, rule=PI(RunningMax(c=c), K_I=c, C_sat=5.0)),
        "carried on": replace(base, carry=True, streams=config.streams),
        "late": replace(base, delay=config.late),
        "delay ignored": replace(base, issued=False),
        "signed score": replace(base, signed=True),
    }


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=1, blocks=2, vehicles_count=8,
        q_safe=(0.3, 0.6), alphas=(0.4,), streams=2,
    ),
    "book": Config(
        pairs=1, episodes=40, validation_episodes=1, blocks=20, q_safe=(0.4, 0.6),
        alphas=(0.02, 0.4), streams=4,
    ),
    "paper": Config(pairs=5, episodes=250, validation_episodes=1, blocks=25),
}  # fmt: skip


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive all variants with one pair.

    Returns:
        One row a variant, threshold and block of environment seeds: `pair`, `variant`, `alpha`,
        `level`, `value` (the threshold), `block`, and `cpl.policies.measures.SUMS`.
    """
    pair = shard.number("pair")
    drivers, road = drivers_of(inputs, pair), road_of(config, config.top_speed_mps)
    forecast = forecaster(inputs, "conformal", pair, calibrated=False)
    chooser, values = Switch(config.q_safe), np.asarray(config.q_safe)
    tables = [
        compact(
            curve(road, drivers, chooser, config, values, forecast=forecast, tracking=tracking),
            {"pair": pair, "variant": name, "alpha": tracking.alpha},
        )
        for name, tracking in variants(config).items()
    ]
    return pd.concat(tables, ignore_index=True)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}", pair=pairs_of),
    needs=needs_of_pair,
    label="simulated",
    extent=("pairs", "first_pair"),
    rtol=1e-5,  # sums of speeds are stored in single precision
)
