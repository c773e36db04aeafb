"""The walks as logs: what is written, that nothing is overwritten, and what the book ships."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cpl.cli import main
from cpl.experiments import published
from cpl.experiments.quadruped import quadruped_walks
from cpl.experiments.quadruped.recording import record
from cpl.experiments.run.result import Provenance, Result
from cpl.logs import read_run, read_runs
from cpl.quadruped import COLUMNS, shape, summary
from cpl.store import data_path

SHIPPED = data_path("logs", "quadruped")


@pytest.fixture
def result():
    """Return two short runs as the experiment would."""
    row = dict.fromkeys(COLUMNS, 0.0) | {"qw": 1.0, "supervisor": "", "outcome": ""}
    row |= dict.fromkeys(("confidence", "slam_error", "waypoint_index", "err"), 0) | {
        "l_hat": np.nan
    }
    rows = [
        {"shape": "triangle", "range": "out", "policy": "paper", "supervision": "without"}
        | {"repeat": repeat}
        | row
        | {"t_s": 0.1 * step, "x_m": 0.3 * step}
        for repeat in (0, 1)
        for step in range(3)
    ]
    told = Provenance(
        experiment="quadruped_walks",
        profile="smoke",
        published=False,
        parameters={},
        seeds={},
        label="simulated-kinematic",
        commit="unknown",
        modules={},
        versions={},
        machine={},
        made="2026-01-01",
        seconds=1.0,
        content="",
        verified=None,
    )
    return Result(
        table=pd.DataFrame(rows), config=quadruped_walks.PROFILES["smoke"], provenance=told
    )


def test_a_run_comes_back_from_its_log(result, tmp_path):
    manifest = record(result, tmp_path / "logs")
    files = json.loads(manifest.read_text(encoding="utf-8"))["files"]
    assert sorted(files) == [f"triangle-out-paper-without-{k}.mcap" for k in (0, 1)]
    runs = read_runs(tmp_path / "logs")
    assert runs.label == "simulated-kinematic; 2 runs"
    assert runs.table["x_m"].tolist() == pytest.approx([0.0, 0.3, 0.6] * 2)
    said = runs.summary.iloc[1]
    assert (said["config.repeat"], said["config.kp_max"], said["config.tracker.delay"]) == (
        1,
        4.0,
        2,
    )
    assert np.array_equal(said["config.waypoints"], shape("triangle").waypoints)


def test_logs_are_never_overwritten(result, tmp_path, capsys):
    with pytest.raises(FileExistsError, match="must not exist yet"):
        record(result, tmp_path)
    assert main(["record", str(tmp_path)]) == 2
    assert "must not exist yet" in capsys.readouterr().err


def test_an_unknown_profile_is_refused(tmp_path, capsys):
    assert main(["record", str(tmp_path / "x"), "--profile", "huge"]) == 2
    assert "huge" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_a_draft_that_was_left_behind_is_written_anew(result, tmp_path):
    (tmp_path / ".logs.part").mkdir()
    (tmp_path / ".logs.part" / "stray").touch()
    folder = record(replace(result), tmp_path / "logs").parent
    assert not (folder / "stray").exists()


def test_the_shipped_logs_are_those_of_the_manifest():
    manifest = json.loads((SHIPPED / "manifest.json").read_text(encoding="utf-8"))
    there = {path.name: path for path in SHIPPED.glob("*.mcap")}
    assert sorted(there) == sorted(manifest["files"])
    for name, told in manifest["files"].items():
        assert hashlib.sha256(there[name].read_bytes()).hexdigest() == told["sha256"]
    assert sum(told["bytes"] for told in manifest["files"].values()) < 30e6


def test_the_shipped_logs_have_twenty_runs_a_cell():
    manifest = json.loads((SHIPPED / "manifest.json").read_text(encoding="utf-8"))
    cells = pd.Series([name.rsplit("-", 1)[0] for name in manifest["files"]])
    assert cells.value_counts().unique().tolist() == [20]
    assert cells.nunique() == 3 * 2 * 2


@pytest.mark.parametrize(
    "cell", [("triangle", "out", "paper", 0), ("hexagon", "in", "no_quantile", 3)]
)
def test_the_logs_are_the_runs_of_the_published_table(cell):
    path, gains, policy, repeat = cell
    run = read_run(SHIPPED / f"{path}-{gains}-{policy}-without-{repeat}.mcap")
    table = published("quadruped_eval").table.query(
        "shape == @path and range == @gains and policy == @policy and repeat == @repeat"
        " and supervision == 'without'"
    )
    told = summary(run.table, shape(path), floor_half_width_m=2.5)
    for name in ("start_end_m", "path_error_m", "slam_error_rate", "coverage", "mean_kp", "steps"):
        assert table[name].tolist() == [pytest.approx(told[name], abs=1e-6)]


def test_a_supervised_run_is_shipped_with_what_its_supervisor_did():
    folder = data_path("logs", "quadruped-supervised")
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    for name, told in manifest["files"].items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == told["sha256"]
    runs = read_runs(folder, strict=True)
    assert set(runs.summary["config.supervision"]) == {"with"}
    for run in runs.runs.values():
        lost = run.table["supervisor"] == "slam_lost"
        assert lost.any()
        # Lost is more than one SLAM error: while it lasts the robot is told to stand.
        assert (run.table.loc[lost, "confidence"] == 0).all()
        assert (run.table.loc[lost, ["cmd_v_x_mps", "cmd_v_y_mps"]] == 0).all(axis=None)
