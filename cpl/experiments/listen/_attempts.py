"""Ways to drive that know less than an agent, or adapt, each as a curve on one road."""

from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.run.spec import Inputs
from cpl.experiments.switch.setup import (
    Setup,
    choose_thresholds,
    curve,
    evaluation_seeds,
    tracking_of,
    validation_seeds,
)
from cpl.experiments.trained.forecasters import crash_classifier, forecaster
from cpl.highway import Config as Road
from cpl.network import MLP
from cpl.policies.adaptive import RiskControl
from cpl.policies.controls import Always, Clock, Coin, capped
from cpl.policies.doing import Do, Doing, freeze, natural, replay, traces
from cpl.policies.evaluate import Drivers, Forecast
from cpl.policies.listen import Hearing, best, ride
from cpl.policies.measures import block_sums
from cpl.policies.switch import Switch

__all__ = ["agent_sums", "blind", "doings_of", "donors_of", "switches", "thresholds_of"]

Floats = NDArray[np.float64]

_STREAMS = 10  # streams that a carried threshold's episodes are dealt to


def thresholds_of(
    setup: Setup, road: Road, drivers: Drivers, inputs: Inputs, pair: int, points: int
) -> dict[str, Floats]:
    """Choose the switches' thresholds on the validation seeds of one road.

    Returns:
        By name of the switch, ascending.
    """
    plain = forecaster(inputs, "conformal", pair, calibrated=False)
    own, carried = tracking_of(setup), replace(tracking_of(setup), carry=True, streams=_STREAMS)
    ways = {
        "switch": (plain, own),
        "switch, carried": (plain, carried),
        "crash forecast": (_risk(inputs, pair), None),
    }
    return {
        name: choose_thresholds(road, drivers, setup, points, forecast=forecast, tracking=tracking)
        for name, (forecast, tracking) in ways.items()
    }


def switches(
    setup: Setup,
    road: Road,
    drivers: Drivers,
    inputs: Inputs,
    pair: int,
    thresholds: dict[str, Floats],
    epsilons: Floats,
) -> dict[str, pd.DataFrame]:
    """Drive what chooses between the two policies by what it is told of the road."""
    plain = forecaster(inputs, "conformal", pair, calibrated=False)
    own, carried = tracking_of(setup), replace(tracking_of(setup), carry=True, streams=_STREAMS)
    found = {}
    for name, forecast, tracking in (
        ("switch", plain, own),
        ("switch, carried", plain, carried),
        ("crash forecast", _risk(inputs, pair), None),
    ):
        q_safe, how = thresholds[name], {"forecast": forecast, "tracking": tracking}
        found[name] = curve(road, drivers, Switch(q_safe), setup, q_safe, **how)
    control = RiskControl(epsilons, decisions=round(road.duration * road.policy_frequency))
    how = {"forecast": plain, "tracking": carried}
    found["risk control"] = curve(road, drivers, control, setup, epsilons, **how)
    return found


def blind(setup: Setup, road: Road, drivers: Drivers, points: int) -> dict[str, pd.DataFrame]:
    """Drive what does not look at a forecast at all."""
    n, seconds = setup.episodes, round(road.duration)
    shares = np.linspace(0.1, 0.9, points)
    until = np.linspace(seconds / 8, seconds * 7 / 8, points).round()
    low, top = road.target_speeds[0], road.target_speeds[-1]
    limits = np.linspace(low + 2.0, top - 2.0, points)
    nothing = np.array([np.nan])
    caps = [
        curve(capped(road, limit), drivers, Always([False]), setup, np.array([limit])).assign(
            level=level
        )
        for level, limit in enumerate(limits.tolist())
    ]
    coin = Coin(shares, episodes=n, seed=0)
    return {
        "coin": curve(road, drivers, coin, setup, shares),
        "clock": curve(road, drivers, Clock(until, safe_first=True), setup, until),
        "cap": pd.concat(caps, ignore_index=True),
        "safe": curve(road, drivers, Always([True]), setup, nothing),
        "speed": curve(road, drivers, Always([False]), setup, nothing),
    }


def donors_of(road: Road, hearing: Hearing, network: MLP, episodes: int) -> Floats:
    """Record the quantiles of an agent's own validation episodes, (episodes, steps)."""
    steps = ride(road, hearing, best(network), validation_seeds(episodes), record=True).steps
    if steps is None:
        raise RuntimeError("no steps were recorded")
    return traces(steps, round(road.duration * road.policy_frequency))


def doings_of(hearing: Hearing, donors: Floats) -> dict[str, Doing]:
    """Name the interventions that tell whether an agent uses its quantile."""
    if not hearing.view.quantiles:
        return {"natural": natural}
    return {
        "natural": natural,
        "mean": freeze(float(donors.mean())),
        "donor": replay(donors),
    }


def agent_sums(
    setup: Setup, road: Road, hearing: Hearing, network: MLP, doings: dict[str, Doing]
) -> pd.DataFrame:
    """Drive an agent under several interventions and add up by blocks.

    Returns:
        One row an intervention and block: `doing`, `block` and the sums.
    """
    seeds = evaluation_seeds(setup.episodes)
    intervene = Do(list(doings.values()))
    rides = ride(road, hearing, best(network), seeds, settings=len(doings), intervene=intervene)
    table = block_sums(rides.episodes, setup.blocks)
    names = np.array(list(doings))
    table.insert(0, "doing", names[table["setting"]])
    return table.drop(columns="setting")


def _risk(inputs: Inputs, pair: int) -> Forecast:
    """Return the forecast of a crash within three seconds, in place of the distance."""
    network = crash_classifier(inputs, pair)
    return lambda flat: (network(flat)[:, 0], None)
