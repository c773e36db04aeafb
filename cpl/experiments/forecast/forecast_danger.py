"""Does anything that is forecast tell a crash three seconds ahead?

The switch reads l_hat + q as danger. Here every step of test episodes is asked whether a crash
follows within three seconds, and every number a policy could look at is judged by the area under
its ROC curve: the forecast, the quantile, their sum, other methods' sums, the present distance, the
car's own speed, and a classifier that was trained for just that on the same inputs, in the range of
training as everything else, or, to say what the inputs could tell at all, on drives of pi_speed in
the very range where it is judged. Beside it, how much of the evaluation lies outside the training
range at all. Paper: Section IV-D and IV-F.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import RunningMax, track
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained import base_policies
from cpl.experiments.trained.forecasters import crash_classifier, forecaster
from cpl.experiments.trained.needs import needs_of_pair
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import base_policy
from cpl.forecast.measures import auc
from cpl.forecast.rollouts import Rollouts, collect, join
from cpl.forecast.schedule import Moments, Schedule
from cpl.forecast.suite import PREDICTOR, crash_labels
from cpl.rng import stream
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_VALIDATION, _TEST = 10_000_000, 20_000_000  # first environment seeds; training lies below
_LENGTH, _HORIZON = 5, 3  # observations in a history; [steps] how far the forecast looks
_SMALL = 0.005  # a feature that varies less keeps its scale: `presence` is nearly always 1
_OTHERS = ("dropout", "ensemble", "hau", "certificates")

Floats = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The episodes.

    Attributes:
        pairs: Pairs of base policies, each with its own forecasters.
        models: Profile that trained both.
        episodes: Test episodes of each policy and range.
        reference: Episodes of each policy in the training range that say what is inside it; their
            environment seeds lie below those of the tests.
        lessons: Validation episodes of pi_speed in each range, from which a classifier learns that
            knows the range.
        epochs: Most epochs of its training.
        top_speeds_mps: Upper ends of the speed ranges, that of the training first [m/s].
        alpha: Miscoverage that the quantile aims at [-].
        c: Its step as a share of the largest score so far [-].
        margin_mps: How much faster than in the training range counts as outside [m/s].
    """

    pairs: Count
    models: Models = "paper"
    episodes: Count
    reference: Count = 500
    lessons: Count = 4000
    epochs: Count = 20
    top_speeds_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    alpha: float = 0.1
    c: float = 0.1
    margin_mps: float = 0.1


PROFILES = {
    "smoke": Config(pairs=1, models="smoke", episodes=6, reference=6, lessons=20, epochs=1),
    "book": Config(pairs=1, episodes=60, reference=60, lessons=400),
    "paper": Config(pairs=10, episodes=500),
}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one pair in every range, and judge every number by the crashes that follow.

    Returns:
        One number a row: `pair`, `top_speed_mps`, `policy` (`safe`, `speed`, or `both` pooled),
        `quantity` (`auc`, `crash within 3 s`, `too fast`, `outside`), `signal` (what is judged,
        empty elsewhere), `value` and `n` (steps). `too fast` is the share of steps faster than the
        training range; `outside` the share with a number in the history that no history of the
        training range has.
    """
    pair = shard.number("pair")
    drivers = {kind: base_policy(inputs, kind, pair) for kind in base_policies.KINDS}
    base = base_policies.PROFILES[config.models]

    def driven(
        top: float, first: int, count: int, kinds: Sequence[str] = base_policies.KINDS
    ) -> dict[str, Rollouts]:
        road = base_policies.road(replace(base, top_speed_mps=top), "speed")
        return {kind: collect(road, drivers[kind], first + np.arange(count)) for kind in kinds}

    trained = join(
        driven(config.top_speeds_mps[0], _TEST - config.reference, config.reference).values()
    )
    inside = _histories(trained, trained.moments(length=_LENGTH, horizon=0))
    limits = inside.min(axis=0), inside.max(axis=0)
    rows: list[dict[str, object]] = []
    for top in config.top_speeds_mps:
        lessons = driven(top, _VALIDATION, config.lessons, ["speed"])["speed"]
        local = _learned(lessons, config.epochs, stream(pair, "forecast_danger", int(top)))
        seen = driven(top, _TEST, config.episodes)
        for policy, rollouts in {**seen, "both": join(seen.values())}.items():
            known = local if policy == "speed" else None
            told = _judged(config, inputs, pair, rollouts, limits, known)
            rows += [{"top_speed_mps": top, "policy": policy, **row} for row in told]
    table = pd.DataFrame(rows)
    table.insert(0, "pair", pair)
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair-{pair}", pair="pairs"),
    needs=needs_of_pair,
    label="simulated",
    extent=("pairs",),
    rtol=1e-6,
)


def _learned(
    lessons: Rollouts, epochs: int, rng: np.random.Generator
) -> Callable[[NDArray[np.float32]], Floats]:
    """Train a classifier of crashes, of the predictor's shape, where it is going to be used."""
    from cpl.forecast.training import fit  # torch takes seconds to import

    places, crash = crash_labels(lessons, length=_LENGTH, horizon=_HORIZON)
    flat = _histories(lessons, places)
    center, spread = flat.mean(axis=0), flat.std(axis=0)
    scale = np.where(spread < _SMALL, np.float32(1.0), spread)
    aside = (places // lessons.obs.shape[1]) % 10 == 0  # one episode of ten says when to stop
    data = Moments(
        (flat - center) / scale,
        crash.astype(np.float32),
        np.flatnonzero(~aside),
        np.flatnonzero(aside),
    )
    sizes = (flat.shape[1], *PREDICTOR, 1)
    network = fit(sizes, data, Schedule(epochs=epochs), rng, loss="cross entropy").network
    return lambda histories: network((histories - center) / scale)[:, 0]


def _judged(
    config: Config,
    inputs: Inputs,
    pair: int,
    rollouts: Rollouts,
    limits: tuple[Floats, Floats],
    local: Callable[[NDArray[np.float32]], Floats] | None,
) -> Iterator[dict[str, object]]:
    places, crash = crash_labels(rollouts, length=_LENGTH, horizon=_HORIZON)
    flat = _histories(rollouts, places)
    speed = rollouts.speed.ravel()[places]
    too_fast = speed > config.top_speeds_mps[0] + config.margin_mps
    outside = ((flat < limits[0]) | (flat > limits[1])).any(axis=1)
    shares = {"crash within 3 s": crash, "too fast": too_fast, "outside": outside}
    for quantity, flags in shares.items():
        yield {"quantity": quantity, "signal": "", "value": flags.mean(), "n": len(flags)}
    l_hat, _ = forecaster(inputs, "conformal", pair, calibrated=False)(flat)
    q = _issued(config, inputs, pair, rollouts)[places]
    signals = {
        "l_hat": l_hat,
        "q": q,
        "l_hat + q": l_hat + q,
        "l_tilde now": rollouts.l_tilde.ravel()[places],
        "own speed": speed,
        "classifier": crash_classifier(inputs, pair)(flat)[:, 0],
    }
    if local is not None:
        signals["classifier, trained there"] = local(flat)
    for method in _OTHERS:
        guess, u = forecaster(inputs, method, pair, calibrated=True)(flat)
        signals[f"{method}: l_hat + u"] = guess if u is None else guess + u
        signals[f"{method}: u"] = guess if u is None else u
    for name, signal in signals.items():
        yield {"quantity": "auc", "signal": name, "value": auc(signal, crash), "n": len(crash)}


def _histories(rollouts: Rollouts, places: NDArray[np.int64]) -> NDArray[np.float32]:
    return rollouts.histories(_LENGTH)[places - (_LENGTH - 1)]


def _issued(config: Config, inputs: Inputs, pair: int, rollouts: Rollouts) -> Floats:
    """The default tracker's q, reset in each episode, at every place; NaN without a forecast."""
    places = rollouts.moments(length=_LENGTH, horizon=0)
    l_hat, _ = forecaster(inputs, "conformal", pair, calibrated=False)(_histories(rollouts, places))
    forecast = np.full(rollouts.l_tilde.shape, np.nan)
    forecast.ravel()[places] = l_hat
    q = np.full(rollouts.l_tilde.shape, np.nan)
    rule = RunningMax(c=config.c)
    for e, steps in enumerate(rollouts.steps.tolist()):
        made = slice(_LENGTH - 1, max(steps + 1 - _HORIZON, _LENGTH - 1))
        truth = rollouts.l_tilde[e, _LENGTH - 1 + _HORIZON : steps + 1]
        scores = np.abs(truth - forecast[e, made])
        # Forecasts too late to be checked have a quantile too: the last scores are never fed back.
        late = np.zeros(max(steps + 1 - (_LENGTH - 1), 0) - len(scores))
        known = np.concatenate([scores, late])
        q[e, _LENGTH - 1 : steps + 1] = track(known, rule, alpha=config.alpha, delay=_HORIZON).q
    return q.ravel()
