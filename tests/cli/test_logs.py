"""`cpl logs`: the exit status says how sound a log is, the message what is wrong and where."""

import pytest

from cpl.cli import main
from cpl.logs import RunInfo, read_run, write_run
from cpl.store import data_path

BAG = data_path("logs", "real-t265", "test.bag")


@pytest.fixture
def log(tmp_path):
    pose = {"y_m": 0.0, "z_m": 0.3, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0, "yaw_rad": 0.0}
    rows = [{"t_s": 0.1 * k, "x_m": 0.05 * k, **pose, "kp": 1.5} for k in range(60)]
    info = RunInfo(provenance="simulated-kinematic", config={"kp": 1.5}, seed=3)
    return write_run(tmp_path / "run.mcap", rows, info)


@pytest.fixture
def damaged(log):
    path = log.with_name("damaged.mcap")
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    return path


@pytest.fixture
def unusable(tmp_path):
    path = tmp_path / "unusable.mcap"
    path.write_bytes(b"not a log")
    return path


def test_check_says_whole_recovered_or_unusable(log, damaged, unusable, capsys):
    assert main(["logs", "check", str(log)]) == 0
    assert "run.mcap: whole: 60 rows, 5.90 s" in capsys.readouterr().out
    assert main(["logs", "check", str(damaged)]) == 1
    said = capsys.readouterr().out
    assert "damaged.mcap: damaged: 40 rows, 3.90 s recovered, 20 rows and" in said
    assert "DamagedLog: byte" in said
    assert main(["logs", "check", str(unusable)]) == 2
    assert "unusable (NotALog): unusable.mcap: is none of the formats" in capsys.readouterr().err


def test_the_worst_of_several_counts(log, damaged, unusable, capsys):
    assert main(["logs", "check", str(log), str(damaged)]) == 1
    assert main(["logs", "check", str(log.parent)]) == 2
    said = capsys.readouterr()
    assert "run.mcap: whole" in said.out
    assert "unusable.mcap" in said.err


def test_info_says_where_it_is_from_and_what_it_has(log, capsys):
    assert main(["logs", "info", str(log), str(BAG)]) == 0
    said = capsys.readouterr().out
    for part in (
        "provenance: simulated-kinematic",
        "seed: 3",
        'config: {"kp":1.5}',
        "rate: 10.0 Hz in 1 stretches",
        "/policy/gain: kp[1/s]",
        "provenance: real-T265-third-party",
        "began: 2020-07-13 23:47:15 UTC",
        "not there: /odometry/slam_error",
        "linear_accel_cov * 10^(3 - confidence)",
    ):
        assert part in said


def test_convert_thins_a_real_bag_into_a_log(tmp_path, capsys):
    out = tmp_path / "real.mcap"
    assert main(["logs", "convert", str(BAG), str(out), "--rate", "10"]) == 0
    run = read_run(out, strict=True)
    assert len(run.table) == 13
    assert run.info.provenance == "real-T265-third-party"
    assert main(["logs", "convert", str(out), str(tmp_path / "real.csv")]) == 0
    assert read_run(tmp_path / "real.csv", strict=True).table.equals(run.table)
    capsys.readouterr()
    assert main(["logs", "convert", str(out), str(out)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_convert_of_a_damaged_log_keeps_what_was_recovered_and_says_so(damaged, tmp_path):
    out = tmp_path / "out.mcap"
    assert main(["logs", "convert", str(damaged), str(out)]) == 1
    run = read_run(out, strict=True)
    assert len(run.table) == 40
    assert run.info.source["faults"]


@pytest.mark.parametrize(("name", "begins"), [("a.svg", b"<?xml"), ("a.png", b"\x89PNG")])
def test_plot_writes_a_picture(log, tmp_path, name, begins):
    assert main(["logs", "plot", str(log), str(tmp_path / name)]) == 0
    assert (tmp_path / name).read_bytes().startswith(begins)


def test_what_makes_no_sense_is_refused(log, unusable, tmp_path, capsys):
    out = str(tmp_path / "out")
    for words, says in (
        (["check", str(tmp_path / "none.mcap")], "No such file"),
        (["check", str(log), "--provenance", "real"], "--provenance must be one of"),
        (["plot", str(log), f"{out}.gif"], "OUT must end in .png or .svg"),
        (["convert", str(log), f"{out}.bag"], "OUT must end in .mcap or .csv"),
        (["convert", str(BAG), f"{out}.csv", "--rate", "-1"], "rate_hz must be"),
        (["convert", str(log), f"{out}.csv", "--rate", "5"], "policy's steps"),
        (["plot", str(unusable), f"{out}.svg"], "is none of the formats"),
        (["check", str(BAG), "--topic", "/x"], "topic must be one with poses"),
        (["check", str(BAG.parent / "LICENSE")], "is none of the formats"),
    ):
        assert main(["logs", *words]) == 2, words
        assert says in capsys.readouterr().err
    empty = tmp_path / "empty"
    empty.mkdir()
    assert main(["logs", "check", str(empty)]) == 2
    assert "there is no log in" in capsys.readouterr().err
    assert not list(tmp_path.glob("out*"))
