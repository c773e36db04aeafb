"""How a trained model becomes bytes and comes back: safetensors, checked, nothing that can run.

A safetensors file with a flipped bit in its numbers still loads, so the digest of what the model
says is kept in its own metadata, beside the configuration that made it.
"""

# pyright: standard
# safetensors has no complete stubs: strict would report what it returns on every line.

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from cpl.store.keys import canonical_json, plain

__all__ = ["DamagedModelError", "Model", "decode_model", "encode_model"]

_ENTRY = "cpl"  # one entry only: the order of several is not fixed, and with it the bytes
_KINDS = {"bool", "int32", "int64", "uint8", "float16", "float32", "float64"}
_LONGEST_HEADER = 1 << 20  # [bytes]


class DamagedModelError(ValueError):
    """The bytes are not the model that was written, or not a model at all."""


@dataclass(frozen=True, kw_only=True)
class Model:
    """Named arrays and the configuration that made them."""

    arrays: dict[str, NDArray[Any]]
    config: dict[str, Any]


def encode_model(arrays: Mapping[str, NDArray[Any]], config: Mapping[str, Any]) -> bytes:
    """Write named arrays as one safetensors file; the same arrays give the same bytes.

    Args:
        arrays: Numbers of a plain type, any shape, at least one array.
        config: How they came about: what JSON can hold.

    Raises:
        ValueError: If there is no array, or one holds something else than finite plain numbers.

    Examples:
        >>> content = encode_model({"w": np.ones(2, np.float32)}, {"seed": 3})
        >>> decode_model(content).config
        {'seed': 3}
    """
    if not arrays:
        msg = f"arrays must not be empty, got {dict(arrays)!r}"
        raise ValueError(msg)
    kept: dict[str, NDArray[Any]] = {}
    for name in sorted(arrays):
        array = np.asarray(arrays[name], order="C")
        if array.dtype.name not in _KINDS:
            msg = f"array {name!r} must hold plain numbers, got {array.dtype}"
            raise ValueError(msg)
        if not np.isfinite(array).all():
            msg = f"array {name!r} must be finite, got {int((~np.isfinite(array)).sum())} others"
            raise ValueError(msg)
        kept[name] = array
    plain_config = plain(config)
    entry = canonical_json({"config": plain_config, "digest": _digest(kept, plain_config)})
    return save(kept, metadata={_ENTRY: entry})


def decode_model(content: bytes) -> Model:
    """Read a model back and check it against its own digest.

    Args:
        content: What `encode_model` returned.

    Raises:
        DamagedModelError: If it is anything else, were it by one bit.
    """
    try:
        entry = json.loads(_metadata(content)[_ENTRY])
        config, digest = entry["config"], entry["digest"]
        arrays = load(content)
    except (SafetensorError, ValueError, KeyError, TypeError, RecursionError) as error:
        msg = f"content must be a model in safetensors form: {error!r}"
        raise DamagedModelError(msg) from error
    if not isinstance(config, dict) or _digest(arrays, config) != digest:
        msg = "the model does not agree with the digest in its metadata"
        raise DamagedModelError(msg)
    return Model(arrays={name: arrays[name] for name in sorted(arrays)}, config=config)


def _metadata(content: bytes) -> dict[str, str]:
    """Read the header's metadata: its length (8 bytes, little-endian), then JSON."""
    length = int.from_bytes(content[:8], "little")
    if not 2 <= length <= min(len(content) - 8, _LONGEST_HEADER):
        msg = f"a header of {length} bytes in a file of {len(content)}"
        raise ValueError(msg)
    return json.loads(content[8 : 8 + length])["__metadata__"]


def _digest(arrays: Mapping[str, NDArray[Any]], config: Any) -> str:  # noqa: ANN401 - JSON
    digest = hashlib.sha256(canonical_json(config).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        little = array.astype(array.dtype.newbyteorder("<"))
        digest.update(f"\n{name!r} {array.dtype.name} {arrays[name].shape}\n".encode())
        digest.update(little.tobytes())
    return digest.hexdigest()
