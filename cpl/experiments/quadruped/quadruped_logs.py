"""What do the shipped logs of the twin say of what the paper claims of its robot?

The analyses of `cpl.quadruped.analysis` on recorded runs, one row a number, each with the row of
the ledger that it bears on (42 to 49). Nothing is walked here: the logs are read as they were
shipped, and if they are not those that the configuration names, nothing is computed.

Paper: Section V-D.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard
from cpl.logs import read_runs
from cpl.quadruped import analysis
from cpl.settings.ranges import Count, Settings
from cpl.store import data_path

__all__ = ["EXPERIMENT", "PROFILES", "Config", "digest"]

VALUES = ("start_end_m", "path_error_m", "duration_s", "slam_error_rate")
ROWS = {"all": 42, "triangle": 43, "hexagon": 44, "rectangle": 45}


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """Which logs are read, and how they are asked.

    Attributes:
        folders: Folders below `data/logs`.
        sha256: First 12 characters of each folder's `digest`.
        repeats: Runs of a cell that are read, the first ones; fewer are shipped of some twins.
        W: Window of the coverage [steps]; the paper's 4 s are 40.
        resamples: Resamples of runs behind an interval.
        seed: Draws them.
    """

    folders: tuple[str, ...]
    sha256: tuple[str, ...]
    repeats: Count = 20
    W: Count = 40
    resamples: Count = 400
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.folders) != len(self.sha256):
            raise ValueError(f"sha256 must be one a folder, got {self.sha256!r}")


FOLDERS = ("quadruped", "quadruped-legged")
SHA256 = ("c37b1d3e925c", "485784318538")
PROFILES = {
    "smoke": Config(folders=FOLDERS, sha256=SHA256, repeats=2, resamples=20),
    "book": Config(folders=FOLDERS, sha256=SHA256),
    "paper": Config(folders=FOLDERS, sha256=SHA256),
}


def digest(folder: str) -> str:
    """Return the SHA-256 over the names and contents of a folder's logs.

    Args:
        folder: Below `data/logs`.
    """
    total = hashlib.sha256()
    for path in sorted(data_path("logs", folder).glob("*.mcap")):
        total.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()


def _shards(config: Config) -> list[Shard]:
    """Return one shard a folder."""
    return [
        Shard(folder, {"folder": folder, "sha256": sha256})
        for folder, sha256 in zip(config.folders, config.sha256, strict=True)
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Read a folder and ask all there is to ask.

    Returns:
        One row a number: `folder`, `provenance`, `row` (of the ledger), `number`, `shape` (or
        `all`), `part` (`in`, `out`, `out - in`, or `all`), `value`, `low`, `high` (95 %; NaN where
        there is no interval) and `n` (pairs or runs).

    Raises:
        ValueError: The logs are not those that the configuration names.
    """
    folder = shard.text("folder")
    if (found := digest(folder)[:12]) != shard.text("sha256"):
        raise ValueError(f"sha256 of {folder} must be {shard.text('sha256')}, not {found}")
    runs = read_runs(data_path("logs", folder), strict=True)
    summary = runs.summary.query("`config.repeat` < @config.repeats")
    table = runs.table.merge(summary[["run"]], on="run")
    rows = pd.concat(_asked(table, summary, config), ignore_index=True)
    rows.insert(0, "folder", folder)
    rows.insert(1, "provenance", str(runs.summary["provenance"].tolist()[0]))
    names = ["folder", "provenance", "row", "number", "shape", "part", "value", "low", "high", "n"]
    rows["n"] = rows["n"].astype("int64")
    return rows.reindex(columns=names)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    label="simulated",
    rtol=1e-6,
)


def _asked(table: pd.DataFrame, summary: pd.DataFrame, config: Config) -> Iterator[pd.DataFrame]:
    """Yield the numbers of one analysis after the other."""
    seed, resamples = config.seed, config.resamples
    scored = analysis.score_runs(table, summary, W=config.W)
    for value in VALUES:
        rows = analysis.effects(scored, value).assign(number=value)
        of_shape = [46 if value == "duration_s" else ROWS[shape] for shape in rows["shape"]]
        yield rows.assign(row=of_shape)
    judged = analysis.judged(table, summary, seed, resamples=resamples)
    of_number = [46 if number.startswith("false") else 45 for number in judged["number"]]
    yield judged.rename(columns={"range": "part"}).assign(row=of_number)
    covered = analysis.coverage_beside_bound(table, summary, W=config.W)
    windows = analysis.windows_covered(covered, summary, seed, resamples=resamples)
    kept = windows.rename(columns={"range": "part", "reached": "value"})
    yield kept.drop(columns=["coverage", "whole"]).assign(number="windows_reached", row=47)
    chance = {"number": "both_by_chance", "shape": "all", "part": "all", "n": 2, "row": 47}
    yield pd.DataFrame([chance | {"value": analysis.both_by_chance(W=config.W)}])
    odds = analysis.failure_odds(table, summary, seed, resamples=resamples // 2)
    odds = odds.rename(columns={"term": "number", "odds_ratio": "value"})
    yield odds.assign(shape="all", part="all", row=48)
    rule = analysis.overruled(table, summary, seed, resamples=resamples)
    yield rule.assign(shape="all", part="all", row=49)
