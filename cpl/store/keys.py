"""How a result is named: canonical JSON, versions of what computes, and the key of a stage."""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib.metadata import PackageNotFoundError, version
from typing import Any, cast

import numpy as np

from cpl.store.source import external_imports

__all__ = ["canonical_json", "plain", "stage_key", "versions_below"]

# Import name -> name of the distribution. These decide numbers; a plotting library does not.
_NUMERICAL = {
    "gymnasium": "gymnasium",
    "highway_env": "highway-env",
    "numba": "numba",
    "numpy": "numpy",
    "scipy": "scipy",
    "stable_baselines3": "stable-baselines3",
    "torch": "torch",
    "z3": "z3-solver",
}


def plain(value: object) -> Any:  # noqa: ANN401 - JSON has no narrower type
    """Turn a value into what JSON can hold, without losing what distinguishes it.

    Dataclasses become objects, tuples lists, numpy scalars Python ones, enumerations their value.

    Raises:
        ValueError: For a value JSON cannot hold exactly: NaN, infinity, sets, objects, text keys
            apart.

    Examples:
        >>> plain({"alpha": np.float64(0.1), "seeds": (1, 2)})
        {'alpha': 0.1, 'seeds': [1, 2]}
    """
    if isinstance(value, Enum):
        return plain(value.value)
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.generic):
        return plain(cast("object", value.item()))
    if isinstance(value, float) and not math.isfinite(value):
        msg = f"value must be finite to be stored as JSON, got {value!r}"
        raise ValueError(msg)
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Mapping):
        return _plain_mapping(cast("Mapping[object, object]", value))
    if isinstance(value, Sequence) and not isinstance(value, (bytes, bytearray)):
        return [plain(item) for item in cast("Sequence[object]", value)]
    msg = f"value must be JSON (numbers, text, lists, mappings, dataclasses), got {value!r}"
    raise ValueError(msg)


def canonical_json(value: object) -> str:
    """Write a value as JSON in one way only: sorted keys, no spaces, ASCII.

    Equal values give equal text; ``1``, ``1.0``, ``True`` and ``"1"`` stay four different values.

    Raises:
        ValueError: As :func:`plain`.

    Examples:
        >>> canonical_json({"b": 1.0, "a": (True, "x")})
        '{"a":[true,"x"],"b":1.0}'
    """
    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def stage_key(
    stage: str,
    parameters: object,
    *,
    upstream: Sequence[str] = (),
    fingerprint: str,
    versions: Mapping[str, str],
) -> str:
    """Name a computation by everything that decides its result.

    SHA-256 over the canonical JSON of stage, parameters, keys of the stages it reads, fingerprint
    of the source below it, and versions of the packages that compute.

    Args:
        stage: Dotted name of what is computed.
        parameters: Configuration: a dataclass or a mapping.
        upstream: Keys of the stages whose results go in, in order.
        fingerprint: From :func:`cpl.store.fingerprint`.
        versions: From :func:`cpl.store.versions_below`.

    Returns:
        64 hexadecimal digits.

    Examples:
        >>> stage_key("toy", {"n": 1}, fingerprint="f", versions={})[:12]
        '266fabef1d2d'
    """
    content = {
        "stage": stage,
        "parameters": parameters,
        "upstream": list(upstream),
        "fingerprint": fingerprint,
        "versions": dict(versions),
    }
    return hashlib.sha256(canonical_json(content).encode()).hexdigest()


def versions_below(*origins: str) -> dict[str, str]:
    """Return the versions of the numerical packages that some ``cpl`` modules rest on.

    Args:
        origins: Dotted names of ``cpl`` modules; their whole import closure is looked at.

    Returns:
        Distribution -> version, sorted; ``"absent"`` for one that is not installed.

    Examples:
        >>> list(versions_below("cpl.rng"))
        ['numpy']
    """
    named = external_imports(*origins)
    wanted = sorted(_NUMERICAL[name] for name in named if name in _NUMERICAL)
    return {distribution: _version(distribution) for distribution in wanted}


def _plain_mapping(value: Mapping[object, object]) -> dict[str, Any]:
    for key in value:
        if not isinstance(key, str):
            msg = f"keys must be text to be stored as JSON, got {key!r}"
            raise ValueError(msg)
    return {str(key): plain(item) for key, item in value.items()}


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "absent"
