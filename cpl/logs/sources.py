"""Read any recording there is a reader for, one file or a folder of them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from cpl.logs.errors import EmptyLogError, LogError, NotALogError
from cpl.logs.from_bag import read_bag
from cpl.logs.from_csv import read_csv
from cpl.logs.from_netcdf import read_netcdf
from cpl.logs.reader import read_mcap
from cpl.logs.run import Run
from cpl.logs.salvage import MAGIC

__all__ = ["Runs", "kind_of", "read_run", "read_runs", "recordings"]

SUFFIXES = (".bag", ".csv", ".db3", ".mcap", ".nc")


def kind_of(path: Path) -> str:
    """Return what a file is, by its content, and by its name where the content does not say.

    Returns:
        `mcap`, `bag`, `csv` or `netcdf`.

    Raises:
        NotALogError: Nothing that is read here.
        EmptyLogError: The file is empty.
        FileNotFoundError: There is no such file.
    """
    if path.is_dir():
        if (path / "metadata.yaml").is_file():
            return "bag"
        raise NotALogError("is a folder without a ROS 2 bag; name a file in it", path=path)
    with path.open("rb") as file:
        head = file.read(4096)
    if not head:
        raise EmptyLogError("has no content", path=path)
    if head.startswith(MAGIC):
        # Behind the magic comes the header record: code, length of 8 bytes, and the profile.
        return "bag" if head[17:25] == b"\x04\0\0\0ros2" else "mcap"
    if head.startswith((b"#ROSBAG V2", b"SQLite format 3")):
        return "bag"
    if head.startswith(b"\x89HDF\r\n"):
        return "netcdf"
    if head.startswith(b"CDF"):
        raise NotALogError("is netCDF 3; `nccopy -k nc4 IN OUT` makes it netCDF 4", path=path)
    by_name = {".mcap": "mcap", ".bag": "bag", ".csv": "csv", ".nc": "netcdf", ".db3": "bag"}
    if path.suffix in by_name:
        return by_name[path.suffix]
    raise NotALogError(f"is none of {', '.join(SUFFIXES)}, by content or name", path=path)


def read_run(
    path: Path | str,
    *,
    strict: bool = False,
    provenance: str | None = None,
    axes: str | None = None,
    topic: str | None = None,
) -> Run:
    """Read one run.

    Args:
        path: MCAP of `cpl.logs`, ROS 1 or ROS 2 bag, CSV, netCDF-4.
        strict: Whether damage that could be survived is an error too.
        provenance: For a recording that does not say: where it comes from.
        axes: For a CSV or netCDF that does not say: `ros` or `t265`.
        topic: For a bag with several pose topics.

    Returns:
        Table, metadata and what it cost to get them.

    Raises:
        LogError: One of its kinds; it names file and record.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    match kind_of(path):
        case "mcap":
            run = read_mcap(path)
        case "bag":
            run = read_bag(path, provenance=provenance, topic=topic)
        case "csv":
            run = read_csv(path, provenance=provenance, axes=axes)
        case _:
            run = read_netcdf(path, provenance=provenance, axes=axes)
    if strict and run.recovery.faults:
        raise run.recovery.faults[0].raised(path)
    return run


def recordings(folder: Path) -> list[Path]:
    """Return the recordings in a folder and below it; a ROS 2 bag's folder counts as one.

    Args:
        folder: The folder, or one file.
    """
    if folder.is_file() or (folder / "metadata.yaml").is_file():
        return [folder]
    found: list[Path] = []
    for base, names, files in os.walk(folder):
        here = Path(base)
        bags = [name for name in names if (here / name / "metadata.yaml").is_file()]
        found += [here / name for name in bags]
        found += [here / name for name in files if Path(name).suffix in SUFFIXES]
        names[:] = sorted(set(names) - set(bags))
    return sorted(found)


@dataclass(frozen=True, kw_only=True)
class Runs:
    """A folder of runs.

    Attributes:
        table: All rows of all runs; `run` says whose, `step` is the row's number in it.
        summary: One row a run: provenance, seed, size, duration, what was dropped, and the
            configuration with a column for each of its values (`config.policy.kp`).
        runs: The runs by name.
        refused: Why the other files cannot be used, by name.
    """

    table: pd.DataFrame
    summary: pd.DataFrame
    runs: Mapping[str, Run]
    refused: Mapping[str, LogError]

    @property
    def label(self) -> str:
        """The provenance stamp for figures."""
        kinds = sorted({run.info.provenance for run in self.runs.values()})
        return f"{', '.join(kinds)}; {len(self.runs)} runs"


def read_runs(
    folder: Path | str,
    *,
    provenance: str | None = None,
    axes: str | None = None,
    strict: bool = False,
) -> Runs:
    """Read every run below a folder into one table.

    Args:
        folder: Where the files are, also in folders below it; or one file.
        provenance: As :func:`read_run`, for recordings that do not say.
        axes: As :func:`read_run`.
        strict: Whether one unusable or damaged file is an error; else unusable ones are listed in
            `refused`, which the caller has to show.

    Raises:
        FileNotFoundError: There is no such folder.
        EmptyLogError: No file in it can be used.
        LogError: As :func:`read_run`, if `strict`.
    """
    folder = Path(folder)
    if not folder.exists():
        raise FileNotFoundError(f"folder must exist, got {str(folder)!r}")
    runs: dict[str, Run] = {}
    refused: dict[str, LogError] = {}
    for path in recordings(folder):
        name = path.relative_to(folder).as_posix() if path != folder else path.name
        try:
            runs[name] = read_run(path, strict=strict, provenance=provenance, axes=axes)
        except LogError as error:
            if strict:
                raise
            refused[name] = error
    if not runs:
        causes = "; ".join(map(str, refused.values())) or f"no file ends in {', '.join(SUFFIXES)}"
        raise EmptyLogError(f"has no usable log: {causes}", path=folder)
    parts = [_tagged(name, run) for name, run in runs.items()]
    summary = pd.DataFrame([_summed(name, run) for name, run in runs.items()])
    table = pd.concat(parts, ignore_index=True)
    return Runs(table=table, summary=summary, runs=runs, refused=refused)


def _tagged(name: str, run: Run) -> pd.DataFrame:
    table = run.table.rename_axis("step").reset_index()
    table.insert(0, "run", name)
    table.insert(1, "provenance", run.info.provenance)
    return table


def _summed(name: str, run: Run) -> dict[str, Any]:
    told = run.recovery
    return {
        "run": name,
        "provenance": run.info.provenance,
        "seed": run.info.seed,
        "rows": told.rows,
        "duration_s": told.seconds,
        "whole": told.whole,
        "rows_dropped": told.rows_dropped,
        "faults": "; ".join(map(str, told.faults)),
        "missing": " ".join(run.missing),
        **_flat("config", run.info.config),
    }


def _flat(prefix: str, value: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    if isinstance(value, dict):
        parts = [_flat(f"{prefix}.{name}", inner) for name, inner in value.items()]
        return {name: inner for part in parts for name, inner in part.items()}
    return {} if value == {} else {prefix: tuple(value) if isinstance(value, list) else value}
