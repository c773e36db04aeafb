"""When each published piece was last recomputed and agreed, and from which source.

`data/results/attestation.json` holds, by result, the digest of what it said and the runs that
computed pieces of it again: date, commit, fingerprint of the source, and the pieces' names. A piece
stands in its latest run only. If a result says something else now, its runs count no more.
"""

import json
from collections.abc import Collection, Mapping
from typing import Any

from cpl.experiments.run.found import module_of
from cpl.store import (
    Manifest,
    atomic_write,
    data_path,
    fingerprint,
    source_commit,
    today,
)

__all__ = ["Attestation"]

_FILE = ("results", "attestation.json")


class Attestation:
    """What is attested; changes are written at once, so that a run can be stopped anywhere."""

    def __init__(self) -> None:
        """Read the file, if there is one."""
        path = data_path(*_FILE)
        text = path.read_text(encoding="utf-8") if path.is_file() else "{}"
        self._results: dict[str, dict[str, Any]] = json.loads(text)

    def ever(self, manifest: Manifest) -> set[str]:
        """Return the pieces that agreed at any time with what the result says now."""
        return {piece for run in self._runs(manifest) for piece in run["pieces"]}

    def today(self, manifest: Manifest) -> set[str]:
        """Return the pieces that agreed when computed by the source as it is now."""
        source = _source(manifest)
        return {p for run in self._runs(manifest) if run["source"] == source for p in run["pieces"]}

    def add(self, manifest: Manifest, pieces: Collection[str]) -> None:
        """Note that pieces were computed again just now, and agree."""
        now = {"on": today(), "commit": source_commit(), "source": _source(manifest)}
        kept: list[dict[str, Any]] = []
        for run in self._runs(manifest):
            if _told(run) == now:
                pieces = {*pieces, *run["pieces"]}
            elif rest := sorted(set(run["pieces"]) - set(pieces)):
                kept.append({**run, "pieces": rest})
        runs = [*kept, {**now, "pieces": sorted(pieces)}]
        self._results[_key(manifest)] = {"content": manifest.content, "runs": runs}
        text = json.dumps(dict(sorted(self._results.items())), indent=1)
        atomic_write(data_path(*_FILE), text + "\n")

    def _runs(self, manifest: Manifest) -> list[dict[str, Any]]:
        entry = self._results.get(_key(manifest), {})
        return entry.get("runs", []) if entry.get("content") == manifest.content else []


def _key(manifest: Manifest) -> str:
    return f"{manifest.experiment}/{manifest.profile}"


def _source(manifest: Manifest) -> str:
    return fingerprint(module_of(manifest.experiment))[:16]


def _told(run: Mapping[str, Any]) -> dict[str, Any]:
    return {name: run[name] for name in ("on", "commit", "source")}
