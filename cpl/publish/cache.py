"""Is an execution at hand that would come out the same today?

An execution is keyed by everything that it rests on: the chapter's code, the parameters, the `cpl`
modules that the code imports (directly or through others; comments and docstrings aside), the
manifests of the published data, and the versions of what is installed. The chapter's prose is not
in the key: it is put around the kept outputs anew.
"""

from __future__ import annotations

import hashlib
import json
import platform
import re
from collections.abc import Mapping
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

from cpl.experiments import names
from cpl.publish.chapters import Chapter
from cpl.settings.words import Value
from cpl.store import atomic_write, canonical_json, cpl_imports, fingerprint, import_closure

__all__ = ["basis", "key_of", "load", "save", "versions"]

# Beside the package's own requirements: what turns a chapter into outputs.
_CHAIN = ("ipykernel", "ipython", "jupytext", "nbclient", "papermill")


def basis(chapter: Chapter, values: Mapping[str, Value], root: Path) -> dict[str, Any]:
    """List everything that an execution of a chapter rests on.

    Args:
        chapter: The chapter.
        values: Values of all its parameters.
        root: The project's folder, which holds `data/`.

    Returns:
        What goes into the key, ready for JSON.
    """
    modules = cpl_imports(chapter.code)
    closure = import_closure(*modules)
    return {
        "code": hashlib.sha256(chapter.code.encode()).hexdigest(),
        "parameters": dict(values),
        "modules": list(closure),
        "fingerprint": fingerprint(*modules) if modules else "",
        "data": _manifests(chapter, closure, root),
        "versions": versions(),
    }


def key_of(basis: Mapping[str, Any]) -> str:
    """Return the key of what an execution rests on: 64 hexadecimal digits."""
    return hashlib.sha256(json.dumps(basis, sort_keys=True).encode()).hexdigest()


def save(folder: Path, name: str, notebook: str, provenance: Mapping[str, Any]) -> None:
    """Keep an execution: the notebook first, then the record that makes it valid."""
    record = {**provenance, "notebook_sha256": hashlib.sha256(notebook.encode()).hexdigest()}
    record["seal"] = _seal(record)
    atomic_write(folder / f"{name}.ipynb", notebook)
    atomic_write(folder / f"{name}.json", json.dumps(record, indent=2, sort_keys=True) + "\n")


def load(folder: Path, name: str, key: str) -> tuple[str, dict[str, Any]] | None:
    """Return a kept execution with this key, or None if there is none or it is damaged."""
    try:
        notebook = (folder / f"{name}.ipynb").read_text(encoding="utf-8")
        record = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    except (FileNotFoundError, UnicodeDecodeError, json.JSONDecodeError):
        return None
    if not isinstance(record, dict) or record.get("key") != key:
        return None
    if record.pop("seal", None) != _seal(record):  # a flipped bit in what the footer will say
        return None
    same = record.get("notebook_sha256") == hashlib.sha256(notebook.encode()).hexdigest()
    return (notebook, record) if same else None


def _seal(record: Mapping[str, Any]) -> str:
    return hashlib.sha256(canonical_json(record).encode()).hexdigest()


@lru_cache(maxsize=1)
def _requirements() -> tuple[str, ...]:
    required = metadata.requires("cpl") or []
    names = [re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in required if "extra" not in text]
    return tuple(sorted({*names, *_CHAIN}))


def versions() -> dict[str, str]:
    """Return the versions of Python and of everything that a chapter's outputs depend on."""
    found = {name: metadata.version(name) for name in _requirements()}
    return {"python": platform.python_version(), **found}


def _manifests(chapter: Chapter, closure: tuple[str, ...], root: Path) -> dict[str, str]:
    """Digest the manifests of the data that a chapter can read.

    A chapter that names experiments depends on their published results; one that reads the ledger
    of claims or names a path of `data/` itself depends on all of them.
    """
    data = root / "data"
    experiments = {module.rpartition(".")[2] for module in closure}.intersection(names())
    everything = (
        any(m.split(".")[1:2] == ["claims"] for m in closure) or "data_path" in chapter.code
    )
    chosen = [
        path
        for path in sorted(data.rglob("*.json"))
        if everything or experiments.intersection(path.relative_to(data).parts[1:2])
    ]
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in chosen
    }
