"""Recordings that were misread, refused for the wrong reason, or took the machine's memory."""

import bz2
import hashlib
import json
import math
import os
import resource
import struct
import subprocess
import sys
import zlib

import h5py
import numpy as np
import pytest
import zstandard

from cpl.cli import main
from cpl.logs import (
    DamagedLogError,
    EmptyLogError,
    LogError,
    NotALogError,
    RangeError,
    RunInfo,
    SchemaError,
    TimeOrderError,
    UnitError,
    read_run,
    save_run,
)
from cpl.logs.info import packed
from cpl.logs.salvage import CHUNK, HEAD, MAGIC, MESSAGE
from cpl.logs.schema import CHANNELS
from cpl.store import canonical_json
from tests.logs.samples import (
    KIND,
    ROS1,
    ROS2,
    TOPIC,
    bag2,
    csv,
    db3,
    mcap_ros2,
    netcdf,
    odometry,
    sqlite_again,
    tum,
    walk,
)

WALK = walk(200)


def read(path, data, **options):
    path.write_bytes(data)
    return read_run(path, silent="unstated", **options)


# Stamps as they are


def bag_of(path, change):
    """A ROS 1 bag whose messages were changed one by one."""
    from rosbags.rosbag1 import Writer

    with Writer(path) as writer:
        connection = writer.add_connection(TOPIC, KIND, typestore=ROS1)
        for k, p in enumerate(WALK):
            message = odometry(ROS1, p, k)
            change(k, message)
            writer.write(connection, p.stamp_ns, ROS1.serialize_ros1(message, KIND))
    return read_run(path, silent="unstated")


def set_stamp(message, ns):
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(ns, 10**9)


def test_a_first_stamp_of_zero_costs_one_row(tmp_path):
    run = bag_of(tmp_path / "a.bag", lambda k, m: set_stamp(m, 0) if k == 0 else None)
    assert (len(run.table), run.recovery.rows_dropped) == (199, 1)
    assert [f.error for f in run.recovery.faults] == [TimeOrderError]
    assert run.duration_s == pytest.approx(9.9)
    assert run.info.start_unix_ns == WALK[1].stamp_ns
    save_run(run, tmp_path / "a.mcap")


def test_boot_time_until_the_clock_is_set_is_named_and_keeps_its_rows(tmp_path):
    def booting(k, message):
        if k < 50:
            set_stamp(message, 12 * 10**9 + k * 50_000_000)

    run = bag_of(tmp_path / "a.bag", booting)
    assert len(run.table) == 200
    (fault,) = run.recovery.faults
    assert "the clock was set ahead by" in fault.what
    assert run.duration_s == pytest.approx(9.95 + 0.05)
    assert run.info.start_unix_ns == WALK[50].stamp_ns - 51 * 50_000_000
    assert [len(part) for part in run.segments()] == [50, 150]


def test_a_clock_set_back_while_recording_keeps_the_order_of_the_file(tmp_path):
    def back(k, message):
        if k >= 100:
            set_stamp(message, WALK[k].stamp_ns - 3600 * 10**9)

    run = bag_of(tmp_path / "a.bag", back)
    assert run.table["x_m"].tolist() == [p.x for p in WALK]
    (fault,) = run.recovery.faults
    assert "the clock was set back by 3599.95" in fault.what
    assert not run.recovery.whole
    assert [len(part) for part in run.segments()] == [100, 100]


def test_one_stamp_far_ahead_costs_itself_and_no_other(tmp_path):
    ahead = WALK[7].stamp_ns + 10**12
    run = bag_of(tmp_path / "a.bag", lambda k, m: set_stamp(m, ahead) if k == 7 else None)
    assert run.table.index.tolist() == [*range(7), *range(8, 200)]
    assert run.recovery.rows_dropped == 1


def test_a_first_covariance_of_nan_costs_one_row_and_not_the_confidence(tmp_path):
    def unknown(k, message):
        if k == 0:
            message.pose.covariance[:] = math.nan

    run = bag_of(tmp_path / "a.bag", unknown)
    assert (run.table["confidence"] == 3).all()
    assert [f.error for f in run.recovery.faults] == [RangeError]
    assert len(run.table) == 199


def test_gaps_are_named_with_time_and_length(tmp_path):
    lines = tum(WALK).splitlines(keepends=True)
    run = read(tmp_path / "a.txt", b"".join(lines[:50] + lines[90:]))
    assert run.recovery.whole
    ((t_s, length_s),) = run.recovery.plausibility.gaps
    assert (t_s, length_s) == (pytest.approx(2.4), pytest.approx(2.05))
    assert "1 gap (2.05 s at 2.40 s)" in str(run.recovery.plausibility)


# ROS 2 in MCAP that something happened to


@pytest.fixture(scope="module")
def mcap():
    return mcap_ros2(WALK)


def chunks(data):
    found, at = [], len(MAGIC)
    while at < len(data) - len(MAGIC):
        code, length = HEAD.unpack_from(data, at)
        if code == 6:
            found.append((at, length))
        at += HEAD.size + length
    return found


def test_a_flipped_bit_costs_a_chunk_and_the_statistics_count_it(tmp_path, mcap):
    data, places = bytearray(mcap), chunks(mcap)
    data[places[3][0] + 200] ^= 4
    run = read(tmp_path / "a.mcap", bytes(data))
    lost = 200 - len(run.table)
    assert 0 < lost < 20
    assert run.recovery.rows_dropped == lost
    assert any(f"there were 200 messages, {200 - lost} are left" in f.what
               for f in run.recovery.faults)  # fmt: skip


def test_truncated_it_gives_what_is_before_the_cut(tmp_path, mcap):
    run = read(tmp_path / "a.mcap", mcap[: len(mcap) // 2])
    assert 50 < len(run.table) < 150
    assert run.recovery.rows_dropped is None
    assert run.table["x_m"].tolist() == pytest.approx([p.x for p in WALK[: len(run.table)]])


@pytest.mark.parametrize("options", [{"summary": False}, {"crc": False}])
def test_without_a_summary_or_a_checksum_it_is_sound(tmp_path, options):
    run = read(tmp_path / "a.mcap", mcap_ros2(WALK, **options), strict=True)
    assert len(run.table) == 200
    said = any("no checksum" in note for note in run.recovery.notes)
    assert said == ("crc" in options)


def test_one_empty_message_costs_one_message(tmp_path):
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(tmp_path / "a", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(TOPIC, KIND, typestore=ROS2)
        for k, p in enumerate(WALK):
            raw = ROS2.serialize_cdr(odometry(ROS2, p), KIND)
            writer.write(connection, p.stamp_ns, b"" if k in (0, 100) else bytes(raw))
    run = read_run(tmp_path / "a", silent="unstated")
    assert len(run.table) == 198
    assert [f.error for f in run.recovery.faults] == [SchemaError] * 2


# A log of ours that claims what cannot be


def text(value):
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def words(mapping):
    data = b"".join(text(k) + text(v) for k, v in mapping.items())
    return struct.pack("<I", len(data)) + data


def record(code, body):
    return HEAD.pack(code, len(body)) + body


def described(**changes):
    told = packed(RunInfo(provenance="simulated-kinematic"), ("/odometry/pose",), None)
    told.pop("sha256")
    told |= changes
    seal = hashlib.sha256(canonical_json(dict(told)).encode()).hexdigest()
    return record(12, text("cpl.run") + words(told | {"sha256": seal}))


def chunk(raw, size=None):
    data = zstandard.ZstdCompressor().compress(raw)
    head = CHUNK.pack(0, 0, len(raw) if size is None else size, zlib.crc32(raw), 4)
    return record(6, head + b"zstd" + struct.pack("<Q", len(data)) + data)


def message(number, t_ns, body):
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    return record(5, MESSAGE.pack(1, number, t_ns, t_ns) + data)


def pose(number, w=1.0):
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": w}
    place = {"position": {"x": 0.01 * number, "y": 0.0, "z": 0.0}, "orientation": turn}
    return message(number, number * 10**8, {"frame_id": "world", "pose": place, "yaw_rad": 0.0})


def rows(*more, units=None):
    said = json.dumps(CHANNELS[0].units) if units is None else units
    schema = record(3, struct.pack("<H", 1) + text("foxglove.PoseInFrame") + text("jsonschema")
                    + text("{}"))  # fmt: skip
    channel = record(4, struct.pack("<HH", 1, 1) + text("/odometry/pose") + text("json")
                     + words({"frame": "world", "units": said}))  # fmt: skip
    return schema + channel + b"".join(pose(k) for k in range(30)) + b"".join(more)


def log(*parts):
    head = record(1, text("") + text("cpl.logs"))
    end = record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0))
    return MAGIC + head + b"".join(parts) + end + MAGIC


@pytest.mark.parametrize(
    "bad",
    [
        pose(40, w=1e200),
        message(31, 2**64 - 1, json.loads(pose(31)[9 + MESSAGE.size :])),
        message(33, 10**10, b'{"frame_id":"world","pose":{"position":{"x":' + b"9" * 5000 + b"}}}"),
        message(33, 10**10, b"[" * 100_000),
    ],
    ids=["length 1e200", "last time", "5000 digits", "nested"],
)
def test_a_message_that_cannot_be_costs_its_row(tmp_path, bad):
    run = read(tmp_path / "a.mcap", log(described(), chunk(rows(bad))))
    assert len(run.table) == 30
    assert sum(fault.rows for fault in run.recovery.faults) == 1


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"config": "[" * 50_000 + "]" * 50_000}, "config is nested too deep"),
        ({"config": "[" * 600 + "]" * 600}, "config is nested deeper than 50 levels"),
        ({"config": "[1, 2]"}, "config must be an object"),
        ({"channels": "5"}, "channels must be a list of topics"),
        ({"channels": '[["a"]]'}, "channels must be a list of topics"),
        ({"rows": "[1]"}, "rows must be a count"),
        ({"rows": '"3"'}, "rows must be a count"),
        ({"rows": "1e400"}, "rows must be a count"),
        ({"source": "5"}, "source must be an object"),
        ({"seed": "9" * 4000}, "seed must be a whole number"),
        ({"start_unix_ns": str(2**70)}, "start_unix_ns must be a whole number"),
    ],
)
def test_a_description_of_another_type_is_refused_by_name(tmp_path, changes, says):
    with pytest.raises(SchemaError, match=says):
        read(tmp_path / "a.mcap", log(described(**changes), chunk(rows())))


def test_units_that_are_nested_are_refused(tmp_path):
    with pytest.raises(UnitError, match="are not JSON"):
        read(tmp_path / "a.mcap", log(described(), chunk(rows(units="[" * 50_000))))


# CSV


HEAD_LINES = b"# provenance: simulated-kinematic\n# axes: ros\n"
POSE = b"t_s,x_m,y_m,z_m,qx,qy,qz,qw\n"
LINES = b"".join(b"%.1f,%.2f,0,0,0,0,0,1\n" % (0.1 * k, 0.01 * k) for k in range(30))


@pytest.mark.parametrize(
    "row",
    [
        b"3.0,0,0,0,0,0,0,1e200\n",
        b"3.0," + b"1" * 200_000 + b",0,0,0,0,0,1\n",
        b"3.0,1e308,0,0,0,0,0,1\n",
        b"3.0,0,0,0,0,0,0,\xff\n",
        b"18446744073709551616,0,0,0,0,0,0,1\n",
        b"1e999999999,0,0,0,0,0,0,1\n",
        b"3.0," + b" " * 2_000_000 + b"0,0,0,0,0,0,1\n",
        b'3.0,"0,0,0,0,0,0,1\n',
    ],
)
def test_a_line_that_cannot_be_costs_itself(tmp_path, row):
    lines = LINES.splitlines(keepends=True)
    text_ = b"".join([*lines[:15], row, *lines[15:]])
    run = read(tmp_path / "a.csv", HEAD_LINES + POSE + text_)
    assert len(run.table) == 30
    assert sum(fault.rows for fault in run.recovery.faults) == 1
    assert main(["logs", "plot", str(tmp_path / "a.csv"), str(tmp_path / "a.svg")]) == 1


@pytest.mark.parametrize("number", [b"nan", b"inf", b"0.9", b"1e300", b"99999999999"])
def test_a_row_number_that_is_none_costs_its_row(tmp_path, number):
    lines = LINES.splitlines(keepends=True)
    numbered = [b"%d," % k + line for k, line in enumerate(lines)]
    numbered[7] = number + b"," + lines[7]
    run = read(tmp_path / "a.csv", HEAD_LINES + b"row," + POSE + b"".join(numbered))
    assert run.table.index.tolist() == [*range(7), *range(8, 30)]
    save_run(run, tmp_path / "a.mcap")


def test_negative_row_numbers_are_left_out_and_said(tmp_path):
    lines = LINES.splitlines(keepends=True)
    numbered = [b"%d," % (k - 10) + line for k, line in enumerate(lines)]
    run = read(tmp_path / "a.csv", HEAD_LINES + b"row," + POSE + b"".join(numbered))
    assert run.table.index.tolist() == list(range(30))
    assert "row numbers were left out" in run.recovery.faults[0].what


@pytest.mark.parametrize(
    ("said", "says"),
    [
        (b"# start_unix_ns: " + b"9" * 30 + b"\n", "start_unix_ns must be"),
        (b"# source: [1,2]\n", "source must be an object"),
        (b"# config: " + b"[" * 900 + b"]" * 900 + b"\n", "nested deeper"),
        (b"# config: " + b"[" * 100_000 + b"\n", "config"),
    ],
)
def test_what_a_csv_says_above_its_header_must_make_sense(tmp_path, said, says):
    with pytest.raises(LogError, match=says):
        read(tmp_path / "a.csv", said + HEAD_LINES + POSE + LINES, format="csv")


def test_a_million_columns_are_refused(tmp_path):
    names = b",".join(b"c%d" % k for k in range(10**5))
    with pytest.raises(NotALogError, match="the most that is read is 4096"):
        read(tmp_path / "a.csv", HEAD_LINES + POSE.strip() + b"," + names + b"\n", format="csv")


def test_a_line_separator_in_a_word_is_no_line(tmp_path):
    lines = b"0,0,0,0,0,0,0,1,a\xe2\x80\xa8b\n0.1,0,0,0,0,0,0,1,x\n"
    run = read(tmp_path / "a.csv", HEAD_LINES + POSE.strip() + b",supervisor\n" + lines)
    assert run.table["supervisor"].tolist() == ["a\u2028b", "x"]


def test_times_before_zero_begin_at_the_first(tmp_path):
    run = read(tmp_path / "a.csv", HEAD_LINES + POSE + b"-5,0,0,0,0,0,0,1\n-4,0,0,0,0,0,0,1\n")
    assert run.table["t_s"].tolist() == [0.0, 1.0]


def test_a_rate_that_no_recording_has_is_refused(tmp_path):
    (tmp_path / "a.csv").write_bytes(HEAD_LINES + POSE + LINES)
    run = read_run(tmp_path / "a.csv")
    with pytest.raises(ValueError, match="rate_hz must be finite"):
        run.downsampled(1e300)


# netCDF


@pytest.mark.parametrize(
    ("change", "error", "says"),
    [
        ("external raw", NotALogError, "external storage"),
        ("external link", NotALogError, "a link to somewhere else"),
        ("virtual", NotALogError, "a virtual dataset"),
        ("rows without data", DamagedLogError, "declares 20000000 rows"),
        ("scale 0", UnitError, "scale_factor is 0"),
        ("year 9999", UnitError, "which no recording does"),
        ("complex", SchemaError, "real numbers"),
        ("times of 1e30", EmptyLogError, "which is no date"),
    ],
)
def test_a_netcdf_that_would_read_elsewhere_or_nothing_is_refused(tmp_path, change, error, says):
    def spoil(file):
        made = {
            "external raw": {
                "shape": (200, 3),
                "dtype": "f8",
                "external": [("/etc/passwd", 0, 4800)],
            },
            "rows without data": {"shape": (2 * 10**7, 3), "dtype": "f8", "chunks": (1 << 14, 3)},
            "complex": {"data": np.ones((200, 3), complex)},
        }
        if change in made:
            del file["position"]
            file.create_dataset("position", **made[change]).attrs["units"] = "m"
        elif change == "external link":
            del file["position"]
            file["position"] = h5py.ExternalLink("other.h5", "/x")
        elif change == "virtual":
            del file["position"]
            layout = h5py.VirtualLayout((200, 3), dtype="f8")
            layout[:] = h5py.VirtualSource("other.h5", "x", (200, 3))
            file.create_virtual_dataset("position", layout)
        elif change == "scale 0":
            file["position"].attrs["scale_factor"] = 0.0
        elif change == "year 9999":
            file["time"].attrs["units"] = "seconds since 9999-12-31 23:59:59"
        else:
            del file["time"]
            file["time"] = np.arange(200) * 0.1 + 1e30
            file["time"].attrs["units"] = "seconds since 2020-01-01 00:00:00"

    with pytest.raises(error, match=says):
        read(tmp_path / "a.nc", netcdf(WALK, spoil))


@pytest.mark.parametrize(
    ("zone", "hours"), [("+05:00", 5), (" +05:00", 5), ("Z", 0), ("-0330", -3.5)]
)
def test_a_netcdfs_time_zone_counts(tmp_path, zone, hours):
    def zoned(file):
        file["time"].attrs["units"] = f"nanoseconds since 1970-01-01 00:00:00{zone}"

    run = read(tmp_path / "a.nc", netcdf(WALK, zoned))
    assert run.info.start_unix_ns == WALK[0].stamp_ns - int(hours * 3600) * 10**9


# Bags that want more than to be read


def test_a_view_without_end_is_no_table_of_messages(tmp_path):
    script = (
        "ALTER TABLE messages RENAME TO m2; CREATE VIEW messages AS WITH RECURSIVE c(x) AS "
        "(SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x AS id, 1 AS topic_id, x AS timestamp, "
        "x'' AS data FROM c;"
    )
    with pytest.raises(NotALogError, match="'messages' is view, not a table"):
        read(tmp_path / "a.db3", sqlite_again(db3(WALK), script))


@pytest.mark.parametrize("kind", ["laughs", "tag", "traversal"])
def test_a_bags_description_builds_nothing_and_leads_nowhere(tmp_path, kind):
    folder = bag2(tmp_path / "a", WALK)
    there = folder / "metadata.yaml"
    texts = {
        "laughs": "a: &a [x,x]\n" + "".join(f"{c}: &{c} [*a,*a]\n" for c in "bcdefgh"),
        "tag": "!!python/object/apply:os.system ['touch pwned']\n",
        "traversal": there.read_text().replace("a.db3", "../../../../etc/passwd"),
    }
    there.write_text(texts[kind])
    with pytest.raises(EmptyLogError, match="no file of those that metadata"):
        read_run(folder, silent="unstated")


# Terminals


def test_control_characters_never_reach_a_terminal(tmp_path, capsys):
    name = "x\x1b]0;pwned\x07\x1b[31m"
    path = tmp_path / f"{name}.csv"
    path.write_bytes(csv(WALK).replace(b"qw\n", b"qw,\x1b[2J\n", 1).replace(b"\n1", b"\n\x1b1", 1))
    for action in ("info", "check"):
        main(["logs", action, str(path)])
    main(["logs", "info", str(tmp_path / "no\x1b[2J")])
    main(["logs", "plot", str(path), str(tmp_path / "a.svg")])
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err
    assert "\\x1b[2J" in said.out
    assert b"\x1b" not in (tmp_path / "a.svg").read_bytes()


# Bounds: by the resource limits of a process of its own


LIMIT_MB = 256


def limited(path, *words):
    """Run `cpl logs check` and return its status, memory beyond the import's [MB] and text."""
    code = (
        "import resource, sys\n"
        "from cpl.cli import main\n"
        "import cpl.logs, h5py, lz4.frame, zstandard\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "status = main(sys.argv[1:])\n"
        "after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "print('took', (after - before) // 1000, 'MB')\n"
        "sys.exit(status)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "logs", "check", str(path), *words],
        capture_output=True,
        text=True,
        timeout=120,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (60, 60)),
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    took = int(done.stdout.rpartition("took ")[2].split()[0])
    return done.returncode, took, done.stdout + done.stderr


def tiny(count):
    return b"".join([rows(), record(5, MESSAGE.pack(7, 0, 0, 0)) * count])


def bag_bomb():
    """A ROS 1 bag whose one chunk holds a message and 2 GB of zeros."""
    packer = bz2.BZ2Compressor(9)
    block = bytes(1 << 24)
    packed_ = b"".join(packer.compress(block) for _ in range(128)) + packer.flush()

    def fields(**values):
        parts = (k.encode() + b"=" + v for k, v in values.items())
        return b"".join(struct.pack("<I", len(part)) + part for part in parts)

    head = fields(op=b"\x05", compression=b"bz2", size=struct.pack("<I", 1 << 20))
    body = struct.pack("<I", len(head)) + head + struct.pack("<I", len(packed_)) + packed_
    return b"#ROSBAG V2.0\n" + body


@pytest.mark.parametrize(
    "made",
    [
        lambda: log(described(), chunk(tiny(8_000_000))),
        lambda: log(described(), chunk(rows()), chunk(b"x", size=10 << 30)),
        lambda: log(*[described()] * 20_000, chunk(rows())),
        bag_bomb,
        lambda: HEAD_LINES + POSE + b"x,0,0,0,0,0,0,1\n" * 300_000 + LINES,
        lambda: tum(WALK) + b"7" * (30 << 20),
    ],
    ids=["tiny messages", "10 GB chunk", "descriptions", "bz2 bomb", "bad lines", "one long line"],
)
def test_memory_is_bounded_whatever_a_file_declares(tmp_path, made):
    path = tmp_path / "a"
    path.write_bytes(made())
    status, took, said = limited(path)
    assert status in (1, 2), said
    assert "Traceback" not in said
    assert took < LIMIT_MB, said


@pytest.mark.faults
def test_a_table_of_a_quarter_of_a_gigabyte_is_read_in_less(tmp_path):
    path = tmp_path / "a.txt"
    line = b"%d.%03d 0.123456789 0.987654321 0.1 0.0 0.0 0.000000000000 1.000000000000\n"
    with path.open("wb") as file:
        for k in range(0, 3_300_000, 10_000):
            file.write(b"".join(line % divmod(n, 1000) for n in range(k, k + 10_000)))
    assert path.stat().st_size > 240e6
    status, took, said = limited(path)
    assert status == 1
    assert "the table has reached 8000000 values" in said
    assert took < LIMIT_MB, said
