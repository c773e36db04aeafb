"""Read any recording there is a format for, one file or a folder of them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from cpl.logs.errors import EmptyLogError, LogError, NotALogError
from cpl.logs.formats import Options, formats, recognised
from cpl.logs.run import Run

__all__ = ["Runs", "read_run", "read_runs", "recordings"]

NOT_TOLD = ".txt"  # an ending that says nothing: such a file in a folder may be anything


def read_run(
    path: Path | str,
    *,
    strict: bool = False,
    provenance: str | None = None,
    axes: str | None = None,
    topic: str | None = None,
    quaternion: str | None = None,
    unit: str | None = None,
    times: Path | str | None = None,
    pose_rate_hz: float | None = None,
    linear_accel_cov: float | None = None,
    format: str | None = None,
    silent: str | None = None,
) -> Run:
    """Read one run.

    Args:
        path: A file of any of `cpl.logs.formats`, or the folder of a ROS 2 bag.
        strict: Whether damage that could be survived is an error too.
        provenance: For a recording that does not say: where it comes from.
        axes: For one that does not say: `ros`, `t265` or `camera`.
        topic: For one with several pose topics.
        quaternion: For one whose attitudes are not x, y, z, w: `wxyz`.
        unit: For one whose positions are not metres: `cm` or `mm`; `m` says that a speed is true.
        times: For poses without times: a file with one a line [s].
        pose_rate_hz: For poses without times: their rate [Hz].
        linear_accel_cov: The realsense-ros driver's parameter, where it was not the default: then
            the attitude's covariance is not asked for a second opinion.
        format: The format's name, where the content does not tell it.
        silent: The provenance of a recording of which nobody says any; None to refuse it.

    Returns:
        Table, metadata and what it cost to get them.

    Raises:
        LogError: One of its kinds; it names file and record.
        FileNotFoundError: There is no such file.
        ValueError: An option that is none.
    """
    path = Path(path)
    options = Options(
        provenance=provenance,
        silent=silent,
        axes=axes,
        topic=topic,
        quaternion=quaternion,
        unit=unit,
        times=None if times is None else Path(times),
        pose_rate_hz=pose_rate_hz,
        linear_accel_cov=linear_accel_cov,
    )
    run = recognised(path, format).read(path, options)
    if strict and run.recovery.faults:
        raise run.recovery.faults[0].raised(path)
    return run


def recordings(folder: Path) -> list[Path]:
    """Return the recordings in a folder and below it; a ROS 2 bag's folder counts as one.

    A file counts by the ending of its name, but for text files, which must look like a recording.

    Args:
        folder: The folder, or one file.
    """
    if folder.is_file() or (folder / "metadata.yaml").is_file():
        return [folder]
    endings = {ending for each in formats() for ending in each.suffixes}
    found: list[Path] = []
    for base, names, files in os.walk(folder):
        here = Path(base)
        bags = [name for name in names if (here / name / "metadata.yaml").is_file()]
        found += [here / name for name in bags]
        found += [here / name for name in files if _counts(here / name, endings)]
        names[:] = sorted(set(names) - set(bags))
    return sorted(found)


def _counts(path: Path, endings: set[str]) -> bool:
    if path.suffix != NOT_TOLD:
        return path.suffix in endings
    try:
        recognised(path)
    except (NotALogError, EmptyLogError, OSError):
        return False
    return True


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
        endings = ", ".join(sorted({ending for each in formats() for ending in each.suffixes}))
        causes = "; ".join(map(str, refused.values())) or f"no file ends in {endings}"
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
