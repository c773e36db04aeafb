"""The published layer: results in git under ``data/results/``, read-only but for publishing.

``<experiment>/<profile>.parquet`` is the table, ``<profile>.json`` beside it says where it comes
from. A change of code never deletes a result: it makes it *unverified* until a seeded sample of its
shards was re-executed and agreed.

Models that a table carries as bytes lie in files of their own, see `cpl.store.shelf`.
"""

# pyright: reportMissingTypeStubs=false

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, cast

import pandas as pd

from cpl.store.keys import canonical_json, plain, versions_below
from cpl.store.paths import atomic_write, data_path
from cpl.store.shelf import MisplacedModelError, PublishedShard, put_back, taken_out
from cpl.store.source import is_module, module_digests
from cpl.store.tables import (
    column_types,
    decode_table,
    encode_table,
    table_digest,
)

__all__ = [
    "DamagedResultError",
    "Manifest",
    "PublishedShard",
    "Verification",
    "manifests",
    "publish",
    "read_manifest",
    "read_published",
    "record_verification",
    "staleness",
]

_NAME = re.compile(r"[a-z][a-z0-9_]*(-[a-z0-9_]+)?")


class DamagedResultError(ValueError):
    """A published file does not agree with its manifest."""


@dataclass(frozen=True, kw_only=True)
class Verification:
    """When a result was last re-executed, with which code, and how much of it."""

    date: str
    modules: dict[str, str]
    versions: dict[str, str]
    shards: list[str]
    of: int


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Where a published table comes from.

    Attributes:
        experiment: Name of the experiment.
        profile: Name under which it is published.
        parameters: The full configuration.
        seeds: Every seed that went in.
        label: What kind of evidence it is (``exact``, ``simulated``, ``simulated-kinematic``, ...).
        commit: Commit of the source that made it; ``+`` behind it: with changes not yet committed.
        origins: Dotted names of the modules it was computed by.
        modules: Digest of each module below them, as it was.
        versions: Numerical packages, as they were.
        machine: Processor, cores, system, Python.
        made: Date (UTC).
        seconds: Processor time of all shards together.
        columns: Type of each column.
        rows: Number of rows.
        content: Digest of what the table says.
        sha256: Digest of the Parquet file.
        shards: Stretches of rows, in order.
        verified: The last re-execution that agreed; making it counts as the first.
        rules: The rules of the ledger that were fixed before it was computed, by row; see
            `cpl.store.rules`.
    """

    experiment: str
    profile: str
    parameters: dict[str, Any]
    seeds: dict[str, int]
    label: str
    commit: str
    origins: list[str]
    modules: dict[str, str]
    versions: dict[str, str]
    machine: dict[str, Any]
    made: str
    seconds: float
    verified: Verification
    columns: dict[str, str] = field(default_factory=dict[str, str])
    rows: int = 0
    content: str = ""
    sha256: str = ""
    shards: list[PublishedShard] = field(default_factory=list[PublishedShard])
    rules: dict[str, str] = field(default_factory=dict[str, str])


def publish(table: pd.DataFrame, manifest: Manifest, *, root: Path | None = None) -> Path:
    """Write a table and its manifest into the published layer, replacing what is there.

    The table goes first, the manifest last: between the two the old manifest refuses the new table,
    so that a kill in between is noticed.

    Args:
        table: Plain columns.
        manifest: Where it comes from; what describes the table itself is filled in here.
        root: Folder of the layer, models go into ``models`` beside it; ``data/results`` unless
            given.

    Returns:
        Path of the manifest.

    Raises:
        ValueError: If a name is unfit, or the shards do not add up to the table.
        OSError: If the disk is full or read-only.
    """
    path = _manifest_path(manifest.experiment, manifest.profile, root)
    if sum(shard.rows for shard in manifest.shards) != len(table):
        msg = f"shards must add up to the table's {len(table)} rows, got {manifest.shards!r}"
        raise ValueError(msg)
    lean, files = taken_out(table, _shelf(path), manifest.shards, _about(manifest))
    content = encode_table(lean)
    full = replace(
        manifest,
        columns=column_types(table),
        rows=len(table),
        content=table_digest(table),
        sha256=sha256(content).hexdigest(),
    )
    for file, payload in files.items():
        atomic_write(file, payload)
    atomic_write(path.with_suffix(".parquet"), content)
    return _write_manifest(full, path)


def read_manifest(experiment: str, profile: str, *, root: Path | None = None) -> Manifest:
    """Return the manifest of a published result.

    Raises:
        FileNotFoundError: If nothing is published under these names.
        DamagedResultError: If the manifest cannot be read.
    """
    path = _manifest_path(experiment, profile, root)
    if not path.is_file():
        msg = (
            f"no published result of experiment {experiment!r} with profile {profile!r}; "
            f"make it with: cpl compute {experiment} --profile {profile} --publish"
        )
        raise FileNotFoundError(msg)
    try:
        return _manifest(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, KeyError, TypeError) as error:
        msg = f"{path.name} of {experiment!r} is not a manifest: {error!r}"
        raise DamagedResultError(msg) from error


def read_published(
    experiment: str, profile: str, *, root: Path | None = None
) -> tuple[pd.DataFrame, Manifest]:
    """Return a published table with its manifest, checked against both digests.

    The files are read anew each time; what they say is decoded once a process. A caller may change
    its table, for no other caller sees that.

    Raises:
        FileNotFoundError: If nothing is published under these names.
        DamagedResultError: If file and manifest do not agree.
    """
    manifest = read_manifest(experiment, profile, root=root)
    path = _manifest_path(experiment, profile, root).with_suffix(".parquet")
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        msg = f"the table of {experiment!r}, profile {profile!r}, is missing: {path.name}"
        raise DamagedResultError(msg) from error
    if sha256(content).hexdigest() != manifest.sha256:
        msg = f"{experiment}/{path.name} does not agree with the SHA-256 in its manifest"
        raise DamagedResultError(msg)
    table, digest = _decoded(content)
    if "bytes" in manifest.columns.values():
        try:
            table = put_back(table, _shelf(path), manifest.shards, manifest.columns)
        except MisplacedModelError as error:
            raise DamagedResultError(str(error)) from error
        digest = table_digest(table)
    if digest != manifest.content:
        msg = f"{experiment}/{path.name} does not say what its manifest says"
        raise DamagedResultError(msg)
    return table.copy(deep=False), manifest  # pandas copies what is written to, when it is


def manifests(*, root: Path | None = None) -> list[Manifest]:
    """Return the manifests of everything that is published, sorted by name."""
    base = data_path("results") if root is None else root
    paths = sorted(base.glob("*/*.json"))
    return [read_manifest(path.parent.name, path.stem, root=root) for path in paths]


def record_verification(
    manifest: Manifest, verification: Verification, *, root: Path | None = None
) -> Manifest:
    """Write down that a result was re-executed and agreed; the table is not touched."""
    path = _manifest_path(manifest.experiment, manifest.profile, root)
    verified = replace(manifest, verified=verification)
    _write_manifest(verified, path)
    return verified


def staleness(
    manifest: Manifest,
    parameters: Mapping[str, Any] | None = None,
    *,
    origins: Sequence[str] | None = None,
) -> list[str]:
    """Say why a published result is unverified: what differs from the code that last agreed.

    Args:
        manifest: Of the published result.
        parameters: What the profile asks for today; not compared if None.
        origins: Modules that compute it today; those that did, unless given. A module that was
            moved since counts as changed.

    Returns:
        One line a reason; empty if the result is verified.
    """
    seen = manifest.verified
    reasons: list[str] = []
    if parameters is not None:
        reasons += _differences("parameter", manifest.parameters, plain(parameters))
    try:
        here = manifest.origins if origins is None else origins
        modules, versions = module_digests(*here), versions_below(*here)
    except ValueError as error:
        return [*reasons, f"its code cannot be read: {error}"]
    # What it no longer rests on says nothing: whoever imported that has changed, and is named. But
    # a file that is gone may have been left out only because it cannot be read.
    gone = {name for name in seen.modules.keys() - modules.keys() if not is_module(name)}
    changed = [name for name in modules if seen.modules.get(name) != modules[name]]
    reasons += [f"code changed: {name}" for name in sorted({*changed, *gone})]
    used = {name: version for name, version in seen.versions.items() if name in versions}
    return reasons + _differences("version of", used, versions)


@lru_cache(maxsize=64)
def _decoded(content: bytes) -> tuple[pd.DataFrame, str]:
    """Return the table that a file holds with its digest: the same bytes are decoded once."""
    table = decode_table(content)
    return table, table_digest(table)


def _differences(what: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    names = sorted(before.keys() | now.keys())
    return [
        f"{what} {name}: {before.get(name, 'absent')} -> {now.get(name, 'absent')}"
        for name in names
        if before.get(name, ...) != now.get(name, ...)
    ]


def _manifest_path(experiment: str, profile: str, root: Path | None) -> Path:
    for argument, name in (("experiment", experiment), ("profile", profile)):
        if not _NAME.fullmatch(name):
            msg = f"{argument} must be a plain lower-case name, got {name!r}"
            raise ValueError(msg)
    base = data_path("results") if root is None else root
    return base / experiment / f"{profile}.json"


def _shelf(manifest_path: Path) -> Path:
    """Return the folder of a result's models: beside the layer, named like the result."""
    name = f"{manifest_path.parent.name}-{manifest_path.stem}"
    return manifest_path.parents[2] / "models" / name


def _about(manifest: Manifest) -> dict[str, str]:
    return {
        "experiment": manifest.experiment,
        "profile": manifest.profile,
        "commit": manifest.commit,
        "made": manifest.made,
    }


def _write_manifest(manifest: Manifest, path: Path) -> Path:
    content = plain(asdict(manifest))
    content["seal"] = _seal(content)
    text = json.dumps(content, indent=1, sort_keys=True, allow_nan=False)
    return atomic_write(path, text + "\n")


def _seal(content: dict[str, Any]) -> str:
    """Digest what a manifest says, so that a flipped bit in it is noticed as well."""
    return sha256(canonical_json(content).encode()).hexdigest()


def _manifest(content: dict[str, Any]) -> Manifest:
    if content.pop("seal") != _seal(content):
        msg = "what it says does not agree with its seal"
        raise ValueError(msg)
    unknown = content.keys() - {f.name for f in fields(Manifest)}
    if unknown:
        msg = f"unknown fields {sorted(unknown)}"
        raise ValueError(msg)
    verified = cast("dict[str, Any]", content.pop("verified"))
    shards = cast("list[dict[str, Any]]", content.pop("shards"))
    return Manifest(
        **content,
        verified=Verification(**verified),
        shards=[PublishedShard(**shard) for shard in shards],
    )
