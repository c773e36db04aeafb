"""Can a policy learn to use the quantile as well as a switch written by hand uses it?

Section IV-F, Table I: pi_speed, five learned agents and the switch, in three speed ranges, on the
same environment seeds. The paper has one training seed; here each pair of base policies has its
own forecaster and agents. Beside the paper's rows stand pi_safe, a car that only ever slows down,
and the switch at thresholds above and below.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import (
    Setup,
    drivers_of,
    evaluation_seeds,
    pairs_of,
    road_of,
    tracking_of,
    validation_seeds,
)
from cpl.experiments.trained.agents import needs_with_agents
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.listening import AGENTS, decoded, hearing_of
from cpl.policies.evaluate import Drivers, Forecast
from cpl.policies.headway import SLOWER
from cpl.policies.listen import Choose, Hearing, View, best, by_chooser, ride
from cpl.policies.switch import Switch, thresholds
from cpl.settings.ranges import Choice, Share, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_TRAINING_TOP = 30.0  # [m/s] the speed range in which everything was trained
_OWN = View(l_hat=False, quantiles=0)  # of who does not hear


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The table.

    Attributes:
        tops_mps: Upper ends of the speed ranges [m/s].
        agents: The learned agents.
        q_safe: The threshold that is not chosen [-].
        allowed: Share of validation episodes, in the range of the training, that may crash with
            the threshold that is chosen [-].
        beside: How far the switch's other thresholds are from the chosen one [-].
    """

    tops_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    agents: Annotated[tuple[str, ...], Choice(AGENTS)] = AGENTS
    q_safe: float = 0.3
    allowed: Share = 0.1
    beside: Annotated[float, interval("(0, 0.1]")] = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        thresholds(self.q_safe)
        if not self.tops_mps:
            raise ValueError(f"tops_mps must name at least one range, got {self.tops_mps!r}")


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=2, blocks=2, vehicles_count=8,
        tops_mps=(30.0, 40.0),
    ),
    "book": Config(
        pairs=1, episodes=40, validation_episodes=20, blocks=20, tops_mps=(40.0,)
    ),
    "paper": Config(pairs=10, episodes=500, validation_episodes=50, blocks=25),
}  # fmt: skip


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive everybody in all speed ranges with what one pair has learned.

    Returns:
        One row an episode: `pair`, `top_mps`, `policy` (`speed`, the agents, `switch`: at the
        threshold chosen on validation seeds in the range of the training; `switch below`,
        `switch above`: beside it; `switch 0.3`; `safe`; `slow`: never faster than it must;
        `rl carried` and so on, in the range of `top_speed_mps` only: the agent's episodes one after
        the other, each beginning with the quantile that the one before ended with),
        `q_safe` (NaN but for the switch), `seed`, `steps`, `crashed`, `speed_sum` and `last_speed`
        [m/s], `distance_m`, `overtaken`, `fast_steps` (decisions above 30 m/s), `q_sum` and
        `q_steps` (quantiles along the way, whoever heard them), `scored`, `missed`, `safe_steps`
        (of the switch), and `as_speed`: whether every action was pi_speed's.
    """
    pair = shard.number("pair")
    drivers = drivers_of(inputs, pair)
    forecast = forecaster(inputs, "conformal", pair, calibrated=False)
    chosen = _chosen(config, drivers, forecast)
    grid = np.array([chosen, chosen - config.beside, chosen + config.beside, config.q_safe])
    found = []
    for top in config.tops_mps:
        road = road_of(config, top)
        for names, values, hears, choose in _entrants(config, inputs, pair, top, forecast, grid):
            rides = ride(
                road, hears, choose, evaluation_seeds(config.episodes), settings=len(names)
            )
            table = _rows(rides.episodes, names, values)
            table.insert(0, "top_mps", top)
            found.append(table)
    joined = pd.concat(found, ignore_index=True)
    joined.insert(0, "pair", pair)
    keys = ["top_mps", "seed"]
    speed = joined.loc[joined["policy"] == "speed", [*keys, "trace"]]
    theirs = joined[keys].merge(speed, on=keys, how="left")["trace"].to_numpy()
    joined["as_speed"] = joined.pop("trace").to_numpy() == theirs
    return joined


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}", pair=pairs_of),
    needs=needs_with_agents,
    label="simulated",
    extent=("pairs", "first_pair"),
    rtol=1e-5,  # speeds are stored in single precision
)


_Entrant = tuple[list[str], NDArray[np.float64], Hearing, Choose]


def _entrants(
    config: Config,
    inputs: Inputs,
    pair: int,
    top: float,
    forecast: Forecast,
    grid: NDArray[np.float64],
) -> Iterator[_Entrant]:
    """Say who drives: names, thresholds, what is heard, and who chooses."""
    tracking, drivers = tracking_of(config), drivers_of(inputs, pair)
    deaf = Hearing(forecast=forecast, tracking=tracking, view=_OWN)
    both = Hearing(
        forecast=forecast, tracking=tracking, view=_OWN, policies=(drivers.safe, drivers.speed)
    )
    none = np.full(1, np.nan)
    yield ["speed"], none, both, lambda moment, _: np.ones(len(moment.step), np.int64)
    for agent in config.agents:
        network = decoded(inputs, "listeners", f"{agent}-{pair}")
        yield [agent], none, hearing_of(agent, forecast, tracking), best(network)
    names = ["switch", "switch below", "switch above", f"switch {config.q_safe:g}"]
    yield names, grid, both, by_chooser(Switch(grid))
    yield ["safe"], none, both, lambda moment, _: np.zeros(len(moment.step), np.int64)
    yield ["slow"], none, deaf, lambda moment, _: np.full(len(moment.step), SLOWER)
    if top != config.top_speed_mps:
        return
    carried = replace(tracking, carry=True, streams=1)
    for agent in config.agents:
        network = decoded(inputs, "listeners", f"{agent}-{pair}")
        yield [f"{agent} carried"], none, hearing_of(agent, forecast, carried), best(network)


def _chosen(config: Config, drivers: Drivers, forecast: Forecast) -> float:
    """Return the greatest threshold at and below which the validation crashes are allowed.

    If none is, the safest one. Only the range of the training is looked at: before a shift nobody
    has seen another.
    """
    grid = np.round(np.arange(0.1, 1.25, 0.1), 2)
    hears = Hearing(
        forecast=forecast, tracking=tracking_of(config), view=_OWN,
        policies=(drivers.safe, drivers.speed),
    )  # fmt: skip
    rides = ride(
        road_of(config, _TRAINING_TOP), hears, by_chooser(Switch(grid)),
        validation_seeds(config.validation_episodes), settings=len(grid),
    ).episodes  # fmt: skip
    rate = rides["crashed"].to_numpy(np.float64).reshape(len(grid), -1).mean(axis=1)
    fine = np.cumprod(rate <= config.allowed).sum()
    return float(grid[max(int(fine) - 1, 0)])


def _rows(episodes: pd.DataFrame, names: list[str], values: NDArray[np.float64]) -> pd.DataFrame:
    """Name the settings and store numbers in few bytes."""
    setting = episodes["setting"].to_numpy()
    table = episodes.drop(columns=["setting", "changes", "reward_sum"])
    table = table.rename(columns={"u_sum": "q_sum", "u_steps": "q_steps"})
    table.insert(0, "policy", np.array(names)[setting])
    table.insert(1, "q_safe", values[setting])
    if not names[0].startswith("switch"):
        table["safe_steps"] = 0  # only the switch has two policies to choose from
    counts = ["steps", "overtaken", "safe_steps", "fast_steps", "q_steps", "scored", "missed"]
    kinds = dict.fromkeys(counts, "int16") | {"seed": "int32"}
    digits = {"speed_sum": 1, "last_speed": 1, "distance_m": 0, "q_sum": 2}
    rounded = table.assign(**{name: table[name].round(places) for name, places in digits.items()})
    return rounded.astype({**kinds, **dict.fromkeys([*digits, "q_safe"], "float32")})
