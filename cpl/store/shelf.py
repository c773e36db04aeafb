"""Where the models of a published table lie: files of their own, named like the shards.

``data/models/<experiment>-<profile>/<shard>.safetensors``, each with a ``.json`` that says what
made it. The table then holds their SHA-256, and reading it puts them back.
"""

# pyright: standard
# pandas has no stubs: strict would report what it returns on every line.

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import pandas as pd

from cpl.store.keys import plain
from cpl.store.models import decode_model
from cpl.store.tables import bytes_columns

__all__ = ["MisplacedModelError", "PublishedShard", "put_back", "taken_out"]

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.=,+-]{0,150}")


class MisplacedModelError(ValueError):
    """A model is missing, or is not the one that its table was published with."""


@dataclass(frozen=True, kw_only=True)
class PublishedShard:
    """A stretch of rows that was computed in one go, and can be recomputed in one go."""

    name: str
    first_row: int
    rows: int


def taken_out(
    table: pd.DataFrame, shelf: Path, shards: Sequence[PublishedShard], about: Mapping[str, str]
) -> tuple[pd.DataFrame, dict[Path, bytes | str]]:
    """Put a SHA-256 in the place of each model.

    Args:
        table: May have columns of bytes; ``b""`` where a row has no model.
        shelf: Folder of the models.
        shards: Stretches of rows, at most one model each.
        about: What to note beside each model.

    Returns:
        The table without bytes, and the files to write.

    Raises:
        ValueError: If a shard holds several models or is badly named.
        DamagedModelError: If the bytes are not a model.
    """
    files: dict[Path, bytes | str] = {}
    lean = table.copy()
    for name in bytes_columns(table):
        lean[name] = [sha256(value).hexdigest() if value else "" for value in table[name]]
        for shard in shards:
            rows = table[name].iloc[shard.first_row : shard.first_row + shard.rows]
            models = [value for value in rows if value]
            if len(models) > 1:
                msg = f"shard {shard.name!r} must hold one model at most, got {len(models)}"
                raise ValueError(msg)
            for value in models:
                file = _file(shelf, shard.name)
                entry = {"shard": shard.name, "sha256": sha256(value).hexdigest()}
                entry |= {"config": decode_model(value).config}
                text = json.dumps(plain({**about, **entry}), indent=1, sort_keys=True)
                files |= {file: value, file.with_suffix(".json"): text + "\n"}
    return lean, files


def put_back(
    lean: pd.DataFrame, shelf: Path, shards: Sequence[PublishedShard], columns: Mapping[str, str]
) -> pd.DataFrame:
    """Put the models back into the place of their SHA-256.

    Args:
        lean: What `taken_out` returned.
        shelf: Folder of the models.
        shards: Stretches of rows.
        columns: Type of each column of the whole table.

    Raises:
        MisplacedModelError: If a model is missing or does not agree with its SHA-256.
    """
    table = lean
    for name in (column for column, kind in columns.items() if kind == "bytes"):
        values: list[bytes] = []
        for shard in shards:
            rows = lean[name].iloc[shard.first_row : shard.first_row + shard.rows]
            values += [
                _read(_file(shelf, shard.name), digest) if digest else b"" for digest in rows
            ]
        table = table.assign(**{name: pd.Series(values, dtype=object)})
    return table


def _file(shelf: Path, shard: str) -> Path:
    if not _NAME.fullmatch(shard):
        msg = f"shard must be a plain name, got {shard!r}"
        raise ValueError(msg)
    return shelf / f"{shard}.safetensors"


def _read(file: Path, digest: str) -> bytes:
    where = f"{file.parent.name}/{file.name}"
    try:
        content = file.read_bytes()
    except FileNotFoundError as error:
        msg = f"the model {where} is missing"
        raise MisplacedModelError(msg) from error
    if sha256(content).hexdigest() != digest:
        msg = f"{where} does not agree with the SHA-256 in its table"
        raise MisplacedModelError(msg)
    return content
