"""The same walk in every format that is read, made here: to test with, and to damage."""

import io
import json
import math
import sqlite3
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

from cpl.logs import RunInfo
from cpl.logs.writer import encoded_run

START_NS = 1_700_000_000 * 10**9
STEP_NS = 50_000_000
RATE_HZ = 20.0
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
TOPIC = "/camera/odom/sample"


@dataclass(frozen=True)
class Pose:
    """One pose of the walk, in ROS's axes."""

    stamp_ns: int
    x: float
    y: float
    z: float
    yaw: float

    @property
    def q(self):
        return 0.0, 0.0, math.sin(self.yaw / 2), math.cos(self.yaw / 2)


def walk(n=60):
    """A circle of 2 m radius, at 0.5 m/s."""
    turn = [0.25 * k / RATE_HZ for k in range(n)]
    return [
        Pose(START_NS + k * STEP_NS, 2 * math.sin(a), 2 - 2 * math.cos(a), 0.3, a)
        for k, a in enumerate(turn)
    ]


def tum(poses):
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for p in poses:
        qx, qy, qz, qw = p.q
        lines.append(f"{_s(p)} {p.x:.9f} {p.y:.9f} {p.z} {qx} {qy} {qz:.12f} {qw:.12f}")
    return _text(lines)


def tum_commas(poses):
    lines = ["timestamp,tx,ty,tz,qx,qy,qz,qw"]
    lines += [line.replace(" ", ",") for line in tum(poses).decode().splitlines()[1:]]
    return _text(lines)


def kitti(poses):
    """In the axes of a camera: x right, y down, z forward."""
    lines = []
    for p in poses:
        c, s = math.cos(p.yaw), math.sin(p.yaw)
        m = [[c, 0, -s, -p.y], [0, 1, 0, -p.z], [s, 0, c, p.x]]
        lines.append(" ".join(f"{value:.12e}" for row in m for value in row))
    return _text(lines)


def euroc(poses):
    names = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y []"
    names += ", q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]"
    lines = [names]
    for p in poses:
        qx, qy, qz, qw = p.q
        numbers = (p.stamp_ns, p.x, p.y, p.z, qw, qx, qy, qz, 0.5, 0.0, 0.0)
        lines.append(",".join(map(repr, numbers)))
    return _text(lines)


def rsconvert(poses):
    """In the T265's axes: x right, y up, z backward."""
    lines = [
        "Stream Type,F#,HW Timestamp (ms),Backend Timestamp(ms),Host Timestamp(ms),"
        "3DOF_x,3DOF_y,3DOF_z,6DOF_x,6DOF_y,6DOF_z,6DOF_w"
    ]
    for k, p in enumerate(poses):
        ms = f"{p.stamp_ns // 10**6}.0000"
        _, _, qz, qw = p.q
        lines.append(f"Pose,{k},{ms},{ms},{ms},{-p.y!r},{p.z!r},{-p.x!r},0.0,{qz!r},0.0,{qw!r}")
        lines.append(f"Gyro,{k},{ms},{ms},{ms},0.0,0.1,0.0")
    return _text(lines)


def t265(poses):
    """As scripts around pyrealsense2 save it, in the T265's axes."""
    lines = [
        "timestamp_ms,translation_x,translation_y,translation_z,rotation_x,rotation_y,rotation_z,"
        "rotation_w,velocity_x,tracker_confidence,mapper_confidence"
    ]
    for p in poses:
        _, _, qz, qw = p.q
        lines.append(
            f"{p.stamp_ns // 10**6},{-p.y!r},{p.z!r},{-p.x!r},0.0,{qz!r},0.0,{qw!r},0.0,3,2"
        )
    return _text(lines)


def rostopic(poses):
    names = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    names += [f"field.pose.pose.position.{axis}" for axis in "xyz"]
    names += [f"field.pose.pose.orientation.{axis}" for axis in "xyzw"]
    names += [f"field.pose.covariance{k}" for k in range(36)]
    names += [
        f"field.twist.twist.{part}.{axis}" for part in ("linear", "angular") for axis in "xyz"
    ]
    lines = [",".join(names)]
    covariance = np.diag([0.01] * 3 + [0.0001] * 3).ravel().tolist()
    for k, p in enumerate(poses):
        numbers = [p.stamp_ns, k, p.stamp_ns, "odom", p.x, p.y, p.z, *p.q, *covariance]
        lines.append(",".join(map(str, [*numbers, 0.5, 0.0, 0.0, 0.0, 0.0, 0.25])))
    return _text(lines)


def csv(poses):
    lines = ["# provenance: real-third-party", "# axes: ros", "t_s,x_m,y_m,z_m,qx,qy,qz,qw"]
    lines += [",".join([_s(p), repr(p.x), repr(p.y), repr(p.z), *map(repr, p.q)]) for p in poses]
    return _text(lines)


def semicolons(poses):
    lines = csv(poses).decode().splitlines()
    return _text([*lines[:2], *(each.replace(",", ";").replace(".", ",") for each in lines[2:])])


def cpl(poses):
    rows = [
        {
            "t_s": (p.stamp_ns - START_NS) / 1e9, "x_m": p.x, "y_m": p.y, "z_m": p.z,
            **dict(zip(("qx", "qy", "qz", "qw"), p.q, strict=True)), "yaw_rad": p.yaw,
        }
        for p in poses
    ]  # fmt: skip
    return encoded_run(rows, RunInfo(provenance="simulated-kinematic", start_unix_ns=START_NS))


def odometry(store, p, k=0):
    """The pose as a message of ROS 1 or 2, as the realsense-ros driver writes it."""
    make = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    sec, nanosec = divmod(p.stamp_ns, 10**9)
    stamp = store.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    extra = {"seq": k} if store is ROS1 else {}
    qx, qy, qz, qw = p.q
    covariance = np.diag([0.01] * 3 + [0.0001] * 3).ravel()
    vector = make["Vector3"]
    return store.types["nav_msgs/msg/Odometry"](
        header=make["Header"](stamp=stamp, frame_id="camera_odom_frame", **extra),
        child_frame_id="camera_pose_frame",
        pose=make["PoseWithCovariance"](
            pose=make["Pose"](
                position=make["Point"](x=p.x, y=p.y, z=p.z),
                orientation=make["Quaternion"](x=qx, y=qy, z=qz, w=qw),
            ),
            covariance=covariance,
        ),
        twist=make["TwistWithCovariance"](
            twist=make["Twist"](
                linear=vector(x=0.5, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.25)
            ),
            covariance=covariance,
        ),
    )


KIND = "nav_msgs/msg/Odometry"


def bag(poses, compression=None):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.bag"
        writer = Bag1Writer(path)
        if compression:
            writer.set_compression(Bag1Writer.CompressionFormat[compression])
        writer.chunk_threshold = 8000
        with writer:
            connection = writer.add_connection(TOPIC, KIND, typestore=ROS1)
            for k, p in enumerate(poses):
                raw = ROS1.serialize_ros1(odometry(ROS1, p, k), KIND)
                writer.write(connection, p.stamp_ns, raw)
        return path.read_bytes()


def bag_bz2(poses):
    return bag(poses, "BZ2")


def bag_lz4(poses):
    return bag(poses, "LZ4")


def db3(poses):
    with tempfile.TemporaryDirectory() as folder:
        return next(bag2(Path(folder) / "a", poses).glob("*.db3")).read_bytes()


def packed(plugin, mode):
    """The one file of a ROS 2 bag that is compressed."""

    def made(poses):
        with tempfile.TemporaryDirectory() as folder:
            path = bag2(Path(folder) / "a", poses, plugin, mode)
            return next(path.glob("a.*")).read_bytes()

    return made


def bag2(path, poses, plugin=StoragePlugin.SQLITE3, mode=CompressionMode.NONE):
    """Write a ROS 2 bag's folder."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writer = Bag2Writer(path, version=9, storage_plugin=plugin)
        writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            connection = writer.add_connection(TOPIC, KIND, typestore=ROS2)
            for p in poses:
                raw = ROS2.serialize_cdr(odometry(ROS2, p), KIND)
                writer.write(connection, p.stamp_ns, bytes(raw))
    return path


def mcap_ros2(poses, *, compression=CompressionType.ZSTD, chunked=True, summary=True, crc=True):
    """ROS 2 messages in MCAP as some program writes them."""
    out = io.BytesIO()
    writer = Writer(
        out,
        chunk_size=8000,
        compression=compression,
        use_chunking=chunked,
        use_statistics=summary,
        use_summary_offsets=summary,
        repeat_channels=summary,
        repeat_schemas=summary,
        index_types=IndexType.ALL if summary else IndexType.NONE,
        enable_crcs=crc,
    )
    writer.start(profile="ros2", library="field")
    definition = ROS2.generate_msgdef(KIND, ros_version=2)[0]
    schema = writer.register_schema(KIND, "ros2msg", definition.encode())
    channel = writer.register_channel(TOPIC, "cdr", schema)
    for k, p in enumerate(poses):
        raw = bytes(ROS2.serialize_cdr(odometry(ROS2, p), KIND))
        writer.add_message(channel, p.stamp_ns, raw, p.stamp_ns, k)
    writer.finish()
    return out.getvalue()


def mcap_lz4(poses):
    return mcap_ros2(poses, compression=CompressionType.LZ4)


def mcap_loose(poses):
    """Without chunks, checksums or a summary, as the fastest preset writes it."""
    return mcap_ros2(
        poses, compression=CompressionType.NONE, chunked=False, summary=False, crc=False
    )


def mcap_json(poses):
    """Foxglove's poses in JSON."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=4000)
    writer.start()
    schema = writer.register_schema("foxglove.PoseInFrame", "jsonschema", b"{}")
    channel = writer.register_channel("/pose", "json", schema)
    for k, p in enumerate(poses):
        sec, nsec = divmod(p.stamp_ns, 10**9)
        pose = {
            "position": {"x": p.x, "y": p.y, "z": p.z},
            "orientation": dict(zip("xyzw", p.q, strict=True)),
        }
        body = {"timestamp": {"sec": sec, "nsec": nsec}, "frame_id": "world", "pose": pose}
        writer.add_message(channel, p.stamp_ns, json.dumps(body).encode(), p.stamp_ns, k)
    writer.finish()
    return out.getvalue()


def netcdf(poses, change=lambda file: None):
    """As rigid-body-motion writes it; `change` may spoil the open file."""
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        file.attrs["provenance"], file.attrs["axes"] = "real-third-party", "ros"
        file["time"] = np.array([p.stamp_ns for p in poses])
        file["time"].attrs["units"] = "nanoseconds since 1970-01-01 00:00:00"
        file["position"] = np.array([[p.x, p.y, p.z] for p in poses])
        file["position"].attrs["units"] = "m"
        file["orientation"] = np.array([p.q for p in poses])
        file["quaternion_axis"] = np.array([b"x", b"y", b"z", b"w"])
        change(file)
    return out.getvalue()


def _s(p):
    return f"{p.stamp_ns // 10**9}.{p.stamp_ns % 10**9:09d}"


def _text(lines):
    return ("\n".join(lines) + "\n").encode()


def sqlite_again(data, script):
    """Run SQL on the bytes of a database."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.db3"
        path.write_bytes(data)
        link = sqlite3.connect(path)
        link.executescript(script)
        link.close()
        return path.read_bytes()


# By name: the format that it must be taken for, how it is made, and what its reader has to say.
SAMPLES = {
    "tum": ("tum", tum, {}),
    "tum with commas": ("tum", tum_commas, {}),
    "kitti": ("kitti", kitti, {"pose_rate_hz": RATE_HZ}),
    "euroc": ("euroc", euroc, {}),
    "rs-convert": ("rsconvert", rsconvert, {}),
    "t265 export": ("t265", t265, {}),
    "rostopic echo -p": ("rostopic", rostopic, {}),
    "csv": ("csv", csv, {}),
    "csv with semicolons": ("csv", semicolons, {}),
    "cpl": ("cpl", cpl, {}),
    "ros 1 bag": ("bag", bag, {}),
    "ros 1 bag, bz2": ("bag", bag_bz2, {}),
    "ros 1 bag, lz4": ("bag", bag_lz4, {}),
    "ros 2 db3": ("ros2", db3, {}),
    "ros 2 db3, packed": ("ros2", packed(StoragePlugin.SQLITE3, CompressionMode.FILE), {}),
    "ros 2 db3, packed messages": (
        "ros2",
        packed(StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        {},
    ),
    "ros 2 mcap, packed": ("ros2", packed(StoragePlugin.MCAP, CompressionMode.FILE), {}),
    "ros 2 mcap, packed messages": (
        "mcap",
        packed(StoragePlugin.MCAP, CompressionMode.MESSAGE),
        {},
    ),
    "ros 2 mcap": ("mcap", mcap_ros2, {}),
    "ros 2 mcap, lz4": ("mcap", mcap_lz4, {}),
    "ros 2 mcap, no chunks": ("mcap", mcap_loose, {}),
    "foxglove json mcap": ("mcap", mcap_json, {}),
    "netcdf": ("netcdf", netcdf, {}),
}
