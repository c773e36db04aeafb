"""What is in an agent's network: does its choice depend on q, and do its features hold the danger?

On natural rides over validation seeds, at the moments that the agent really meets:

- *response*: its greedy choice if q, or the forecast, were another number (nothing is driven on);
- *saliency*: gradients of the best choice's advantage, and choices that change when a group of
  inputs is given the values of another moment;
- *probe*: a logistic regression that reads "a crash within three seconds" from the last hidden
  layer, from the inputs, or from q and l_hat alone, judged on other episodes than it was fitted to;
- *risk*: whether braking is told better by q and q l_hat than by q alone (the claim about rl_2).
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import HORIZON, Setup, pairs_of, road_of, validation_seeds
from cpl.experiments.trained.agents import KNOWN, Agent, agent, needs_with_agents
from cpl.policies.headway import FASTER, SLOWER
from cpl.policies.listen import best, ride
from cpl.policies.saliency import flips, saliency
from cpl.policies.switch import Moment
from cpl.rng import stream
from cpl.settings.ranges import Choice, Positive
from cpl.stats.logistic import auc, fit_logistic

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_WIDTH = 25  # numbers in an observation: five cars with five features
_GROUPS = {
    "ego car": slice(0, 5),
    "nearest car": slice(5, 10),
    "other cars": slice(10, 25),
    "l_hat": slice(25, 26),
    "q": slice(26, 27),
}

Singles = NDArray[np.float32]


_FIT = tuple(name for name in KNOWN if name not in ("longer", "gate", "gate_nq"))


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The rides and the questions.

    Attributes:
        agents: Whose networks; those that see the present observation, the forecast and perhaps q.
        q_values: What q is set to in the response [-].
        l_values: What the forecast is set to [-].
        ridge: Penalty of the probes.
    """

    agents: Annotated[tuple[str, ...], Choice(_FIT)] = ("rl", "rl_nq", "rl_1", "rl_2", "rl_3")
    q_values: tuple[float, ...] = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
    l_values: tuple[float, ...] = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
    ridge: Positive = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.validation_episodes < 2:
            raise ValueError(
                f"validation_episodes must be at least 2, got {self.validation_episodes!r}"
            )


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=8, blocks=2, vehicles_count=8,
        agents=("rl", "rl_nq"), q_values=(0.0, 1.0), l_values=(0.0, 1.0),
    ),
    "book": Config(
        pairs=1, episodes=20, validation_episodes=60, blocks=20, agents=("rl", "rl_nq"),
    ),
    "paper": Config(pairs=10, episodes=20, validation_episodes=300, blocks=20),
}  # fmt: skip


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Ask every network of a pair.

    Returns:
        One row an answer: `pair`, `agent`, `question` ("changed", "slower" and "faster": shares of
        moments; "gradient" and "flips"; "probe": area under the curve; "risk": deviance explained
        [nat a decision]), `of` (which input or reading), `at` (what it was set to, else NaN),
        `value`, `n` (moments).
    """
    pair = shard.number("pair")
    found = []
    for name in config.agents:
        who = agent(inputs, config.models, name, pair)
        moments = _moments(config, who)
        answers = [
            *_responses(config, who, moments),
            *_saliencies(who, moments, pair),
            *_probes(config, who, moments),
            *_risks(moments),
        ]
        rows = pd.DataFrame(answers, columns=["question", "of", "at", "value"])
        rows.insert(0, "agent", name)
        found.append(rows.assign(n=len(moments.seen)))
    joined = pd.concat(found, ignore_index=True)
    joined.insert(0, "pair", pair)
    return joined


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}", pair=pairs_of),
    needs=needs_with_agents,
    label="simulated",
    extent=("pairs", "first_pair"),
    rtol=1e-4,  # the probes' fits stop at a tolerance of their own
)


Answers = list[tuple[str, str, float, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Moments:
    """Decisions with a forecast: what was seen, q, the forecast, the choice, and what came."""

    seen: Singles
    q: NDArray[np.float64]
    l_hat: NDArray[np.float64]
    speed: NDArray[np.float64]
    choice: NDArray[np.int64]
    crash: NDArray[np.bool_]
    late: NDArray[np.bool_]  # the second half of the episodes


def _moments(config: Config, who: Agent) -> _Moments:
    """Drive naturally, and keep what the agent sees."""
    seeds = validation_seeds(config.validation_episodes)
    kept: list[tuple[NDArray[np.int64], NDArray[np.int64], Singles]] = []
    choose = best(who.network)

    def watched(moment: Moment, seen: Singles) -> NDArray[np.int64]:
        kept.append((moment.episode.copy(), moment.step.copy(), seen.copy()))
        return choose(moment, seen)

    road = road_of(config, config.top_speed_mps)
    rides = ride(road, who.hearing, watched, seeds, record=True)
    if rides.steps is None:
        raise RuntimeError("no steps were recorded")
    size = round(road.duration * road.policy_frequency) + 1
    view = np.zeros((len(seeds), size, kept[0][2].shape[1]), np.float32)
    for episode, step, seen in kept:
        view[episode, step] = seen
    steps = pd.DataFrame(rides.steps[rides.steps["l_hat"].notna()])
    episode = (steps["seed"] - seeds[0]).to_numpy()
    step = steps["step"].to_numpy()
    last, crashed = (rides.episodes[name].to_numpy() for name in ("steps", "crashed"))
    return _Moments(
        seen=view[episode, step],
        q=steps["q"].to_numpy(np.float64),
        l_hat=steps["l_hat"].to_numpy(np.float64),
        speed=steps["speed"].to_numpy(np.float64),
        choice=steps["choice"].to_numpy(np.int64),
        crash=crashed[episode] & (step >= last[episode] - HORIZON),
        late=episode >= len(seeds) // 2,
    )


def _responses(config: Config, who: Agent, moments: _Moments) -> Answers:
    found: Answers = []
    sweeps = [("l_hat", config.l_values, 1.0)]
    if who.hearing.view.quantiles:
        sweeps.append(("q", config.q_values, who.hearing.view.q_scale))
    for name, values, scale in sweeps:
        for value in values:
            other = moments.seen.copy()
            other[:, _GROUPS[name]] = scale * value
            chosen = who.network(other).argmax(axis=1)
            found += [
                ("changed", name, value, float(np.mean(chosen != moments.choice))),
                ("slower", name, value, float(np.mean(chosen == SLOWER))),
                ("faster", name, value, float(np.mean(chosen == FASTER))),
            ]
    for question, choice in (("slower", SLOWER), ("faster", FASTER)):
        found.append((question, "natural", np.nan, float(np.mean(moments.choice == choice))))
    return found


def _saliencies(who: Agent, moments: _Moments, pair: int) -> Answers:
    inputs = moments.seen.shape[1]
    groups = {name: group for name, group in _GROUPS.items() if group.stop <= inputs}
    rng = stream(pair, "why_inside", "flips")
    slopes = saliency(who.network, moments.seen, groups)
    changed = flips(who.network, moments.seen, groups, rng)
    return [("gradient", name, np.nan, value) for name, value in slopes.items()] + [
        ("flips", name, np.nan, value) for name, value in changed.items()
    ]


def _probes(config: Config, who: Agent, moments: _Moments) -> Answers:
    """Read the crash from what is known, and from what the network makes of it."""
    seen, q, l_hat = moments.seen, moments.q[:, None], moments.l_hat[:, None]
    hidden = who.network.hidden(seen)
    readings = {
        "features": hidden,
        "features and q": np.hstack([hidden, q]),
        "inputs without q": seen[:, : _WIDTH + 1],
        "inputs with q": np.hstack([seen[:, : _WIDTH + 1], q]),
        "q": q,
        "l_hat": l_hat,
        "l_hat and q": np.hstack([l_hat, q]),
        "speed": moments.speed[:, None],
    }
    if who.hearing.view.quantiles:
        silent = seen.copy()
        silent[:, _GROUPS["q"]] = 0.0
        readings["features, q at 0"] = who.network.hidden(silent)
    return [
        ("probe", name, np.nan, _read(reading, moments, config.ridge))
        for name, reading in readings.items()
    ]


def _read(reading: NDArray[np.floating], moments: _Moments, ridge: float) -> float:
    early, late = ~moments.late, moments.late
    model = fit_logistic(reading[early], moments.crash[early], ridge=ridge)
    return auc(model.log_odds(reading[late]), moments.crash[late])


def _risks(moments: _Moments) -> Answers:
    """Say how much better than chance braking is told, on episodes that were not fitted."""
    slower, early, late = moments.choice == SLOWER, ~moments.late, moments.late
    q, product = moments.q[:, None], (moments.q * moments.l_hat)[:, None]
    readings = {
        "q": q,
        "q and q l_hat": np.hstack([q, product]),
        "q and l_hat": np.hstack([q, moments.l_hat[:, None]]),
    }
    null = fit_logistic(np.zeros((int(early.sum()), 1)), slower[early])
    base = null.log_likelihood(np.zeros((int(late.sum()), 1)), slower[late])
    return [
        (
            "risk",
            name,
            np.nan,
            2
            * (fit_logistic(x[early], slower[early]).log_likelihood(x[late], slower[late]) - base),
        )
        for name, x in readings.items()
    ]
