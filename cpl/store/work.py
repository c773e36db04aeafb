r"""The work layer: finished shards of running computations, outside git, safe to delete.

One file a shard, ``<stage>/<key>/<shard>.shard``::

    cpl-shard 1 <SHA-256 of all that follows>\n
    {"key": ..., "shard": ..., "content": ..., "facts": ...}\n
    <Parquet>

It appears whole or not at all, and every byte of it is covered by the digest in its first line.
A file that does not agree with its digest, or that lies under another name than it was written for,
is moved to ``quarantine/``, reported, and treated as missing.
"""

# pyright: reportMissingTypeStubs=false

import hashlib
import json
import logging
import re
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import pandas as pd

from cpl.store.keys import canonical_json
from cpl.store.paths import atomic_write, work_path
from cpl.store.tables import decode_table, encode_table, table_digest

__all__ = ["StoredShard", "WorkStore"]

_MAGIC = b"cpl-shard 1 "
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.=,+-]{0,150}")
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class StoredShard:
    """One finished shard: its table, and what was noted beside it (seconds, worker)."""

    table: pd.DataFrame
    facts: dict[str, Any]


class WorkStore:
    """Finished shards by stage, key and name. Any number of processes may share one.

    Args:
        root: Folder of the store; ``$CPL_STORE``, else ``_build/store`` unless given.

    Examples:
        >>> import tempfile
        >>> store = WorkStore(Path(tempfile.mkdtemp()))
        >>> store.save("toy", "k" * 64, "part-0", pd.DataFrame({"n": [1]}))
        >>> store.load("toy", "k" * 64, "part-0").table["n"].tolist()
        [1]
        >>> store.load("toy", "k" * 64, "part-1") is None
        True
    """

    def __init__(self, root: Path | None = None) -> None:
        self.root = work_path() if root is None else Path(root).resolve()

    def save(
        self,
        stage: str,
        key: str,
        shard: str,
        table: pd.DataFrame,
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        """Commit a shard: after this call it survives a kill, before it nothing is there.

        Args:
            stage: Name of the stage, letters, digits and ``_.=,+-``.
            key: Key of the stage, from :func:`cpl.store.stage_key`.
            shard: Name of the shard within the stage, of the same letters.
            table: Its result, plain columns.
            facts: What else is worth noting, as JSON.

        Raises:
            ValueError: If a name or the table is not fit to be stored.
            OSError: If the disk is full or read-only.
        """
        header = {
            "stage": stage,
            "key": key,
            "shard": shard,
            "content": table_digest(table),
            "facts": dict(facts or {}),
        }
        body = canonical_json(header).encode() + b"\n" + encode_table(table)
        digest = hashlib.sha256(body).hexdigest().encode()
        atomic_write(self._path(stage, key, shard), _MAGIC + digest + b"\n" + body)

    def load(self, stage: str, key: str, shard: str) -> StoredShard | None:
        """Return a shard, or None if it is missing or was damaged (then it is quarantined)."""
        path = self._path(stage, key, shard)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        try:
            return _opened(content, stage=stage, key=key, shard=shard)
        except ValueError as damage:
            self._quarantine(path, str(damage))
            return None

    def shards(self, stage: str, key: str) -> tuple[str, ...]:
        """Name the shards that lie there, sorted; whether they are whole shows in ``load``."""
        folder = self._path(stage, key, "x").parent
        return tuple(sorted(p.name.removesuffix(".shard") for p in folder.glob("*.shard")))

    def describe(self, stage: str, key: str, description: Mapping[str, Any]) -> None:
        """Note beside a key what it stands for (parameters, modules, versions), for people."""
        path = self._path(stage, key, "x").with_name("stage.json")
        text = json.dumps(json.loads(canonical_json(description)), indent=1, sort_keys=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text + "\n":
            atomic_write(path, text + "\n")

    def descriptions(self, stage: str) -> dict[str, dict[str, Any]]:
        """Return what was noted beside each key of a stage; an unreadable note is left out."""
        found: dict[str, dict[str, Any]] = {}
        for path in sorted((self.root / _checked("stage", stage)).glob("*/stage.json")):
            try:
                found[path.parent.name] = json.loads(path.read_text(encoding="utf-8"))
            except ValueError:
                _log.warning("unreadable note %s: ignored", path)
        return found

    def quarantined(self) -> tuple[Path, ...]:
        """List the damaged files that were put aside."""
        return tuple(sorted((self.root / "quarantine").glob("*")))

    def _path(self, stage: str, key: str, shard: str) -> Path:
        folder = self.root / _checked("stage", stage) / _checked("key", key)
        return folder / f"{_checked('shard', shard)}.shard"

    def _quarantine(self, path: Path, why: str) -> None:
        aside = self.root / "quarantine" / f"{path.stem[:60]}-{uuid.uuid4().hex[:12]}{path.suffix}"
        aside.parent.mkdir(parents=True, exist_ok=True)
        try:
            path.rename(aside)
        except FileNotFoundError:  # another driver was faster: it is aside already
            return
        _log.warning("damaged shard %s put aside as %s: %s", path.name, aside.name, why)


def _checked(argument: str, name: str) -> str:
    if not _NAME.fullmatch(name) or ".." in name:
        msg = f"{argument} must be a plain name of letters, digits and _.=,+-, got {name!r}"
        raise ValueError(msg)
    return name


def _opened(content: bytes, **expected: str) -> StoredShard:
    """Check a shard from the outside in; ValueError says what does not agree."""
    first, _, body = content.partition(b"\n")
    if not first.startswith(_MAGIC):
        msg = "the first line is not that of a shard"
        raise ValueError(msg)
    if hashlib.sha256(body).hexdigest().encode() != first.removeprefix(_MAGIC):
        msg = "the content does not agree with its digest"
        raise ValueError(msg)
    line, _, payload = body.partition(b"\n")
    header = cast("dict[str, Any]", json.loads(line))
    for name, value in expected.items():
        if header.get(name) != value:
            msg = f"it was written for {name} {header.get(name)!r}"
            raise ValueError(msg)
    table = decode_table(payload)
    if table_digest(table) != header["content"]:
        msg = "the table does not agree with its digest"
        raise ValueError(msg)
    return StoredShard(table=table, facts=header["facts"])
