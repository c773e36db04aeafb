"""How large is the quantile that an agent sees in training, and how large on the road?

The paper's explanation (Section IV-F): "at training time (by definition), the agent only sees data
in distribution, thereby with a small q". The share of decisions in each bin of q: in training, with
its exploration at the beginning (all actions drawn) and later (one in twenty), and on validation
seeds of three speed ranges.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import Setup, pairs_of, road_of, validation_seeds
from cpl.experiments.trained.agents import KNOWN, Agent, agent, needs_with_agents
from cpl.policies.listen import Choose, best, ride
from cpl.policies.switch import Moment
from cpl.rng import stream
from cpl.settings.ranges import Choice, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_EDGES = np.arange(-0.3, 1.31, 0.05).round(2)
_TRAINING_TOP = 30.0  # [m/s]


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The rides.

    Attributes:
        agents: Whose rides, of `cpl.experiments.trained.agents.KNOWN`.
        tops_mps: Upper ends of the speed ranges [m/s].
        explorations: Shares of decisions drawn at random, in the range of training.
    """

    agents: Annotated[tuple[str, ...], Choice(KNOWN)] = ("rl",)
    tops_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    explorations: Annotated[tuple[float, ...], interval("[0, 1]")] = (1.0, 0.05)


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=4, blocks=2, vehicles_count=8
    ),
    "book": Config(pairs=1, episodes=20, validation_episodes=60, blocks=20),
    "paper": Config(pairs=10, episodes=20, validation_episodes=200, blocks=20),
}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive, and count.

    Returns:
        One row an agent, place and bin: `pair`, `agent`, `top_mps`, `exploration` (0 on the road),
        `q_low` (the bin's lower end; the first and last bins hold what lies beyond), `decisions`
        (with a forecast), `q_sum`.
    """
    pair = shard.number("pair")
    places = [(_TRAINING_TOP, share) for share in config.explorations]
    places += [(top, 0.0) for top in config.tops_mps]
    found = []
    for name in config.agents:
        listener = agent(inputs, config.models, name, pair)
        for top, share in places:
            labels = {"pair": pair, "agent": name, "top_mps": top, "exploration": share}
            found.append(_counted(config, listener, top, share).assign(**labels))
    columns = ["pair", "agent", "top_mps", "exploration", "q_low", "decisions", "q_sum"]
    return pd.DataFrame(pd.concat(found, ignore_index=True)[columns])


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}", pair=pairs_of),
    needs=needs_with_agents,
    label="simulated",
    extent=("pairs", "first_pair"),
)


def _counted(config: Config, listener: Agent, top: float, share: float) -> pd.DataFrame:
    seeds = validation_seeds(config.validation_episodes)
    choose = _exploring(best(listener.network), share, listener.hearing.choices)
    steps = ride(road_of(config, top), listener.hearing, choose, seeds, record=True).steps
    if steps is None:
        raise RuntimeError("no steps were recorded")
    q = steps.loc[steps["l_hat"].notna(), "q"].to_numpy(np.float64)
    bins = np.clip(np.searchsorted(_EDGES, q, side="right") - 1, 0, len(_EDGES) - 1)
    return pd.DataFrame(
        {
            "q_low": _EDGES,
            "decisions": np.bincount(bins, minlength=len(_EDGES)),
            "q_sum": np.bincount(bins, weights=q, minlength=len(_EDGES)),
        }
    )


def _exploring(choose: Choose, share: float, choices: int) -> Choose:
    rng = stream(0, "why_support", "exploration")

    def explored(moment: Moment, seen: np.ndarray) -> np.ndarray:
        chosen = choose(moment, seen)
        drawn = rng.integers(choices, size=len(chosen))
        return np.where(rng.random(len(chosen)) < share, drawn, chosen)

    return explored if share else choose
