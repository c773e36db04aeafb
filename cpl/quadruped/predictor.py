"""How likely is a SLAM error two steps from now? The trained network, in numpy alone.

    l_hat = sigmoid(w2 . relu(W1 (x - mean) / std + b1) + b2)

Paper: Section V-B, "a one-layer MLP with 128 neurons and a single output". The activation is not
stated; ReLU is the ruling (contradiction 11). The file is safetensors beside a JSON with its
SHA-256: nothing is unpickled.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.features import FEATURES
from cpl.store import atomic_write

__all__ = ["Predictor", "load_predictor", "save_predictor", "unweighted"]

_SHAPES = {
    "mean": (len(FEATURES),),
    "std": (len(FEATURES),),
    "w1": (None, len(FEATURES)),
    "b1": (None,),
    "w2": (None,),
    "b2": (),
}


@dataclass(frozen=True, kw_only=True)
class Predictor:
    """The network's weights.

    Args:
        mean: Mean of each feature, shape (47,).
        std: Scale of each feature, shape (47,), above 0.
        w1: Hidden weights, shape (units, 47).
        b1: Hidden biases, shape (units,).
        w2: Output weights, shape (units,).
        b2: Output bias, shape ().
    """

    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    w1: NDArray[np.float64]
    b1: NDArray[np.float64]
    w2: NDArray[np.float64]
    b2: NDArray[np.float64]

    def __post_init__(self) -> None:
        units = np.shape(self.w2)[0] if np.ndim(self.w2) == 1 else -1
        for name, pattern in _SHAPES.items():
            array = np.asarray(getattr(self, name), dtype=np.float64)
            expected = tuple(units if n is None else n for n in pattern)
            if array.shape != expected:
                raise ValueError(f"{name} must have shape {expected}, not {array.shape}")
            if not np.isfinite(array).all():
                raise ValueError(f"{name} must be finite, not {array.tolist()}")
            object.__setattr__(self, name, array)
        if not (self.std > 0).all():
            raise ValueError(f"std must be above 0, not {self.std.tolist()}")

    def __call__(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the predicted probability of an error at t + 2.

        Args:
            features: Shape (..., 47).

        Returns:
            Shape (...), in [0, 1].
        """
        hidden = np.maximum((features - self.mean) / self.std @ self.w1.T + self.b1, 0.0)
        logit = hidden @ self.w2 + self.b2
        return 0.5 * (1.0 + np.tanh(0.5 * logit))  # a sigmoid that cannot overflow


def unweighted(l_hat: float, weight: float) -> float:
    """Return the probability that a network trained with positive weight `weight` means.

        p = l_hat / (l_hat + weight (1 - l_hat))

    A perfect network trained with weight 5 says .8 where the truth is .444 (contradiction 8).

    Args:
        l_hat: The network's output [-].
        weight: The weight of positive samples in the loss [-], above 0.

    Raises:
        ValueError: An argument outside its range.

    >>> round(unweighted(0.8, 5.0), 3)
    0.444
    """
    if not 0 <= l_hat <= 1:
        raise ValueError(f"l_hat must be in [0, 1], not {l_hat}")
    if not weight > 0:
        raise ValueError(f"weight must be above 0, not {weight}")
    return l_hat / (l_hat + weight * (1 - l_hat))


def save_predictor(predictor: Predictor, stem: Path | str, about: Mapping[str, Any]) -> Path:
    """Write STEM.safetensors, then STEM.json with its checksum and what the caller says about it.

    Args:
        predictor: The weights.
        stem: The files' path without suffix.
        about: How it was trained: anything JSON can hold.

    Returns:
        The path of the JSON.
    """
    from safetensors.numpy import save

    stem = Path(stem)
    payload = save({name: np.array(getattr(predictor, name), order="C") for name in _SHAPES})
    sidecar = {
        "sha256": hashlib.sha256(payload).hexdigest(),
        "features": list(FEATURES),
        "about": dict(about),
    }
    atomic_write(stem.with_suffix(".safetensors"), payload)
    return atomic_write(stem.with_suffix(".json"), json.dumps(sidecar, indent=2) + "\n")


def load_predictor(stem: Path | str) -> tuple[Predictor, dict[str, Any]]:
    """Read what `save_predictor` wrote and check it.

    Args:
        stem: The files' path without suffix.

    Returns:
        The predictor and what was said about it.

    Raises:
        ValueError: The checksum, the features' order or a shape is not as it must be.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    stem = Path(stem)
    try:
        sidecar = json.loads(stem.with_suffix(".json").read_text(encoding="utf-8"))
        sha256, features, about = sidecar["sha256"], sidecar["features"], sidecar["about"]
    except (json.JSONDecodeError, UnicodeDecodeError, KeyError, TypeError) as error:
        raise ValueError(f"stem {stem.name}: its JSON is unusable ({error})") from error
    payload = stem.with_suffix(".safetensors").read_bytes()
    if (found := hashlib.sha256(payload).hexdigest()) != sha256:
        raise ValueError(f"stem {stem.name}: the weights have SHA-256 {found}, not {sha256}")
    if tuple(features) != FEATURES:
        raise ValueError(f"stem {stem.name}: its features are {features}, not {list(FEATURES)}")
    try:
        tensors = load(payload)
    except SafetensorError as error:
        raise ValueError(f"stem {stem.name}: not a safetensors file ({error})") from error
    if set(tensors) != set(_SHAPES):
        raise ValueError(f"stem {stem.name}: tensors {sorted(tensors)}, not {sorted(_SHAPES)}")
    return Predictor(**tensors), about
