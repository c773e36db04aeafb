"""The road's module and its networks as scripts, which a page loads when somebody wants to drive.

The arrays that a road begins with are packed as they are: a page fills in seed, speeds, density and
noise, and knows nothing else of the engine.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from cpl.highway import PAPER, Engine
from cpl.highway.engine import NOISE_KEY
from cpl.highway.layout import Settings, allocate
from cpl.network import decode_networks, packed
from cpl.publish.live._script import as_script
from cpl.store import data_path
from cpl.wasm import AGREEMENT, BLOCK, NETWORKS, RIDE, gate, module_bytes, note
from cpl.wasm.ride import COUNTS, DRIVERS, NUMBERS

__all__ = ["PAIRS", "tab_scripts"]

PAIRS = 3
"""Pairs of policies that a page can drive."""

_KINDS = {"float64": "f8", "int64": "i8", "uint64": "u8", "float32": "f4", "bool": "b1"}
_ENGINE = ("counts", "numbers", "levels", "features", "ranges")


def tab_scripts() -> dict[str, str]:
    """Return `tab.js`, the module and how to fill its memory, and a script for each pair.

    Raises:
        FileNotFoundError: If the module or a model is not there.
        cpl.store.DamagedModelError: If a model is damaged.
    """
    scripts = {"tab.js": as_script("tab", _module())}
    for pair in range(PAIRS):
        scripts[f"tab-pair-{pair}.js"] = as_script(f"tab-pair-{pair}", _pair(pair))
    return scripts


def _module() -> dict[str, Any]:
    return {
        "wasm": _text(module_bytes()),
        "sha256": note()["sha256"],
        "agreement": AGREEMENT,
        "block": BLOCK,
        "ride": RIDE,
        "networks": NETWORKS,
        "counts": COUNTS,
        "numbers": NUMBERS,
        "drivers": DRIVERS,
        "noiseKey": NOISE_KEY,
        "cars": PAPER.vehicles_count + 1,
        "frames": PAPER.frames,
        "settings": {name: Settings._fields.index(name) for name in ("frames", "n")},
        "reals": {
            name: Settings._fields.index(name) - Settings._fields.index("dt")
            for name in ("other_gap", "noise")
        },
        "words": _words(),
        "arrays": list(_arrays()),
        "gate": [_array(name, array) for name, array in gate.arrays().items()],
    }


def _words() -> list[int]:
    """The block's six counts."""
    stride = allocate(PAPER, 1).cars.shape[2]
    rows, columns = PAPER.observation_vehicles_count, len(PAPER.features)
    return [1, stride, len(PAPER.target_speeds), columns, rows, PAPER.lanes_count]


def _arrays() -> Iterator[dict[str, Any]]:
    """One road of the paper, before its first reset, array by array in the block's order."""
    engine = Engine(PAPER, 1, path="own")
    shape = (PAPER.observation_vehicles_count, len(PAPER.features))
    settings = (*engine._settings, engine._levels, *engine._columns)
    known = dict(zip(_ENGINE, settings, strict=True))
    known |= engine._memory._asdict()
    known |= dict(zip(BLOCK[19:25], engine._spaces[0], strict=True))
    known |= {
        "actions": np.zeros(1, np.int64),
        "obs": np.zeros(shape, np.float32),
        "reward": np.zeros(1),
        "terms": np.zeros(5),
        "ended": np.zeros(2, np.bool_),
        "chosen": np.ones(1, np.bool_),
        "seeds": np.zeros(1, np.uint64),
    }
    for name in BLOCK[6:]:
        yield _array(name, known[name])


def _array(name: str, array: np.ndarray) -> dict[str, Any]:
    content = {"data": _text(array.tobytes())} if array.any() else {}
    return {"name": name, "kind": _KINDS[array.dtype.name], "size": array.size, **content}


def _pair(pair: int) -> dict[str, Any]:
    q = {kind: _network(f"base_policies-paper/{kind}-{pair}", "q") for kind in ("safe", "speed")}
    return {"forecaster": _network(f"forecasts-paper/pair-{pair}", "plain"), **q}


def _network(file: str, name: str) -> Mapping[str, Any]:
    content = data_path("models", f"{file}.safetensors").read_bytes()
    sizes, numbers, output = packed(decode_networks(content).network(name))
    return {"sizes": sizes.tolist(), "numbers": _text(numbers.tobytes()), "output": output}


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode()
