"""How well can three seconds be foreseen, in the range of training and beyond it?

For each pair of base policies: 30k rollouts in [20, 30] m/s, the paper's predictor and every
network that its comparison needs, and their errors on validation seeds in three speed ranges.
Paper: Section IV, Predictor Training and Baselines.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, Literal, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained import base_policies
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import base_policy, need_policies
from cpl.forecast.measures import skill
from cpl.forecast.methods import METHODS
from cpl.forecast.rollouts import Rollouts, collect, join
from cpl.forecast.schedule import Schedule
from cpl.forecast.stored import forecaster, read_suite, scales, write_suite
from cpl.forecast.suite import Settings as SuiteSettings
from cpl.forecast.suite import Suite, learn, split
from cpl.highway import Config as Road
from cpl.rng import stream
from cpl.settings.ranges import Choice, Count, Probability, Settings, interval
from cpl.store import plain

__all__ = ["EXPERIMENT", "PROFILES", "Config", "road", "settings_of"]


_TRAINING = 10_000_000  # environment seeds of rollouts lie below, those of validation above
_NOMINAL = 1.6448536269514722  # standard deviations to each side of a Gaussian's middle 90 %
_QUANTITIES = ["mse", "skill", "mae", "mean_uncertainty", "coverage_raw", "coverage_calibrated"]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The forecasters.

    Attributes:
        pairs: Pairs of base policies, each with its own forecasters.
        policies: Profile of `base_policies` that trained them.
        rollouts: Episodes to learn from, half of them under each policy.
        length: Observations in a history.
        horizon: Steps ahead that is forecast [steps].
        cars: Which cars the distance l is taken to: `all` or `observed`.
        lr: Learning rate.
        batch: Samples in a step of training.
        tolerance: Relative improvement of the validation loss that counts [-].
        patience: Epochs without it after which a network has converged.
        epochs: Most epochs.
        dropout: Probability with which a hidden unit is dropped [-].
        members: Networks in the ensemble.
        certificates: Orthonormal certificates.
        certificate_epochs: Epochs of their training.
        alpha: Miscoverage that the uncertainties are calibrated to [-].
        top_speeds_mps: Upper ends of the speed ranges of the evaluation [m/s].
        episodes: Validation episodes of each policy and range.
    """

    pairs: Count
    policies: Models
    rollouts: Annotated[int, interval("[20, inf)")] = 30_000
    length: Count = 5
    horizon: Count = 3
    cars: Annotated[str, Choice(("all", "observed"))] = "all"
    lr: float = 1e-3
    batch: Count = 512
    tolerance: Probability = 0.01
    patience: Count = 3
    epochs: Count = 60
    dropout: Probability = 0.1
    members: Count = 5
    certificates: Count = 100
    certificate_epochs: Count = 100
    alpha: Probability = 0.1
    top_speeds_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    episodes: Count = 500


PROFILES = {
    "smoke": Config(
        pairs=1, policies="smoke", rollouts=120, epochs=3, episodes=10, certificate_epochs=2
    ),
    "book": Config(pairs=1, policies="paper", rollouts=1_500, epochs=12, episodes=100),
    "paper": Config(pairs=10, policies="paper"),
}


def settings_of(config: Config) -> SuiteSettings:
    """Return what `cpl.forecast` is told to learn."""
    return SuiteSettings(
        length=config.length,
        horizon=config.horizon,
        schedule=Schedule(
            lr=config.lr,
            batch=config.batch,
            tolerance=config.tolerance,
            patience=config.patience,
            epochs=config.epochs,
        ),
        dropout=config.dropout,
        members=config.members,
        certificates=config.certificates,
        certificate_epochs=config.certificate_epochs,
    )


def road(config: Config, top_speed_mps: float) -> Road:
    """Return the road that the policies were trained on, with another speed range."""
    base = base_policies.PROFILES[config.policies]
    return base_policies.road(replace(base, top_speed_mps=top_speed_mps), "speed")


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Collect, train, calibrate and judge.

    Returns:
        One number a row: `pair`, `subject` (a network or a method), `quantity`, `top_speed_mps`
        (NaN where no range applies), `policy` (`safe`, `speed`, `both`, or empty), `epoch` (0 where
        none applies), `value` and `n` (samples). Quantities: `train_loss` and `validation_loss` by
        epoch, `converged`, `parameters`, `scale` (calibration), and by range and policy `mse`,
        `skill` against persistence, `mae`, `mean_uncertainty` (as published), `coverage_raw` (of
        the nominal 90 %) and `coverage_calibrated`. The first row's `model` holds everything that
        was learned, the others' are empty.
    """
    pair = shard.number("pair")
    settings = settings_of(config)
    draw = partial(stream, pair, "forecasts")
    drivers = {kind: base_policy(inputs, kind, pair) for kind in base_policies.KINDS}
    seeds = draw("rollouts").choice(_TRAINING, config.rollouts, replace=False)
    which = cast("Literal['all', 'observed']", config.cars)
    trained_range = base_policies.PROFILES[config.policies].top_speed_mps
    rollouts = join(
        collect(road(config, trained_range), drive, seeds[k :: len(drivers)], number=k, cars=which)
        for k, drive in enumerate(drivers.values())
    )
    parts = split(rollouts, draw("split"))
    suite = learn(rollouts, parts, settings, draw)
    found = scales(
        suite, rollouts, parts.calibration, settings, draw("calibration"), alpha=config.alpha
    )
    content = write_suite(suite, found, settings, {"pair": pair, "parameters": plain(config)})
    del rollouts
    rows = [*_training_rows(suite, found, len(seeds))]
    for top in config.top_speeds_mps:
        seen = {
            kind: collect(
                road(config, top), drive, _TRAINING + np.arange(config.episodes), cars=which
            )
            for kind, drive in drivers.items()
        }
        rows += _judged(content, seen, top, config, draw)
    table = pd.DataFrame(rows)
    table.insert(0, "pair", pair)
    table["model"] = b""
    table.loc[0, "model"] = content
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair-{pair}", pair="pairs"),
    needs=lambda config, shard: [need_policies(config.policies, shard.number("pair"))],
    label="simulated",
    extent=("pairs",),
    rtol=1e-5,
)


def _row(subject: str, quantity: str, value: Any, n: int, **where: Any) -> dict[str, object]:  # noqa: ANN401
    return {
        "subject": subject,
        "quantity": quantity,
        "top_speed_mps": float(where.get("top", np.nan)),
        "policy": str(where.get("policy", "")),
        "epoch": int(where.get("epoch", 0)),
        "value": float(value),
        "n": n,
    }


def _training_rows(suite: Suite, found: dict[str, float], n: int) -> Iterator[dict[str, object]]:
    for name, curve in suite.curves.items():
        for number, losses in enumerate(curve, start=1):
            yield _row(name, "train_loss", losses.train, n, epoch=number)
            if np.isfinite(losses.validation):
                yield _row(name, "validation_loss", losses.validation, n, epoch=number)
    for name, network in suite.networks.items():
        yield _row(name, "parameters", network.parameter_count, 1)
        yield _row(name, "converged", suite.converged[name], len(suite.curves[name]))
    yield _row("certificates", "parameters", sum(a.size for a in suite.arrays.values()), 1)
    for method, scale in found.items():
        yield _row(method, "scale", scale, n)


def _judged(
    content: bytes,
    seen: dict[str, Rollouts],
    top: float,
    config: Config,
    draw: Any,  # noqa: ANN401
) -> Iterator[dict[str, object]]:
    model = read_suite(content, length=config.length, horizon=config.horizon)
    known = {kind: _known(rollouts, config) for kind, rollouts in seen.items()}
    known["both"] = tuple(np.concatenate(part) for part in zip(*known.values(), strict=True))
    for policy, (flat, now, truth) in known.items():
        n = len(truth)
        yield _row("persistence", "mse", np.mean((truth - now) ** 2), n, top=top, policy=policy)
        yield _row("persistence", "mae", np.mean(np.abs(truth - now)), n, top=top, policy=policy)
        for method in METHODS[1:]:
            rng = draw("judged", method, int(top), policy)
            raw = forecaster(model, method, calibrated=False, rng=rng)
            l_hat, u = raw(flat)
            score = np.abs(truth - l_hat)
            scale = model.config["scales"][method]
            values = {
                "mse": np.mean(score**2),
                "skill": skill(score, truth - now),
                "mae": np.mean(score),
                "coverage_calibrated": np.mean(score <= scale * (1.0 if u is None else u)),
            }
            if u is not None:
                values["mean_uncertainty"] = np.mean(u)
                values["coverage_raw"] = np.mean(score <= _NOMINAL * u)
            for quantity in _QUANTITIES:
                if quantity in values:
                    yield _row(method, quantity, values[quantity], n, top=top, policy=policy)


def _known(rollouts: Rollouts, config: Config) -> tuple[NDArray[np.float32], ...]:
    """Histories, l_tilde at their end, and l_tilde a horizon later."""
    places = rollouts.moments(length=config.length, horizon=config.horizon)
    l_tilde = rollouts.l_tilde.ravel()
    flat = rollouts.histories(config.length)[places - (config.length - 1)]
    return flat, l_tilde[places], l_tilde[places + config.horizon]
