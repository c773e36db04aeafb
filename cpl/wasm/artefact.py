"""The module as it is shipped, with a note of what it was made of."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cpl.store import atomic_write, data_path, project_root
from cpl.store.source import module_digests

__all__ = ["AGREEMENT", "MODULE", "make", "module_bytes", "note", "sources", "stale"]

MODULE = data_path("wasm", "road.wasm")
_TRACKER = "cpl.conformal._kernels"  # of its room the only module that is compiled in
_NOTE = MODULE.with_suffix(".json")
_TOOLS = ("numba", "llvmlite", "ziglang")

AGREEMENT = {"rows": 28_588, "discrete": 0, "floats": 2_678, "output": 14}
"""Rows of the golden fixtures and how many of them differ from highway-env: in something discrete,
in the last bits of a float of the state, in the last bits of what a step returns. A test counts."""


def sources() -> dict[str, str]:
    """Digest every module whose code is compiled in, by name; comments and layout do not count."""
    root = project_root()
    digests = module_digests("cpl.wasm._exports", "cpl.wasm.lower")
    return {name: digest for name, digest in digests.items() if _compiled(root, name)}


def make() -> bytes:
    """Compile the module and write it with its note.

    Returns:
        The module.

    Raises:
        ImportError: If the extra `wasm` is not installed.
        RuntimeError: If a step fails.
    """
    from cpl.wasm.lower import build

    content = build()
    made = {
        "sha256": hashlib.sha256(content).hexdigest(),
        "bytes": len(content),
        "versions": {name: version(name) for name in _TOOLS},
        "sources": sources(),
    }
    atomic_write(MODULE, content)
    atomic_write(_NOTE, json.dumps(made, indent=1) + "\n")
    return content


def module_bytes() -> bytes:
    """Read the shipped module.

    Raises:
        ValueError: If it is not the one that the note speaks of.
    """
    content, wanted = MODULE.read_bytes(), note()["sha256"]
    if hashlib.sha256(content).hexdigest() != wanted:
        raise ValueError(f"{MODULE.name} must have the digest in its note, {wanted[:12]}...")
    return content


def note() -> dict[str, Any]:
    """Return what the shipped module was made of: digests, versions, sources."""
    return json.loads(_NOTE.read_text())


def stale() -> list[str]:
    """Name the modules whose code has changed since the shipped module was made."""
    then, now = note()["sources"], sources()
    return sorted(name for name in then.keys() | now.keys() if then.get(name) != now.get(name))


def _compiled(root: Path, name: str) -> bool:
    """Whether a module of the closure holds code that numba compiles."""
    path = root.joinpath(*name.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = file.read_text(encoding="utf-8")
    compiled = "njit(" in text or "cpl.highway._compile import" in text
    if name == __name__ or (name.startswith("cpl.conformal.") and name != _TRACKER):
        return False
    return compiled or name.startswith("cpl.wasm.")
