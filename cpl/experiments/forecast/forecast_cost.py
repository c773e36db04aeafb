"""What does each estimate of uncertainty cost, in weights, in arithmetic and in time?

The paper says that its method "adds relatively no extra computation", needs "no changes to the
model", and that ensembles "increase the runtime computation budget fivefold" (Section IV-F).
Counted are the weights and operations of the trained forecasters; timed is a forecast, and an
update of the quantile, per road in a batch on one core, and both for one road alone, where calling
a function costs more than what it computes.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.conformal import BatchTracker, RunningMax, Tracker, track_many
from cpl.experiments.run.spec import Experiment, Inputs, Shard, whole
from cpl.experiments.trained.forecasters import forecaster, need_forecasters
from cpl.experiments.trained.pairs import Models
from cpl.forecast.methods import METHODS, Certificates, Dropout, Ensemble, Forecaster
from cpl.network import MLP
from cpl.rng import stream
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_UPDATE = 6  # operations of an update: |l - l_hat|, >, max, *, *, +
_STEPS = 400  # scores a stream in the timing of whole sequences


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """What is timed.

    Attributes:
        models: Profile that trained the forecasters; those of pair 0 are measured.
        batch: Roads in a batch.
        rounds: How often each is timed; the fastest counts, since noise only adds time.
        seed: Draws histories and scores.
    """

    models: Models = "paper"
    batch: Count = 256
    rounds: Count = 60
    seed: int = 0


PROFILES = {
    "smoke": Config(models="smoke", rounds=3),
    "book": Config(rounds=20),
    "paper": Config(rounds=400),
}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Count and time.

    Returns:
        One row a method, with the additional rows `update` (the quantile's, online, in the batch),
        `update, compiled` (the same over whole sequences), and `none, one road` and `update, one
        road` (a batch of one, as a robot has it): `method`, `networks`, `parameters`
        (of all its networks), `passes` (forward passes a forecast), `operations` (multiplications
        and additions a forecast), `weights_changed` (weights and biases of the forecasting network
        that are not those of "none") and `seconds` (a forecast or an update, per road).
    """
    del shard
    made = {name: forecaster(inputs, name, 0, calibrated=False) for name in METHODS}
    rng = stream(config.seed, "forecast_cost")
    width = _networks(made["none"])[0].sizes[0]
    flat = rng.uniform(-1, 1, (config.batch, width)).astype(np.float32)
    scores = rng.uniform(0, 1, (config.batch, _STEPS))
    rule, how = RunningMax(c=0.1), {"alpha": 0.1, "delay": 3}
    tracker, alone = BatchTracker(rule, config.batch, **how), Tracker(rule, **how)
    timed: dict[str, Callable[[], object]] = {
        name: (lambda make=make: make(flat)) for name, make in made.items()
    }
    timed["update"] = lambda: tracker.update(scores[:, 0])
    timed["update, compiled"] = lambda: track_many(scores, rule, **how)
    timed["none, one road"] = lambda: [made["none"](flat[k : k + 1]) for k in range(len(flat))]
    timed["update, one road"] = lambda: [alone.update(score) for score in scores[:, 0].tolist()]
    seconds = _fastest(timed, config.rounds)
    seconds["update, compiled"] /= _STEPS
    plain = _networks(made["none"])
    rows = [
        {
            "method": name,
            "networks": len(_networks(make)),
            "parameters": _parameters(make),
            "passes": _passes(make),
            "operations": _operations(make),
            "weights_changed": _changed(_networks(make), plain),
        }
        for name, make in made.items()
    ]
    nothing = dict.fromkeys(("networks", "parameters", "passes", "weights_changed"), 0)
    rows.append({**rows[METHODS.index("none")], "method": "none, one road"})
    rows += [
        {"method": name, **nothing, "operations": _UPDATE}
        for name in ("update", "update, compiled", "update, one road")
    ]
    table = pd.DataFrame(rows)
    table["seconds"] = [seconds[name] / config.batch for name in table["method"]]
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=whole,
    needs=lambda config, shard: [need_forecasters(config.models, 0)],
    label="measured",
    rtol=20.0,  # times differ between machines; what is counted is compared exactly
)


def _fastest(subjects: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    best = dict.fromkeys(subjects, np.inf)
    for _ in range(rounds):
        for name, call in subjects.items():
            call()  # compiles, and brings into the caches what the one before has displaced
            begun = time.process_time()
            call()
            best[name] = min(best[name], time.process_time() - begun)
    return best


def _networks(make: Forecaster) -> list[MLP]:
    return list(make.networks) if isinstance(make, Ensemble) else [make.network]


def _passes(make: Forecaster) -> int:
    return make.passes if isinstance(make, Dropout) else len(_networks(make))


def _parameters(make: Forecaster) -> int:
    own = make.weight.size + make.bias.size if isinstance(make, Certificates) else 0
    return own + sum(net.parameter_count for net in _networks(make))


def _operations(make: Forecaster) -> int:
    """Two for each weight: a multiplication and an addition."""
    own = 2 * make.weight.size if isinstance(make, Certificates) else 0
    one = 2 * sum(w.size for w in _networks(make)[0].weights)
    return own + _passes(make) * one


def _changed(networks: list[MLP], plain: list[MLP]) -> int:
    """Count the numbers of networks that are not, bit for bit, those of the plain one."""
    total = 0
    for net in networks:
        if net.sizes != plain[0].sizes:
            total += net.parameter_count
            continue
        own = (*net.weights, *net.biases)
        theirs = (*plain[0].weights, *plain[0].biases)
        total += sum(int((a != b).sum()) for a, b in zip(own, theirs, strict=True))
    return total
