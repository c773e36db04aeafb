"""Train everything that the paper's comparison needs from one set of rollouts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from cpl.forecast.certificates import fit_certificates
from cpl.forecast.methods import features
from cpl.forecast.rollouts import Rollouts
from cpl.forecast.schedule import Epoch, Fit, Loss, Moments, Schedule
from cpl.network import MLP

__all__ = ["PREDICTOR", "Settings", "Split", "Suite", "crash_labels", "learn", "split"]

PREDICTOR = (64, 128, 64)
"""Hidden layers of the predictor (Section IV, Predictor Training)."""

_SMALL = 0.005  # a feature that varies less keeps its scale: `presence` is nearly always 1


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is learned, and how.

    Attributes:
        length: Observations in a history.
        horizon: Steps ahead [steps].
        schedule: When the training of a network ends.
        dropout: Probability with which a hidden unit is dropped [-].
        members: Networks in the ensemble, each with a disjoint part of the training episodes.
        certificates: Orthonormal certificates.
        certificate_epochs: Epochs of their training.
    """

    length: int = 5
    horizon: int = 3
    schedule: Schedule = field(default_factory=lambda: Schedule(epochs=60))
    dropout: float = 0.1
    members: int = 5
    certificates: int = 100
    certificate_epochs: int = 100


@dataclass(frozen=True, eq=False)
class Suite:
    """What was learned.

    Attributes:
        networks: "plain", "dropout", "ensemble0" ..., "hau" and "crash", for observations as they
            come from the road.
        arrays: the certificates, "certificates_weight" and "certificates_bias".
        curves: losses of every network, an entry an epoch.
        converged: whether each training ended by the rule.
    """

    networks: Mapping[str, MLP]
    arrays: Mapping[str, NDArray[np.float32]]
    curves: Mapping[str, tuple[Epoch, ...]]
    converged: Mapping[str, bool]


@dataclass(frozen=True, eq=False)
class Split:
    """Which episodes serve what, bool (E,) each; no episode serves two."""

    train: NDArray[np.bool_]
    validation: NDArray[np.bool_]
    calibration: NDArray[np.bool_]


def split(rollouts: Rollouts, rng: np.random.Generator, *, held_out: float = 0.1) -> Split:
    """Set episodes aside: one share to say when training ends, one to calibrate with.

    Args:
        rollouts: all of them.
        rng: which episodes.
        held_out: each of the two shares [-], in (0, 0.5).

    Raises:
        ValueError: if a share leaves one of the three empty.
    """
    count = round(held_out * len(rollouts))
    if count < 1 or len(rollouts) - 2 * count < 1:
        raise ValueError(
            f"held_out must leave episodes for all three parts, got {held_out!r} of"
            f" {len(rollouts)} episodes"
        )
    place = np.argsort(rng.permutation(len(rollouts)))
    return Split(
        train=place >= 2 * count,
        validation=place < count,
        calibration=(place >= count) & (place < 2 * count),
    )


def learn(
    rollouts: Rollouts,
    parts: Split,
    settings: Settings,
    stream: Callable[[str], np.random.Generator],
) -> Suite:
    """Train the predictor, its uncertainty baselines and a classifier of crashes.

    Inputs are standardised by feature while training, and the standardisation is then folded into
    the first layer: the network is the paper's, and converges in a fraction of the epochs.

    Args:
        rollouts: what to learn from.
        parts: which episodes train, and which say when to stop.
        settings: what and how.
        stream: the random generator of each network, by its name.

    Returns:
        The networks.

    Raises:
        NoRolloutsError: if the rollouts have no sample for one of the parts.
        TrainingDivergedError: if a loss becomes NaN or infinite.
    """
    from cpl.forecast.training import fit  # torch takes seconds to import

    center, scale = _standard(rollouts, parts.train)
    data = replace(rollouts, obs=(rollouts.obs - center) / scale)
    inputs = data.histories(settings.length)
    shift = settings.length - 1
    targets = np.zeros(len(inputs), np.float32)
    ahead = data.l_tilde.ravel()[shift + settings.horizon :]
    targets[: len(ahead)] = ahead

    def rows(episodes: NDArray[np.bool_]) -> NDArray[np.int64]:
        places = data.moments(length=settings.length, horizon=settings.horizon, episodes=episodes)
        return places - shift

    fits: dict[str, Fit] = {}
    moments = Moments(inputs, targets, rows(parts.train), rows(parts.validation))

    def train(name: str, samples: Moments, loss: Loss = "mse", dropout: float = 0.0) -> None:
        sizes = (inputs.shape[1], *PREDICTOR, 2 if loss == "gaussian" else 1)
        rng = stream(name)
        fits[name] = fit(sizes, samples, settings.schedule, rng, loss=loss, dropout=dropout)

    train("plain", moments)
    train("dropout", moments, dropout=settings.dropout)
    train("hau", moments, "gaussian")
    member = np.cumsum(parts.train) % settings.members
    for k in range(settings.members):
        train(f"ensemble{k}", moments._replace(train=rows(parts.train & (member == k))))
    train("crash", _crash_moments(data, inputs, parts, settings), "cross entropy")

    phi = features(fits["plain"].network, inputs[moments.train])
    found = fit_certificates(
        phi,
        stream("certificates"),
        k=settings.certificates,
        epochs=settings.certificate_epochs,
        lr=settings.schedule.lr,
    )
    curves = {name: each.curve for name, each in fits.items()}
    curves["certificates"] = tuple(Epoch(value, np.nan) for value in found.curve)
    tiled = np.tile(center, settings.length), np.tile(scale, settings.length)
    return Suite(
        networks={name: _folded(each.network, *tiled) for name, each in fits.items()},
        arrays={"certificates_weight": found.weight, "certificates_bias": found.bias},
        curves=curves,
        converged={name: each.converged for name, each in fits.items()},
    )


def crash_labels(
    rollouts: Rollouts, *, length: int, horizon: int, episodes: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Say of every moment with a history whether a crash follows within `horizon` steps.

    Moments of which that is not known, just before an episode's end without a crash, are left out.

    Args:
        rollouts: the episodes.
        length: observations in a history.
        horizon: steps [steps].
        episodes: bool (E,), whose; all unless given.

    Returns:
        Places in the flattened observations, as `Rollouts.moments` gives them, and the labels.

    Raises:
        NoRolloutsError: if there is no such moment.
    """
    places = rollouts.moments(length=length, horizon=0, episodes=episodes)
    episode, time = np.divmod(places, rollouts.obs.shape[1])
    left = rollouts.steps[episode] - time
    crashed = rollouts.crashed[episode]
    known = np.where(crashed, left > 0, left >= horizon)
    return places[known], (crashed & (left <= horizon))[known]


def _crash_moments(
    data: Rollouts, inputs: NDArray[np.float32], parts: Split, settings: Settings
) -> Moments:
    targets = np.zeros(len(inputs), np.float32)
    rows: list[NDArray[np.int64]] = []
    for episodes in (parts.train, parts.validation):
        places, crash = crash_labels(
            data, length=settings.length, horizon=settings.horizon, episodes=episodes
        )
        rows.append(places - (settings.length - 1))
        targets[rows[-1]] = crash
    return Moments(inputs, targets, *rows)


def _standard(
    rollouts: Rollouts, episodes: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Mean and spread of each feature over the observations of some episodes."""
    there = np.arange(rollouts.obs.shape[1]) <= rollouts.steps[:, None]
    seen = rollouts.obs[there & episodes[:, None]]
    center = seen.mean(axis=0, dtype=np.float64)
    spread = seen.std(axis=0, dtype=np.float64)
    scale = np.where(spread < _SMALL, 1.0, spread)
    return center.astype(np.float32), scale.astype(np.float32)


def _folded(network: MLP, center: NDArray[np.float32], scale: NDArray[np.float32]) -> MLP:
    """Return the network that takes x where the given one takes (x - center) / scale."""
    first = network.weights[0].astype(np.float64) / scale[:, None]
    bias = network.biases[0] - center.astype(np.float64) @ first
    weights = (first.astype(np.float32), *network.weights[1:])
    return MLP(weights, (bias.astype(np.float32), *network.biases[1:]), network.output)
