"""How likely is a SLAM error two steps from now? The trained network, in numpy alone.

    l_hat = sigmoid(w2 . relu(W1 (x - mean) / std + b1) + b2)

Paper: Section V-B, "a one-layer MLP with 128 neurons and a single output". The activation is not
stated; ReLU is the ruling (contradiction 11). It is kept as safetensors with a digest of its own:
nothing is unpickled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.features import FEATURES
from cpl.store import DamagedModelError, decode_model, encode_model

__all__ = ["Predictor", "decode_predictor", "encode_predictor", "unweighted"]

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


def encode_predictor(predictor: Predictor, about: Mapping[str, Any]) -> bytes:
    """Return the network as one safetensors file, to the last bit.

    Args:
        predictor: The weights.
        about: How it was trained: anything JSON can hold.

    >>> net = Predictor(mean=np.zeros(47), std=np.ones(47), w1=np.ones((1, 47)), b1=np.zeros(1),
    ...                 w2=np.ones(1), b2=np.zeros(()))
    >>> decode_predictor(encode_predictor(net, {"seed": 3}))[1]
    {'seed': 3}
    """
    arrays = {name: np.array(getattr(predictor, name), order="C") for name in _SHAPES}
    return encode_model(arrays, {"about": dict(about), "features": list(FEATURES)})


def decode_predictor(content: bytes) -> tuple[Predictor, dict[str, Any]]:
    """Read what `encode_predictor` returned and check it.

    Args:
        content: Its bytes.

    Returns:
        The predictor and what was said about it.

    Raises:
        DamagedModelError: The bytes are not what was written, or not a predictor.
    """
    model = decode_model(content)
    features, about = model.config.get("features"), model.config.get("about")
    if features != list(FEATURES):
        raise DamagedModelError(f"features must be {list(FEATURES)}, got {features}")
    if set(model.arrays) != set(_SHAPES) or not isinstance(about, dict):
        raise DamagedModelError(f"arrays must be {sorted(_SHAPES)}, got {sorted(model.arrays)}")
    try:
        return Predictor(**model.arrays), about
    except ValueError as error:
        raise DamagedModelError(f"the model is no predictor: {error}") from error
