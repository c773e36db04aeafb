"""What do forecast and quantile look like along one ride?

One episode of a base policy or of the switch, with the forecast, what then happened, and the
quantile that stood beside it. Paper: Figure 3, left.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.conformal import Fixed, RunningMax
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained import base_policies
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.needs import needs
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import base_policy
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Tracking, drive
from cpl.policies.switch import Switch, thresholds
from cpl.settings.ranges import Choice, Count, Natural, Settings, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_TEST = 20_000_000  # environment seeds of tests; training and validation lie below
_LENGTH, _HORIZON = 5, 3  # observations in a history; [steps] how far the forecast looks


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The ride.

    Attributes:
        pair: Which pair of base policies, with its forecaster.
        models: Profile that trained both.
        driver: `safe`, `speed` or `switch`.
        top_speed_mps: Upper end of the speed range [m/s].
        q_safe: Threshold of the switch [-].
        alpha: Miscoverage that the quantile aims at [-].
        step: Its step, in score or as a share of the largest score so far.
        running: Whether it is the share.
        ride: Which of the rides that last long enough, in the order of their environment seeds.
        least: What long enough is [steps].
        episodes: Test episodes that are driven to find it.
    """

    pair: Natural = 0
    models: Models = "paper"
    driver: Annotated[str, Choice(("safe", "speed", "switch"))] = "speed"
    top_speed_mps: float = 30.0
    q_safe: float = 0.6
    alpha: float = 0.1
    step: float = 0.1
    running: bool = True
    ride: Natural = 0
    least: Annotated[int, interval(f"[{_LENGTH - 1 + _HORIZON}, inf)")] = 12
    episodes: Count = 64

    def __post_init__(self) -> None:
        super().__post_init__()
        thresholds(self.q_safe)


PROFILES = {"smoke": Config(models="smoke"), "book": Config(), "paper": Config()}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive once.

    Returns:
        One row a forecast that was checked, by the time it was made: `step`, `l_hat`, `l_tilde`
        (three steps later), `q`, `missed`, `speed_mps`, `safe` (whether pi_safe drove) and
        `crashed` (whether the ride ended so).

    Raises:
        ValueError: If there are not so many rides that last long enough.
    """
    pair = config.pair
    drivers = Drivers(
        safe=base_policy(inputs, "safe", pair), speed=base_policy(inputs, "speed", pair)
    )
    rule = RunningMax(c=config.step) if config.running else Fixed(eta=config.step)
    base = base_policies.PROFILES[config.models]
    rides = drive(
        base_policies.road(replace(base, top_speed_mps=config.top_speed_mps), "speed"),
        drivers,
        Switch(config.q_safe) if config.driver == "switch" else Always([config.driver == "safe"]),
        _TEST + np.arange(config.episodes),
        forecast=forecaster(inputs, "conformal", pair, calibrated=False),
        tracking=Tracking(rule=rule, alpha=config.alpha, delay=_HORIZON),
        record=True,
    )
    lasting = rides.episodes[rides.episodes["steps"] >= config.least]
    if config.ride >= len(lasting):
        raise ValueError(
            f"ride must be below {len(lasting)}, the number of {config.episodes} episodes that last"
            f" {config.least} s, got {config.ride!r}"
        )
    told = lasting.iloc[config.ride]
    steps = pd.DataFrame(rides.steps).query("seed == @told.seed").sort_values("step")
    first, last = _LENGTH - 1, len(steps) - _HORIZON
    made = steps.iloc[first:last].reset_index(drop=True)
    truth = steps["l_tilde"].to_numpy()[first + _HORIZON :]
    l_hat, q = made["l_hat"].to_numpy(), made["u"].to_numpy()
    return pd.DataFrame(
        {
            "step": made["step"].to_numpy(),
            "l_hat": l_hat,
            "l_tilde": truth,
            "q": q,
            "missed": np.abs(truth - l_hat) > q,
            "speed_mps": made["speed"].to_numpy(),
            "safe": made["safe"].to_numpy() == 1,
            "crashed": bool(told["crashed"]),
        }
    )


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("ride", ride=lambda config: [config.ride]),
    needs=lambda config, shard: needs(config.models, config.pair),
    label="simulated",
    rtol=1e-6,
)
