"""The runs of `quadruped_walks` as logs: one MCAP file a run, and a manifest with their digests."""

import hashlib
import json
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, cast

import pandas as pd

from cpl.experiments._quadruped import RANGES, run_seed
from cpl.experiments._result import Result
from cpl.experiments.quadruped_walks import CELL, LABEL, Config
from cpl.logs import RunInfo, write_run
from cpl.quadruped import COLUMNS, HORIZON, shape
from cpl.store import atomic_write, plain

__all__ = ["record"]


def record(result: Result, folder: Path) -> Path:
    """Write the runs as logs, one file each, with a manifest; all of them or nothing.

    Args:
        result: What `compute("quadruped_walks", ...)` returned.
        folder: Where to; it must not exist yet.

    Returns:
        The manifest's path.

    Raises:
        FileExistsError: The folder exists: logs are never overwritten.
    """
    if folder.exists():
        raise FileExistsError(f"folder must not exist yet, got {str(folder)!r}")
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = folder.with_name(f".{folder.name}.part")
    if draft.exists():
        shutil.rmtree(draft)
    files: dict[str, dict[str, Any]] = {}
    for name, rows, info in _runs(result):
        content = write_run(draft / name, rows, info).read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        files[name] = {"bytes": len(content), "rows": len(rows), "sha256": digest}
    told = result.provenance
    manifest = {
        "commit": told.commit,
        "content": told.content,
        "experiment": told.experiment,
        "files": files,
        "holds": "One run a file at 10 Hz; config in each file: shape, range, policy, repeat.",
        "machine": told.machine,
        "made": told.made,
        "modules": told.modules,
        "parameters": told.parameters,
        "profile": told.profile,
        "provenance": told.label,
        "seconds": round(told.seconds, 3),
        "versions": told.versions,
    }
    text = json.dumps(manifest, indent=1, sort_keys=True) + "\n"
    atomic_write(draft / "manifest.json", text)
    draft.replace(folder)
    return folder / "manifest.json"


def _runs(result: Result) -> Iterator[tuple[str, list[dict[str, Any]], RunInfo]]:
    """Yield each run's file name, rows and description."""
    config: Config = result.config
    cells = result.table.groupby(list(CELL), sort=True)
    for cell, table in cast("Iterable[tuple[tuple[Any, ...], pd.DataFrame]]", cells):
        made: dict[str, Any] = dict(zip(CELL, cell, strict=True))
        columns = [table[name].tolist() for name in COLUMNS]
        rows = [dict(zip(COLUMNS, values, strict=True)) for values in zip(*columns, strict=True)]
        kp_min, kp_max = RANGES[made["range"]]
        path = shape(made["shape"])
        info = RunInfo(
            provenance=LABEL,
            config=made
            | {
                "kp_min": kp_min,
                "kp_max": kp_max,
                "waypoints": [list(map(float, point)) for point in path.waypoints],
                "tracker": {"alpha": config.alpha, "c": 0.1, "delay": HORIZON},
                "experiment": plain(config),
            },
            seed=run_seed(config.seed, "eval", path.name, int(made["repeat"])),
        )
        yield "-".join(map(str, cell)) + ".mcap", rows, info
