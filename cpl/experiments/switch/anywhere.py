"""How does one pair drive one road, episode by episode, in arithmetic that is the same everywhere?

The engine's own arithmetic and forward passes in a fixed order: a browser that runs the road
drives the same episodes, to the last bit. Other experiments ask libm and a matrix library, which
are faster or nearer to highway-env, and differ from this in last bits.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.conformal import Fixed, RunningMax
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained.forecasters import suite_of
from cpl.experiments.trained.needs import needs
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import base_policy
from cpl.forecast.methods import Plain
from cpl.highway import PAPER
from cpl.highway import Config as Road
from cpl.network import Portable
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Tracking, drive
from cpl.policies.greedy import Greedy
from cpl.policies.switch import Switch, thresholds
from cpl.settings.ranges import Choice, Count, Natural, Probability, Settings, interval

__all__ = ["DRIVERS", "EXPERIMENT", "PROFILES", "Config"]


DRIVERS = ("safe", "speed", "switch", "no quantile")
_HORIZON = 3  # [steps] how far the forecast looks


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The road, who drives on it, and the tracker.

    Attributes:
        pair: Which pair of base policies, with its forecaster.
        models: Profile that trained both.
        drivers: Of `DRIVERS`; "no quantile" is the switch that adds nothing to its forecast.
        low_speed_mps: Lower end of the speed range [m/s].
        top_speed_mps: Upper end of it [m/s].
        levels: Speed levels, evenly spaced.
        vehicles_density: Density of the other cars at the start [-].
        observation_noise: Standard deviation of the noise on the other cars' features [-].
        q_safe: Threshold of the switch [-].
        alpha: Miscoverage that the quantile aims at [-].
        step: Its step, in score or as a share of the largest score so far.
        running: Whether it is the share.
        delay: Steps after which a score is known [steps].
        carry: Whether an episode begins with the threshold that the one before ended with; ten
            streams share the episodes then.
        first_seed: Environment seed of the first episode; the others follow.
        episodes: Episodes of each driver.
    """

    pair: Natural = 0
    models: Models = "paper"
    drivers: Annotated[tuple[str, ...], Choice(DRIVERS)] = ("switch", "speed")
    low_speed_mps: float = 20.0
    top_speed_mps: float = 40.0
    levels: int = 3
    vehicles_density: float = 1.0
    observation_noise: float = 0.0
    q_safe: float = 0.3
    alpha: Probability = 0.1
    step: float = 0.1
    running: bool = True
    delay: Annotated[int, interval(f"[{_HORIZON}, inf)")] = 3
    carry: bool = False
    first_seed: Natural = 20_000_000
    episodes: Count = 100

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.drivers:
            raise ValueError("drivers must name at least one, got none")
        thresholds(self.q_safe)
        self.road()
        self.rule()

    def road(self) -> Road:
        """Return the road; what is not set is the paper's."""
        speeds = np.linspace(self.low_speed_mps, self.top_speed_mps, self.levels)
        return replace(
            PAPER,
            target_speeds=tuple(speeds.tolist()),
            vehicles_density=self.vehicles_density,
            observation_noise=self.observation_noise,
        )

    def rule(self) -> RunningMax | Fixed:
        """Return the tracker's rule."""
        return RunningMax(c=self.step) if self.running else Fixed(eta=self.step)


PROFILES = {
    "smoke": Config(models="smoke", episodes=4),
    "book": Config(),
    "paper": Config(episodes=500),
}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one driver's episodes.

    Returns:
        One row an episode: `driver` and the columns of `cpl.policies.evaluate.Rides.episodes`
        without the setting.
    """
    name = str(shard["driver"])
    safe, speed = (
        Greedy(Portable.of(base_policy(inputs, kind, config.pair).network))
        for kind in ("safe", "speed")
    )
    switches = name in ("switch", "no quantile")
    tracking = Tracking(
        rule=config.rule(), alpha=config.alpha, delay=config.delay, carry=config.carry
    )
    rides = drive(
        config.road(),
        Drivers(safe=safe, speed=speed),
        Switch(config.q_safe) if switches else Always([name == "safe"]),
        config.first_seed + np.arange(config.episodes),
        forecast=Plain(Portable.of(suite_of(inputs, config.pair).network("plain"))),
        tracking=None if name == "no quantile" else tracking,
        path="own",
    )
    table = rides.episodes.drop(columns="setting")
    table.insert(0, "driver", name)
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{driver}", driver="drivers"),
    needs=lambda config, shard: needs(config.models, config.pair),
    label="simulated",
    rtol=0.0,
)
