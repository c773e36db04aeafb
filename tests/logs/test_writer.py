"""What is written is what is read, and what is refused leaves no trace."""

import json
import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from cpl.logs import CHANNELS, COLUMNS, RunInfo, RunWriter, read_run, write_run
from cpl.logs.writer import encoded_run
from cpl.quadruped.run import COLUMNS as THEIRS


def same(table, rows):
    want = pd.DataFrame(rows)
    have = table.reset_index(drop=True)
    assert list(have) == [name for name in COLUMNS if name in want]
    pd.testing.assert_frame_equal(have, want[list(have)], check_exact=True)


def test_the_columns_are_those_that_a_quadruped_yields():
    assert list(THEIRS) == list(COLUMNS)


def test_a_run_comes_back_as_it_was(tmp_path, rows_of, info):
    path = write_run(tmp_path / "run.mcap", rows_of(45), info)
    run = read_run(path, strict=True)
    same(run.table, [r | {"t_s": round(r["t_s"], 9)} for r in rows_of(45)])
    assert run.info == info
    assert run.recovery.whole
    assert (run.recovery.rows, run.recovery.rows_dropped) == (45, 0)
    assert run.duration_s == pytest.approx(4.4)
    assert run.missing == ()


def test_row_by_row_gives_the_same_file_as_all_at_once(tmp_path, rows_of, info):
    with RunWriter(tmp_path / "a.mcap", info) as log:
        for row in rows_of(45):
            log.write(row)
    write_run(tmp_path / "b.mcap", rows_of(45), info)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_numpy_scalars_are_taken(tmp_path, rows_of, info):
    rows = [
        {name: np.float64(v) if isinstance(v, float) else np.int64(v) if isinstance(v, int) else v
         for name, v in row.items()} for row in rows_of(3)]  # fmt: skip
    same(read_run(write_run(tmp_path / "a.mcap", rows, info)).table,
         [r | {"t_s": round(r["t_s"], 9)} for r in rows_of(3)])  # fmt: skip


def test_other_readers_of_mcap_find_topics_schemas_and_units(tmp_path, rows_of, info):
    path = write_run(tmp_path / "run.mcap", rows_of(25), info)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = [(schema.name, channel, json.loads(m.data)) for schema, channel, m in
                 reader.iter_messages()]  # fmt: skip
        summary = reader.get_summary()
    assert summary.statistics.message_count == len(found)
    named = {channel.topic: name for name, channel, _ in found}
    assert named == {each.topic: each.schema for each in CHANNELS}
    for _, channel, _ in found:
        known = next(each for each in CHANNELS if each.topic == channel.topic)
        assert channel.metadata["frame"] == known.frame
        assert json.loads(channel.metadata["units"]) == known.units
    pose = next(body for _, channel, body in found if channel.topic == "/odometry/pose")
    assert pose["frame_id"] == "world"
    assert set(pose["pose"]) == {"position", "orientation"}


finite = st.floats(-1e6, 1e6)


@st.composite
def runs(draw):
    n = draw(st.integers(1, 6))
    times = draw(st.lists(st.integers(0, 10**13), min_size=n, max_size=n, unique=True))
    optional = [each for each in CHANNELS if not each.required]
    have = draw(st.lists(st.sampled_from(optional), unique_by=lambda each: each.topic))
    rows = []
    for t in sorted(times):
        yaw = draw(st.floats(-3.14, 3.14))
        row = {"t_s": t / 1e9, "x_m": draw(finite), "y_m": draw(finite), "z_m": draw(finite),
               "qx": 0.0, "qy": 0.0, "qz": math.sin(yaw / 2), "qw": math.cos(yaw / 2),
               "yaw_rad": yaw}  # fmt: skip
        for each in have:
            for f in each.fields:
                low, high = max(f.low, -1e6), min(f.high, 1e6)
                value = {"text": st.text(max_size=8), "int": st.integers(int(low), int(high))}
                row[f.column] = draw(value.get(f.kind, st.floats(low, high)))
        if "l_hat" in row and draw(st.booleans()):
            row["l_hat"] = math.nan
        rows.append(row)
    return rows


@given(runs(), st.integers(0, 2**63), st.integers(0, 2 * 10**18))
@settings(max_examples=40)
def test_whatever_can_be_written_comes_back(tmp_path_factory, rows, seed, start):
    path = tmp_path_factory.mktemp("law") / "run.mcap"
    info = RunInfo(provenance="real-Go1", seed=seed, start_unix_ns=start)
    run = read_run(write_run(path, rows, info), strict=True)
    same(run.table, rows)
    assert run.info == info


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"t_s": math.nan}, "t_s must be finite"),
        ({"t_s": -0.1}, "t_s must be finite, at least 0"),
        ({"t_s": "0"}, "t_s must be finite"),
        ({"t_s": 0.1}, "t_s must grow, got 0.1 after 0.1"),
        ({"x_m": math.nan}, "x_m must be finite, got nan"),
        ({"v_x_mps": math.inf}, "v_x_mps must be finite, got inf"),
        ({"confidence": 4}, r"confidence must be a whole number in \[0, 3\], got 4"),
        ({"confidence": 2.5}, "confidence must be a whole number"),
        ({"slam_error": True}, "slam_error must be a number, got True"),
        ({"slam_error": "Speed"}, "slam_error must be a number, got 'Speed'"),
        ({"kp": -1.0}, "kp must be finite of at least 0, got -1.0"),
        ({"l_hat": 1.5}, r"l_hat must be finite in \[0, 1\], got 1.5"),
        ({"supervisor": None}, "supervisor must be text, got None"),
        ({"speed_mps": 1.0}, "got 'speed_mps'"),
        ({"v_x": 1.0}, "did you mean 'v_x_mps'"),
        ({"x_m": None}, "x_m must be a number, got None"),
        ({"true_x_m": math.nan}, "true_x_m must be finite, got nan"),
    ],
)
def test_a_bad_row_is_refused_with_its_number_and_nothing_of_it_is_written(
    tmp_path, rows_of, info, change, says
):
    rows = rows_of(4)
    with RunWriter(tmp_path / "run.mcap", info) as log:
        log.write(rows[0])
        log.write(rows[1])
        with pytest.raises(ValueError, match=f"row 2: .*{says}"):
            log.write(rows[2] | change)
        log.write(rows[2])
        log.write(rows[3])
    same(read_run(tmp_path / "run.mcap", strict=True).table,
         [r | {"t_s": round(r["t_s"], 9)} for r in rows])  # fmt: skip


@pytest.mark.parametrize("column", ["t_s", "qw", "v_y_mps", "err"])
def test_half_a_channel_is_refused(tmp_path, rows_of, info, column):
    row = rows_of(1)[0]
    del row[column]
    with pytest.raises(ValueError, match=f"row 0: row must have .*'{column}'"):
        write_run(tmp_path / "run.mcap", [row], info)
    assert not (tmp_path / "run.mcap").exists()


def test_a_channel_must_not_come_or_go(tmp_path, rows_of, info):
    rows = rows_of(2)
    del rows[1]["kp"]
    with pytest.raises(ValueError, match="row 1: row must have the channels of the first row"):
        write_run(tmp_path / "run.mcap", rows, info)


def test_truth_that_nobody_knows_is_no_channel(tmp_path, rows_of, info):
    unknown = {"true_x_m": math.nan, "true_y_m": math.nan, "true_yaw_rad": math.nan}
    path = write_run(tmp_path / "run.mcap", [row | unknown for row in rows_of(3)], info)
    assert read_run(path).missing == ("/truth/pose",)


def test_a_log_is_never_overwritten_and_a_closed_one_takes_nothing(tmp_path, rows_of, info):
    path = write_run(tmp_path / "run.mcap", rows_of(3), info)
    before = path.read_bytes()
    with pytest.raises(FileExistsError):
        write_run(path, rows_of(3), info)
    with pytest.raises(FileExistsError):
        RunWriter(path, info)
    assert path.read_bytes() == before
    log = RunWriter(tmp_path / "b.mcap", info)
    log.close()
    log.close()
    with pytest.raises(ValueError, match=r"b\.mcap is closed"):
        log.write(rows_of(1)[0])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"provenance": "real"}, "provenance must be one of simulated-kinematic"),
        ({"provenance": "real-Go1", "seed": -1}, "seed must be a whole number"),
        ({"provenance": "real-Go1", "seed": True}, "seed must be a whole number"),
        ({"provenance": "real-Go1", "start_unix_ns": 0.5}, "start_unix_ns must be"),
        ({"provenance": "real-Go1", "config": {"x": math.nan}}, "must be finite"),
        ({"provenance": "real-Go1", "config": {"x": object()}}, "must be JSON"),
    ],
)
def test_a_senseless_description_is_refused(arguments, says):
    with pytest.raises(ValueError, match=says):
        RunInfo(**arguments)


def test_every_row_is_in_the_file_when_write_returns(tmp_path, rows_of, info):
    path = tmp_path / "run.mcap"
    with RunWriter(path, info) as log:
        for k, row in enumerate(rows_of(5)):
            log.write(row)
            assert read_run(path).recovery.rows == k + 1


KILLED = """
import itertools, sys
from pathlib import Path
from cpl.logs import RunInfo, RunWriter
pose = dict(x_m=0.0, y_m=0.0, z_m=0.0, qx=0.0, qy=0.0, qz=0.0, qw=1.0, yaw_rad=0.0)
log = RunWriter(Path(sys.argv[1]), RunInfo(provenance="real-Go1"), sync_every_s=0.05)
for k in itertools.count():
    log.write({"t_s": 0.1 * k, **pose, "kp": 1.0 + k})
    print(k, flush=True)
"""


def kill_and_read(path, after_s):
    """Kill a writing process; return what it had said was written, and what is readable."""
    with subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE) as job:
        assert job.stdout.readline() == b"0\n"
        time.sleep(after_s)
        os.kill(job.pid, signal.SIGKILL)
        said = [0, *(int(line) for line in job.stdout if line.endswith(b"\n"))]
    return said[-1], read_run(path)


def check_kill(path, after_s):
    last, run = kill_and_read(path, after_s)
    assert not run.recovery.whole
    assert run.recovery.rows_dropped is None
    assert run.table.index.tolist() == list(range(len(run.table)))
    assert len(run.table) - 1 >= last
    assert run.table["kp"].tolist() == [1.0 + k for k in range(len(run.table))]
    assert run.info.provenance == "real-Go1"


@pytest.mark.parametrize("after_s", [0.0, 0.137])
def test_a_kill_loses_nothing_that_was_written(tmp_path, after_s):
    check_kill(tmp_path / "run.mcap", after_s)


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(20))
def test_a_kill_at_any_time_loses_nothing_that_was_written(tmp_path, seed):
    check_kill(tmp_path / "run.mcap", np.random.default_rng(seed).uniform(0, 0.5))


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs Linux's /dev/full")  # noqa: PTH110
def test_a_full_disk_is_an_error_and_the_log_then_takes_nothing_more(tmp_path, rows_of, info):
    path = tmp_path / "run.mcap"
    log = RunWriter(path, info)
    log.write(rows_of(1)[0])
    whole = path.read_bytes()
    full = os.open("/dev/full", os.O_WRONLY)
    keep = os.dup(log._file.fileno())
    os.dup2(full, log._file.fileno())  # from here on the disk is full
    os.close(full)
    with pytest.raises(OSError, match="No space left"):
        log.write(rows_of(2)[1])
    with pytest.raises(ValueError, match="broken by an earlier error"):
        log.write(rows_of(2)[1])
    log.close()
    os.close(keep)
    assert path.read_bytes() == whole
    assert read_run(path).recovery.rows == 1


def test_the_size_stays_within_what_can_be_shipped(rows_of, info):
    assert len(encoded_run(rows_of(400), info)) < 400 * 350 + 20_000
