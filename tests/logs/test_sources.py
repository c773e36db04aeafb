"""Recordings that others made: bags, CSV and netCDF, and folders of runs."""

import hashlib
import json
import math
import os

import h5py
import numpy as np
import pandas as pd
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from cpl.logs import (
    DamagedLogError,
    DuplicateChannelError,
    EmptyLogError,
    FrameError,
    LogError,
    MissingChannelError,
    NotALogError,
    NotFiniteError,
    ProvenanceError,
    QuaternionError,
    RangeError,
    SchemaError,
    TimeOrderError,
    UnitError,
    read_run,
    read_runs,
    save_run,
    write_run,
)
from cpl.logs.axes import to_ros
from cpl.logs.checks import rotation
from cpl.logs.poses import confidence_of
from cpl.store import data_path, project_root

REAL = "real-T265-third-party"
SHIPPED = data_path("logs", "real-t265")
HEAD = project_root().parent / "shared" / "data" / "real-t265" / "head.nc"


# The shipped recording


def test_the_shipped_files_are_those_of_their_source():
    manifest = json.loads((SHIPPED / "manifest.json").read_text())
    assert set(manifest["files"]) == {each.name for each in SHIPPED.iterdir()} - {"manifest.json"}
    for name, told in manifest["files"].items():
        data = (SHIPPED / name).read_bytes()
        assert len(data) == told["bytes"]
        assert hashlib.sha256(data).hexdigest() == told["sha256"]
    assert "Permission is hereby granted" in (SHIPPED / "LICENSE").read_text()


def test_the_real_bag_is_read_with_its_confidence():
    run = read_run(SHIPPED / "test.bag", strict=True)
    assert run.info.provenance == REAL
    assert len(run.table) == 228
    assert run.duration_s == pytest.approx(1.13456, abs=1e-5)
    assert (run.table["confidence"] == 3).all()
    first = run.table.iloc[0]
    # As the bag's first message says.
    assert first["x_m"] == -0.05797789245843887
    assert first["qx"] == 0.9897832274436951
    assert first["v_y_mps"] == -0.010559991042574324
    assert first["yaw_rate_radps"] == -0.01907720949423327
    assert run.info.start_unix_ns == 1594684035_859086752
    assert "/odometry/slam_error" in run.missing  # no topic could have carried one
    assert "/vicon/t265_tracker/t265_tracker" in run.info.source["not_read"]


@pytest.mark.skipif(not HEAD.exists(), reason="../shared/data/real-t265/head.nc is not at hand")
def test_the_real_walk_is_read_in_its_own_axes():
    run = read_run(HEAD, axes="t265", provenance=REAL, strict=True)
    assert len(run.table) == 66_629
    assert run.duration_s == pytest.approx(333.0, abs=0.01)
    assert (run.table["confidence"] == 3).all()
    table = run.table
    # He walks on the level: the height hardly changes beside the 50 m of the place.
    assert table["z_m"].std() < 0.1 * table["x_m"].std()
    thin = run.downsampled(10.0)
    assert len(thin.table) == 3331
    step = np.diff(thin.table[["x_m", "y_m"]].to_numpy(), axis=0)
    walked = np.linalg.norm(step, axis=1).sum()
    assert 400 < walked < 500  # 475 m in space
    with pytest.raises(FrameError, match="not recorded in the frame that is claimed"):
        read_run(HEAD, axes="ros", provenance=REAL)


# Bags of our own making

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types


def stamped(t_s, frame="odom"):
    sec, nanosec = divmod(round(t_s * 1e9), 10**9)
    time = TYPES["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return TYPES["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def posed(k):
    yaw = 0.05 * k
    return TYPES["geometry_msgs/msg/Pose"](
        position=TYPES["geometry_msgs/msg/Point"](x=math.sin(yaw), y=1 - math.cos(yaw), z=0.3),
        orientation=TYPES["geometry_msgs/msg/Quaternion"](
            x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)
        ),
    )


def odometry(k, confidence=3, *, base=0.01, frame="odom", covariances=True):
    vector = TYPES["geometry_msgs/msg/Vector3"]
    covariance = np.zeros(36)
    if covariances:
        covariance[[0, 7, 14]] = base * 10.0 ** (3 - confidence)
        covariance[[21, 28, 35]] = 0.01 * 10.0 ** (1 - confidence)
    twist = TYPES["geometry_msgs/msg/Twist"](
        linear=vector(x=0.5, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.5)
    )
    return TYPES["nav_msgs/msg/Odometry"](
        header=stamped(100 + 0.1 * k, frame),
        child_frame_id="base",
        pose=TYPES["geometry_msgs/msg/PoseWithCovariance"](pose=posed(k), covariance=covariance),
        twist=TYPES["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=covariance),
    )


def warned(text):
    status = TYPES["diagnostic_msgs/msg/DiagnosticStatus"](
        level=1, name="Warning ", message=text, hardware_id="T265", values=[]
    )
    array = TYPES["diagnostic_msgs/msg/DiagnosticArray"]
    return array(header=stamped(100), status=[status])


def bag(path, topics, plugin=StoragePlugin.SQLITE3):
    """Write a ROS 2 bag: topics as name -> list of (receipt [s], message)."""
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        for name, messages in topics.items():
            kind = messages[0][1].__msgtype__
            connection = writer.add_connection(name, kind, typestore=STORE)
            for t_s, message in messages:
                raw = STORE.serialize_cdr(message, kind)
                writer.write(connection, round(t_s * 1e9), raw)
    return path


def walk(n=40, **options):
    return [(100 + 0.1 * k, odometry(k, k % 4, **options)) for k in range(n)]


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_ros_2_bag_gives_confidence_and_slam_errors(tmp_path, plugin):
    events = [
        (100.55, "SLAM_ERROR Speed"),
        (101.0, "motion module warm"),
        (102.31, "SLAM_ERROR Vision"),
    ]
    diagnostics = [(t, warned(text)) for t, text in events]
    path = bag(tmp_path / "walk", {"/odom": walk(), "/diagnostics": diagnostics}, plugin)
    run = read_run(path, provenance="real-Go1", strict=True)
    assert run.table["confidence"].tolist() == [k % 4 for k in range(40)]
    errors = run.table["slam_error"]
    assert errors[errors != 0].to_dict() == {6: 2, 24: 1}
    assert run.table["x_m"].tolist() == [math.sin(0.05 * k) for k in range(40)]
    assert run.table["t_s"].tolist() == pytest.approx([0.1 * k for k in range(40)])
    alone = next(each for each in path.iterdir() if each.suffix in (".db3", ".mcap"))
    again = read_run(alone, provenance="real-Go1", strict=True)
    pd.testing.assert_frame_equal(run.table, again.table)


def test_a_bag_of_bare_poses_has_no_more_than_poses(tmp_path):
    stamped_pose = TYPES["geometry_msgs/msg/PoseStamped"]
    poses = [(k / 10, stamped_pose(header=stamped(k / 10), pose=posed(k))) for k in range(5)]
    run = read_run(bag(tmp_path / "bag", {"/pose": poses}), provenance=REAL, strict=True)
    assert run.topics == ("/odometry/pose",)


def test_covariances_that_are_not_the_drivers_give_no_confidence(tmp_path):
    path = bag(tmp_path / "bag", {"/odom": walk(covariances=False)})
    run = read_run(path, provenance="simulated-legged", strict=True)
    assert "/odometry/confidence" in run.missing
    assert any("cannot be had back" in note for note in run.recovery.notes)


def test_another_parameter_of_the_driver_is_noticed_and_can_be_given(tmp_path):
    path = bag(tmp_path / "bag", {"/odom": walk(base=0.1)})
    run = read_run(path, provenance=REAL)
    assert "/odometry/confidence" in run.missing  # not: one lower than it was
    run = read_run(path, provenance=REAL, linear_accel_cov=0.1)
    assert run.table["confidence"].tolist() == [k % 4 for k in range(40)]


@pytest.mark.parametrize("covariance", [0.0, -1.0, math.nan, math.inf, 0.02, 1e-3, 100.0])
def test_a_covariance_off_the_ladder_is_no_confidence(covariance):
    with pytest.raises(ValueError, match="covariance must be"):
        confidence_of(covariance, 0.01)


def test_one_odd_covariance_costs_its_row(tmp_path):
    messages = walk()
    messages[9][1].pose.covariance[0] = 0.5
    run = read_run(bag(tmp_path / "bag", {"/odom": messages}), provenance=REAL)
    assert 9 not in run.table.index
    assert [(f.error, f.where) for f in run.recovery.faults] == [(RangeError, "/odom, message 9")]


def nan_pose(m):
    m.pose.pose.position.x = math.nan


def long_quaternion(m):
    m.pose.pose.orientation.w = 2.0


def earlier(m):
    m.header.stamp.sec = 99


@pytest.mark.parametrize(
    ("spoil", "error"),
    [
        (nan_pose, NotFiniteError),
        (long_quaternion, QuaternionError),
        (earlier, TimeOrderError),
    ],
)
def test_a_bad_message_of_a_bag_costs_its_row(tmp_path, spoil, error):
    messages = walk()
    spoil(messages[9][1])
    run = read_run(bag(tmp_path / "bag", {"/odom": messages}), provenance=REAL)
    assert [f.error for f in run.recovery.faults] == [error]
    assert run.recovery.rows_dropped == 1


@pytest.mark.parametrize(
    ("topics", "options", "error", "says"),
    [
        ({"/a": walk(2), "/b": walk(2)}, {"provenance": REAL}, DuplicateChannelError, "/a, /b"),
        ({"/a": walk(2)}, {}, ProvenanceError, "give provenance, one of simulated-kinematic"),
        ({"/d": [(1.0, warned("x"))]}, {"provenance": REAL}, MissingChannelError, "no topic with"),
        ({"/a": walk(2)}, {"provenance": REAL, "topic": "/b"}, MissingChannelError, "/a (nav_msgs"),
        ({"/a": walk(2, frame="x_optical_frame")}, {"provenance": REAL}, FrameError, "along z"),
    ],
)
def test_a_bag_that_leaves_a_question_open_is_refused(tmp_path, topics, options, error, says):
    path = bag(tmp_path / "bag", topics)
    with pytest.raises(error) as caught:
        read_run(path, **options)
    assert says in str(caught.value)
    if error is DuplicateChannelError:
        assert len(read_run(path, topic="/b", **options).table) == 2


# CSV

HEADER = "t_s,x_m,y_m,z_m,qx,qy,qz,qw,v_x_mps,v_y_mps,yaw_rate_radps,confidence\n"
SAID = "# provenance: real-Go1\n# axes: ros\n"
LINES = [f"{k / 10},{k / 20},0,0.3,0,0,0,1,0.5,0,0,3\n" for k in range(30)]


def csv(path, header=HEADER, lines=LINES, said=SAID, encoding="utf-8"):
    path.write_bytes((said + header + "".join(lines)).encode(encoding))
    return path


def test_a_csv_is_read(tmp_path):
    run = read_run(csv(tmp_path / "a.csv"), strict=True)
    assert run.table["x_m"].tolist() == [k / 20 for k in range(30)]
    assert run.table["confidence"].tolist() == [3] * 30
    assert run.info.provenance == "real-Go1"


def test_units_of_a_csv_are_converted_and_said(tmp_path):
    header = "t_ms,x_mm,y_cm,yaw_deg,v_x_mmps,v_y_cmps,yaw_rate_degps\n"
    path = csv(tmp_path / "a.csv", header, ["0,1500,25,90,500,50,180\n", "100,1500,30,90,0,50,0\n"])
    run = read_run(path, strict=True)
    row = run.table.iloc[0]
    assert row[["x_m", "y_m", "v_x_mps", "v_y_mps"]].tolist() == pytest.approx(
        [1.5, 0.25, 0.5, 0.5]
    )
    assert row["yaw_rad"] == pytest.approx(math.pi / 2)
    assert row["yaw_rate_radps"] == pytest.approx(math.pi)
    assert run.table["t_s"].tolist() == [0.0, 0.1]
    assert row[["z_m", "qz"]].tolist() == pytest.approx([0, math.sqrt(0.5)])
    assert "planar: height 0 and the attitude follows from the heading" in run.recovery.notes
    assert sum("converted" in note for note in run.recovery.notes) == 7


def test_times_since_1970_keep_their_nanoseconds(tmp_path):
    lines = [f"1594684035{k}59086752,0,0,0\n" for k in (1, 2)]
    run = read_run(csv(tmp_path / "a.csv", "t_ns,x_m,y_m,yaw_rad\n", lines), strict=True)
    assert run.info.start_unix_ns == 1594684035_159086752
    assert run.table["t_s"].tolist() == [0.0, 0.1]


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"header": HEADER.replace("x_m,", "x,")}, UnitError, "name it 'x_m'"),
        ({"header": HEADER.replace("x_m,", "x_inch,")}, UnitError, "unknown unit"),
        ({"header": HEADER.replace("x_m,", "x_s,")}, UnitError, "unknown unit"),
        ({"header": HEADER.replace("y_m,", "x_m,")}, DuplicateChannelError, "x_m twice"),
        ({"header": HEADER.replace("y_m,", "x_mm,")}, DuplicateChannelError, "x_m twice"),
        ({"header": HEADER.replace("qw,", "w,")}, MissingChannelError, "no column qw"),
        ({"header": HEADER.replace("t_s,", "n,")}, MissingChannelError, "no column t_s"),
        ({"header": HEADER.replace("v_y_mps,", "n,")}, MissingChannelError, "no v_y_mps"),
        ({"lines": []}, EmptyLogError, "no usable row"),
        ({"header": "", "lines": []}, MissingChannelError, "no header"),
        ({"said": "# axes: ros\n"}, ProvenanceError, "give provenance"),
        ({"said": SAID.replace("real-Go1", "real")}, ProvenanceError, "'real'"),
        ({"said": "# provenance: real-Go1\n"}, FrameError, "which way its axes point"),
        ({"said": SAID.replace("ros", "down")}, FrameError, "got 'down'"),
        ({"said": SAID + "# axes: t265\n"}, DuplicateChannelError, "stated twice"),
        ({"said": SAID.replace("ros", "t265")}, FrameError, "no meaning in the axes 't265'"),
        ({"said": SAID + "# seed: x\n"}, SchemaError, "a.csv"),
        ({"encoding": "utf-16"}, NotALogError, "is UTF-16"),
    ],
)
def test_a_csv_that_leaves_a_question_open_is_refused(tmp_path, options, error, says):
    with pytest.raises(error, match=r"^a\.csv") as caught:
        read_run(csv(tmp_path / "a.csv", **options))
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("0.9,nan,0,0.3,0,0,0,1,0.5,0,0,3\n", NotFiniteError),
        ("nan,1,0,0.3,0,0,0,1,0.5,0,0,3\n", NotFiniteError),
        ("0.9,inf,0,0.3,0,0,0,1,0.5,0,0,3\n", NotFiniteError),
        ("0.9,,0,0.3,0,0,0,1,0.5,0,0,3\n", SchemaError),
        ("0.9,lost,0,0.3,0,0,0,1,0.5,0,0,3\n", SchemaError),
        ("0.9,1_000,0,0.3,0,0,0,1,0.5,0,0,3\n", SchemaError),
        ("0.9,٣,0,0.3,0,0,0,1,0.5,0,0,3\n", SchemaError),  # 3, but no table's digit
        ("0.9,0,45,0,0.3,0,0,0,1,0.5,0,0,3\n", SchemaError),
        ("0.9,0.45,0,0.3,0\n", SchemaError),
        ("0.9,0.45,0,0.3,0,0,0,3,0.5,0,0,3\n", QuaternionError),
        ("0.9,0.45,0,0.3,0,0,0,1,0.5,0,0,9\n", RangeError),
        ("0.9,0.45,0,0.3,0,0,0,1,0.5,0,0,2.5\n", SchemaError),
        ("0.7,0.45,0,0.3,0,0,0,1,0.5,0,0,3\n", TimeOrderError),
    ],
)
def test_a_bad_line_is_dropped_with_its_number(tmp_path, line, error):
    run = read_run(csv(tmp_path / "a.csv", lines=[*LINES[:9], line, *LINES[10:]]))
    (fault,) = run.recovery.faults
    assert (fault.error, fault.where, fault.rows) == (error, "line 13", 1)
    assert run.table.index.tolist() == [*range(9), *range(10, 30)]
    assert run.recovery.rows_dropped == 1


def test_a_last_line_that_may_be_cut_is_not_believed(tmp_path):
    path = csv(tmp_path / "a.csv")
    path.write_bytes(path.read_bytes()[:-3])
    run = read_run(path)
    assert len(run.table) == 29
    assert [fault.error for fault in run.recovery.faults] == [DamagedLogError]


def test_what_was_asked_for_must_not_contradict_the_file(tmp_path):
    path = csv(tmp_path / "a.csv")
    with pytest.raises(ProvenanceError, match="says it is real-Go1, but"):
        read_run(path, provenance=REAL)
    with pytest.raises(FrameError, match="says its axes are 'ros', but 't265'"):
        read_run(path, axes="t265")


# netCDF


def netcdf(path, **changes):
    n = 30
    turn = np.tile([1.0, 0, 0, 0], (n, 1))
    motion = np.tile([0.0, 0, -0.5], (n, 1))
    parts = {
        "time": (0.005 * np.arange(n), {"units": "seconds since 2020-02-02T00:25:14.530611038"}),
        "position": (0.005 * np.arange(n)[:, None] * [0, 0, -0.5], {"units": "m"}),
        "orientation": (turn, {}),
        "quaternion_axis": (np.array([b"w", b"x", b"y", b"z"], dtype=object), {}),
        "linear_velocity": (motion, {"units": "m/s"}),
        "angular_velocity": (0 * motion, {"units": "rad/s"}),
        "confidence": (np.full(n, 30000, dtype=np.int32), {"scale_factor": [0.0001]}),
    } | changes
    with h5py.File(path, "w") as file:
        for name, part in parts.items():
            if part is None:
                continue
            values, attributes = part
            kind = h5py.string_dtype() if values.dtype == object else values.dtype
            file.create_dataset(name, data=values, dtype=kind).attrs.update(attributes)
    return path


def read_nc(path, **options):
    return read_run(path, **({"axes": "t265", "provenance": REAL} | options))


def test_a_netcdf_in_the_t265s_axes_is_turned(tmp_path):
    run = read_nc(netcdf(tmp_path / "a.nc"), strict=True)
    table = run.table
    # Forward, which is -z for the T265, is +x for ROS.
    assert table["x_m"].tolist() == pytest.approx((0.0025 * np.arange(30)).tolist())
    assert table[["y_m", "z_m", "qx", "qy", "qz"]].abs().to_numpy().max() == 0
    assert (table["v_x_mps"] == 0.5).all()
    assert (table["confidence"] == 3).all()
    assert run.info.start_unix_ns == 1580603114_530611038


def test_packed_integers_with_fill_values_are_unpacked(tmp_path):
    packed = np.zeros((30, 3), dtype=np.int32)
    packed[:, 2] = -25 * np.arange(30)
    packed[4] = -(2**31)
    attributes = {"units": "m", "scale_factor": [1e-4], "_FillValue": [-(2**31)]}
    run = read_nc(netcdf(tmp_path / "a.nc", position=(packed, attributes)))
    assert run.table["x_m"].tolist() == pytest.approx([0.0025 * k for k in range(30) if k != 4])
    assert [(f.error, f.where) for f in run.recovery.faults] == [(NotFiniteError, "sample 4")]


UNIT = np.tile([1.0, 0, 0, 0], (30, 1))


@pytest.mark.parametrize(
    ("changes", "options", "error", "says"),
    [
        ({}, {"axes": None}, FrameError, "which way its axes point"),
        ({}, {"axes": "down"}, FrameError, "'down'"),
        ({}, {"provenance": None}, ProvenanceError, "give provenance"),
        ({"quaternion_axis": None}, {}, FrameError, "whether w comes first"),
        (
            {"quaternion_axis": (np.array([b"a", b"x", b"y", b"z"], dtype=object), {})},
            {},
            FrameError,
            "must name w, x, y, z",
        ),
        ({"position": None}, {}, MissingChannelError, "has no position"),
        ({"time": None}, {}, MissingChannelError, "has no time"),
        ({"position": (np.zeros((30, 3)), {"units": "mm"})}, {}, UnitError, "got 'mm'"),
        ({"position": (np.zeros((30, 3)), {})}, {}, UnitError, "got ''"),
        ({"position": (np.zeros((30, 2)), {"units": "m"})}, {}, SchemaError, "(30, 2)"),
        ({"position": (np.zeros((29, 3)), {"units": "m"})}, {}, SchemaError, "differ in length"),
        ({"time": (np.arange(30.0), {"units": "days"})}, {}, UnitError, "'days'"),
        ({"time": (np.arange(30.0), {"units": "seconds since x y"})}, {}, UnitError, "the date"),
        ({"time": (np.full(30, np.nan), {"units": "seconds since 2020-01-01T00:00:00"})}, {},
         NotFiniteError, "first time"),
        ({"orientation": (2 * UNIT, {})}, {}, EmptyLogError, "has length 2.0000, not 1"),
    ],
)  # fmt: skip
def test_a_netcdf_that_leaves_a_question_open_is_refused(tmp_path, changes, options, error, says):
    with pytest.raises(error, match=r"^a\.nc") as caught:
        read_nc(netcdf(tmp_path / "a.nc", **changes), **options)
    assert says in str(caught.value)


def test_a_damaged_netcdf_is_an_error_of_ours(tmp_path):
    data = netcdf(tmp_path / "whole.nc").read_bytes()
    rng = np.random.default_rng(0)
    for cut in rng.integers(1, len(data), 10):
        (tmp_path / "a.nc").write_bytes(data[:cut])
        with pytest.raises(LogError, match=r"^a\.nc"):
            read_nc(tmp_path / "a.nc")


def test_turning_axes_keeps_what_a_rotation_does():
    rng = np.random.default_rng(0)
    q = rng.normal(size=(20, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    v = rng.normal(size=(20, 3))
    moved, turned, body, _ = to_ros(v, q, v, v)
    # The same velocity, once turned into the world again, is the turned velocity.
    assert np.allclose(np.einsum("tij,tj->ti", rotation(turned), body), moved)
    assert np.allclose(np.linalg.norm(body, axis=1), np.linalg.norm(v, axis=1))


# What is what, and folders


@pytest.mark.parametrize(
    ("name", "data", "error", "says"),
    [
        ("a.txt", b"hello", NotALogError, "is none of the formats that are read (bag, cpl, csv"),
        ("a.nc", b"CDF\x01rest", NotALogError, "is netCDF 3"),
        ("a.nc", b"nothing", NotALogError, "is none of the formats"),
        ("a.bag", b"nothing", NotALogError, "is none of the formats"),
        ("a.csv", b"\x1f\x8b rest", NotALogError, "gunzip FILE"),
        ("a.csv", b"a,b,c\n1,2,3\n", NotALogError, "nearest is csv: its header names no column"),
        ("a.db3", b"SQLite format 3\0", DamagedLogError, "cannot be read"),
        ("a.csv", b"", EmptyLogError, "no content"),
    ],
)
def test_what_cannot_be_read_is_refused_by_name(tmp_path, name, data, error, says):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(error) as caught:
        read_run(tmp_path / name, provenance=REAL, axes="ros")
    assert says in str(caught.value)


def test_a_folder_is_one_table_and_says_what_it_left_out(tmp_path, rows_of, info, whole):
    write_run(tmp_path / "a" / "1.mcap", rows_of(30), info)
    (tmp_path / "a" / "2.mcap").write_bytes(whole[:-40])
    (tmp_path / "a" / "3.mcap").write_bytes(b"no log")
    (tmp_path / "a" / "readme.txt").write_text("not a recording")
    bag(tmp_path / "b" / "walk", {"/camera/odom/sample": walk(frame="camera_odom_frame")})
    runs = read_runs(tmp_path)
    assert list(runs.runs) == ["a/1.mcap", "a/2.mcap", "b/walk"]
    assert list(runs.refused) == ["a/3.mcap"]
    assert len(runs.table) == 30 + 100 + 40
    assert runs.table.groupby("run")["provenance"].first().tolist() == [
        "simulated-kinematic", "simulated-kinematic", REAL]  # fmt: skip
    assert runs.table.query("run == 'b/walk'")["kp"].isna().all()
    summary = runs.summary.set_index("run")
    assert summary.loc["a/1.mcap", ["seed", "config.kp", "config.room.light"]].tolist() == [
        17, 1.5, "dim"]  # fmt: skip
    assert summary["whole"].tolist() == [True, False, True]
    assert runs.label == f"{REAL}, simulated-kinematic; 3 runs"
    with pytest.raises(LogError):
        read_runs(tmp_path, strict=True)


def test_a_folder_without_a_log_is_an_error(tmp_path):
    with pytest.raises(EmptyLogError, match="no file ends in"):
        read_runs(tmp_path)
    with pytest.raises(FileNotFoundError, match="folder must exist"):
        read_runs(tmp_path / "nowhere")


@pytest.mark.parametrize("suffix", [".mcap", ".csv"])
def test_what_was_recovered_can_be_saved_and_keeps_its_gaps(tmp_path, whole, suffix):
    data = bytearray(whole)
    data[len(whole) // 2] ^= 1
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    run = read_run(path)
    saved = save_run(run, tmp_path / f"saved{suffix}")
    again = read_run(saved, strict=True)
    pd.testing.assert_frame_equal(again.table, run.table)
    assert again.info.source["file"] == "damaged.mcap"
    assert again.info.source["faults"] == [str(fault) for fault in run.recovery.faults]
    assert len(again.segments()) == 2
    assert (again.info.provenance, again.info.seed) == (run.info.provenance, run.info.seed)
    with pytest.raises(FileExistsError):
        save_run(run, saved)
    with pytest.raises(ValueError, match=r"must end in \.mcap or \.csv"):
        save_run(run, tmp_path / "saved.txt")


def test_thinning_loses_neither_an_error_nor_a_doubt(tmp_path):
    lines = [f"{k / 100},0,0,0,{3 - (k == 4)},{2 * (k == 13)}\n" for k in range(30)]
    header = "t_s,x_m,y_m,yaw_rad,confidence,slam_error\n"
    run = read_run(csv(tmp_path / "a.csv", header, lines)).downsampled(10.0)
    assert run.table["t_s"].tolist() == [0.0, 0.1, 0.2, 0.29]
    assert run.table["confidence"].tolist() == [3, 2, 3, 3]
    assert run.table["slam_error"].tolist() == [0, 0, 2, 0]
    with pytest.raises(ValueError, match="rate_hz must be"):
        run.downsampled(0.0)


def test_a_policys_steps_are_not_thinned(tmp_path, rows_of, info):
    run = read_run(write_run(tmp_path / "a.mcap", rows_of(3), info))
    with pytest.raises(SchemaError, match="policy's steps"):
        run.downsampled(1.0)


def test_files_that_nobody_may_read_are_left_to_the_system(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_run(tmp_path / "none.mcap")
    if os.geteuid():
        path = csv(tmp_path / "a.csv")
        path.chmod(0)
        with pytest.raises(PermissionError):
            read_run(path)
