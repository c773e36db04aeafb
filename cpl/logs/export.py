"""Save a run that was read: as MCAP or as CSV, by the name's ending."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import replace
from hashlib import file_digest
from pathlib import Path
from typing import Any

from cpl.logs.info import RunInfo
from cpl.logs.run import Run
from cpl.logs.writer import write_run
from cpl.store import atomic_write, canonical_json

__all__ = ["save_run"]


def save_run(run: Run, path: Path | str) -> Path:
    """Save a run. The file says what it was made of, and what had been dropped by then.

    Args:
        run: What was read.
        path: `.mcap` or `.csv`; it must not exist yet.

    Raises:
        FileExistsError: It exists.
        ValueError: Another ending.
    """
    path = Path(path)
    if path.exists():
        raise FileExistsError(f"path must not exist yet, got {str(path)!r}")
    info = replace(run.info, source=_source(run))
    if path.suffix == ".mcap":
        return write_run(path, _rows(run), info, numbers=run.table.index.tolist())
    if path.suffix == ".csv":
        return atomic_write(path, _csv(run, info))
    msg = f"path must end in .mcap or .csv, got {path.name!r}"
    raise ValueError(msg)


def _rows(run: Run) -> Iterator[dict[str, Any]]:
    names = list(run.table.columns)
    for values in zip(*(run.table[name].tolist() for name in names), strict=True):
        yield dict(zip(names, values, strict=True))


def _source(run: Run) -> dict[str, Any]:
    """Return where the rows come from; a repeated conversion keeps the first file's name."""
    before = dict(run.info.source)
    told = run.recovery
    digest = None
    if run.path.is_file():
        with run.path.open("rb") as file:
            digest = file_digest(file, "sha256").hexdigest()
    return {
        "file": run.path.name,
        "sha256": digest,
        **before,
        "notes": [*before.get("notes", []), *told.notes],
        "faults": [*before.get("faults", []), *map(str, told.faults)],
        "rows_dropped": told.rows_dropped,
    }


def _csv(run: Run, info: RunInfo) -> str:
    text = io.StringIO()
    said = {
        "provenance": info.provenance,
        "axes": "ros",
        "seed": canonical_json(info.seed),
        "start_unix_ns": str(info.start_unix_ns),
        "config": canonical_json(info.config),
        "source": canonical_json(info.source),
    }
    text.writelines(f"# {name}: {value}\n" for name, value in said.items())
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["row", *run.table.columns])
    for number, row in zip(run.table.index.tolist(), _rows(run), strict=True):
        unknown = (isinstance(each, float) and math.isnan(each) for each in row.values())
        cells = ("" if empty else each for empty, each in zip(unknown, row.values(), strict=True))
        writer.writerow([number, *cells])
    return text.getvalue()
