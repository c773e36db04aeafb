"""A suite of networks as one file, and the forecasters that come out of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cpl.forecast.errors import WrongModelError
from cpl.forecast.methods import (
    METHODS,
    Certificates,
    Constant,
    Dropout,
    Ensemble,
    Forecaster,
    Heteroscedastic,
    Plain,
    calibrate,
)
from cpl.forecast.rollouts import Rollouts
from cpl.forecast.suite import Settings, Suite
from cpl.network import MLP, DamagedModelError, Model, decode_networks, encode_networks

__all__ = ["crash_classifier", "forecaster", "read_suite", "scales", "write_suite"]

_SCALED = ("none", "dropout", "ensemble", "hau", "certificates")


def scales(
    suite: Suite,
    rollouts: Rollouts,
    episodes: np.ndarray,
    settings: Settings,
    rng: np.random.Generator,
    *,
    alpha: float,
) -> dict[str, float]:
    """Calibrate every method on episodes that nothing was trained on.

    Args:
        suite: the networks.
        rollouts: the episodes, in the training range.
        episodes: bool (E,), those kept for calibration.
        settings: those of the training.
        rng: draws the dropped units.
        alpha: miscoverage aimed at [-].

    Returns:
        The scale of each method; that of "none" is a constant quantile of the scores.
    """
    places = rollouts.moments(length=settings.length, horizon=settings.horizon, episodes=episodes)
    flat = rollouts.histories(settings.length)[places - (settings.length - 1)]
    truth = rollouts.l_tilde.ravel()[places + settings.horizon]
    model = Model(networks=dict(suite.networks), arrays=dict(suite.arrays), config={})
    found: dict[str, float] = {}
    for method in _SCALED:
        l_hat, u = _made(model, method, 1.0, rng, settings.members, settings.dropout)(flat)
        found[method] = calibrate(np.abs(truth - l_hat), None if method == "none" else u, alpha)
    return found


def write_suite(
    suite: Suite, found: Mapping[str, float], settings: Settings, config: Mapping[str, Any]
) -> bytes:
    """Write networks and scales as one safetensors file.

    Args:
        suite: the networks.
        found: what `scales` returned.
        settings: those of the training.
        config: what else tells where they come from.
    """
    config = {
        **config,
        "members": settings.members,
        "dropout": settings.dropout,
        "length": settings.length,
        "horizon": settings.horizon,
        "scales": dict(found),
    }
    return encode_networks(suite.networks, config, suite.arrays)


def read_suite(content: bytes, *, length: int, horizon: int) -> Model:
    """Read a file of `write_suite` back.

    Args:
        content: the file.
        length: observations in a history that the caller has.
        horizon: steps ahead that the caller scores.

    Raises:
        cpl.store.DamagedModelError: if it is not whole.
        WrongModelError: if it holds something else, or was trained for another task.
    """
    model = decode_networks(content)
    for name, asked in (("length", length), ("horizon", horizon)):
        have = model.config.get(name)
        if have != asked:
            raise WrongModelError(f"the model must have {name} {asked!r}, got {have!r}")
    missing = {"plain", "dropout", "hau", "crash", "ensemble0"} - model.networks.keys()
    if missing or not {"certificates_weight", "certificates_bias"} <= model.arrays.keys():
        raise WrongModelError(f"the model must hold a suite, missing {sorted(missing)}")
    return model


def forecaster(
    model: Model, method: str, *, calibrated: bool, rng: np.random.Generator
) -> Forecaster:
    """Make a forecaster of a method.

    Args:
        model: what `read_suite` returned.
        method: of `METHODS`; "conformal" and "none" share one network, and "none", calibrated, has
            the constant of split conformal prediction for an uncertainty.
        calibrated: whether the uncertainty covers 90 % of the training range; else as published.
        rng: draws the dropped units of "dropout"; the others do not use it.

    Raises:
        ValueError: if there is no such method.
        WrongModelError: if the model has no usable scale for it.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {METHODS}, got {method!r}")
    config = model.config
    scale = 1.0
    if method == "conformal" or (method == "none" and not calibrated):
        return Plain(_network(model, "plain"))
    if calibrated:
        scale = config.get("scales", {}).get(method)
        if not isinstance(scale, float) or not np.isfinite(scale):
            raise WrongModelError(
                f"the model must have a finite scale of {method!r}, got {scale!r}"
            )
        if method == "none":
            return Constant(_network(model, "plain"), scale)
    return _made(model, method, scale, rng, int(config["members"]), float(config["dropout"]))


def crash_classifier(model: Model) -> MLP:
    """Return the network that gives the probability of a crash within the horizon."""
    return _network(model, "crash")


def _made(
    model: Model, method: str, scale: float, rng: np.random.Generator, members: int, rate: float
) -> Forecaster:
    match method:
        case "dropout":
            return Dropout(_network(model, "dropout"), rng, rate=rate, scale=scale)
        case "ensemble":
            each = [_network(model, f"ensemble{k}") for k in range(members)]
            return Ensemble(each, scale)
        case "hau":
            return Heteroscedastic(_network(model, "hau"), scale)
        case "certificates":
            weight, bias = (model.arrays[f"certificates_{part}"] for part in ("weight", "bias"))
            return Certificates(_network(model, "plain"), weight, bias, scale)
        case _:
            return Plain(_network(model, "plain"))


def _network(model: Model, name: str) -> MLP:
    try:
        return model.network(name)
    except DamagedModelError as error:
        raise WrongModelError(str(error)) from error
