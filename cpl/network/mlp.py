"""Weights, inference and the stored form of a multilayer perceptron."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from cpl.store import DamagedModelError, decode_model, encode_model

__all__ = ["MLP", "DamagedModelError", "Model", "decode_networks", "encode_networks"]

Output = Literal["linear", "sigmoid"]
Arrays = dict[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class MLP:
    r"""Dense layers with rectifiers between them.

    $$ h_0 = x, \quad h_{i+1} = \max(0, h_i W_i + b_i), \quad y = \sigma(h_n W_n + b_n) $$

    Args:
        weights: W_i, float32 (in_i, out_i), each layer's inputs the outputs of the one before.
        biases: b_i, float32 (out_i,).
        output: sigma of the last layer, "linear" (none) or "sigmoid".

    Raises:
        ValueError: if shapes do not fit, a number is not finite, or the output is unknown.

    Example:
        >>> net = MLP((np.eye(2, dtype=np.float32), np.ones((2, 1), np.float32)),
        ...           (np.zeros(2, np.float32), np.zeros(1, np.float32)))
        >>> net(np.array([[1.0, -5.0]], np.float32)).tolist(), net.sizes, net.parameter_count
        ([[1.0]], (2, 2, 1), 9)
    """

    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]
    output: Output = "linear"

    def __post_init__(self) -> None:
        if self.output not in get_args(Output):
            raise ValueError(f"output must be one of {get_args(Output)}, got {self.output!r}")
        if not self.weights or len(self.weights) != len(self.biases):
            counts = f"{len(self.weights)} weights and {len(self.biases)} biases"
            raise ValueError(f"weights and biases must be as many, at least one, got {counts}")
        layers = [
            (np.ascontiguousarray(w, np.float32), np.ascontiguousarray(b, np.float32))
            for w, b in zip(self.weights, self.biases, strict=True)
        ]
        width: int | None = None
        for i, (w, b) in enumerate(layers):
            if w.ndim != 2 or b.shape != w.shape[1:] or width not in (None, w.shape[0]):
                shapes = [(w.shape, b.shape) for w, b in layers]
                raise ValueError(f"layer {i} must fit its neighbours, got shapes {shapes}")
            if not (np.isfinite(w).all() and np.isfinite(b).all()):
                raise ValueError(f"layer {i} must be finite, got NaN or infinity")
            width = w.shape[1]
        object.__setattr__(self, "weights", tuple(w for w, _ in layers))
        object.__setattr__(self, "biases", tuple(b for _, b in layers))

    @property
    def sizes(self) -> tuple[int, ...]:
        """Units of every layer, inputs first."""
        return (self.weights[0].shape[0], *(w.shape[1] for w in self.weights))

    @property
    def parameter_count(self) -> int:
        """Number of weights and biases."""
        return sum(w.size + b.size for w, b in zip(self.weights, self.biases, strict=True))

    def __call__(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the outputs.

        Args:
            x: inputs, float32 (n, in).

        Returns:
            float32 (n, out).

        Raises:
            ValueError: if the inputs have another shape.
        """
        y = self.hidden(x) @ self.weights[-1] + self.biases[-1]
        if self.output == "sigmoid":
            return np.float32(0.5) * (np.float32(1.0) + np.tanh(np.float32(0.5) * y))
        return y

    def hidden(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return what the last layer sees: the activations of the last hidden layer.

        Args:
            x: inputs, float32 (n, in).

        Returns:
            float32 (n, units of the last hidden layer); the inputs if there is none.

        Raises:
            ValueError: if the inputs have another shape.
        """
        h = np.asarray(x, np.float32)
        if h.ndim != 2 or h.shape[1] != self.sizes[0]:
            raise ValueError(f"x must have shape (n, {self.sizes[0]}), got {h.shape}")
        for w, b in zip(self.weights[:-1], self.biases[:-1], strict=True):
            h = h @ w
            h += b
            np.maximum(h, np.float32(0.0), out=h)
        return h

    def arrays(self, name: str) -> Arrays:
        """Return the layers as named arrays, `name.0.weight`, `name.0.bias`, ..."""
        found: Arrays = {}
        for i, (w, b) in enumerate(zip(self.weights, self.biases, strict=True)):
            found |= {f"{name}.{i}.weight": w, f"{name}.{i}.bias": b}
        return found


@dataclass(frozen=True, kw_only=True)
class Model:
    """Networks and arrays by name, with the configuration that made them."""

    networks: dict[str, MLP]
    arrays: dict[str, NDArray[Any]]
    config: dict[str, Any]

    def network(self, name: str) -> MLP:
        """Return one network.

        Raises:
            DamagedModelError: if the model holds none of that name.
        """
        if name not in self.networks:
            raise DamagedModelError(f"no network {name!r}, there are {sorted(self.networks)}")
        return self.networks[name]


def encode_networks(
    networks: Mapping[str, MLP],
    config: Mapping[str, Any],
    arrays: Mapping[str, NDArray[Any]] | None = None,
) -> bytes:
    """Write networks as one safetensors file; the same networks give the same bytes.

    Args:
        networks: by name; names hold no dot.
        config: how they came about: what JSON can hold.
        arrays: what belongs to them beside layers (scales, means), by name without a dot.

    Raises:
        ValueError: if a name holds a dot or is used twice, or a number is not finite.

    Example:
        >>> net = MLP((np.ones((2, 1), np.float32),), (np.zeros(1, np.float32),), "sigmoid")
        >>> model = decode_networks(encode_networks({"l_hat": net}, {"seed": 3}))
        >>> model.network("l_hat").output, model.config
        ('sigmoid', {'seed': 3})
    """
    extra = dict(arrays or {})
    clash = sorted(extra.keys() & networks.keys())
    if clash or any("." in name for name in (*networks, *extra)):
        raise ValueError(f"names must be unique and hold no dot, got {[*networks, *extra]}")
    flat: dict[str, NDArray[Any]] = dict(extra)
    for name, net in networks.items():
        flat |= net.arrays(name)
    outputs = {name: net.output for name, net in networks.items()}
    return encode_model(flat, {"config": dict(config), "outputs": outputs})


def decode_networks(content: bytes) -> Model:
    """Read networks back.

    Args:
        content: what `encode_networks` returned.

    Raises:
        DamagedModelError: if it is anything else, were it by one bit.
    """
    stored = decode_model(content)
    try:
        config, outputs = stored.config["config"], dict(stored.config["outputs"])
        networks = {name: _network(stored.arrays, name, how) for name, how in outputs.items()}
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedModelError(f"the model holds no networks: {error!r}") from error
    arrays = {name: array for name, array in stored.arrays.items() if "." not in name}
    return Model(networks=networks, arrays=arrays, config=config)


def _network(arrays: Mapping[str, NDArray[Any]], name: str, output: Output) -> MLP:
    count = sum(key.startswith(f"{name}.") and key.endswith(".weight") for key in arrays)
    layers = range(count)
    return MLP(
        tuple(arrays[f"{name}.{i}.weight"] for i in layers),
        tuple(arrays[f"{name}.{i}.bias"] for i in layers),
        output,
    )
