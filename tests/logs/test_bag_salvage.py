"""ROS 1 bags whose recorder was killed, or that were damaged: what is left, and that it is said."""

import numpy as np
import pandas as pd
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from cpl.cli import main
from cpl.logs import DamagedLogError, LogError, read_run
from cpl.logs.bag_salvage import BAG_MAGIC, survey_bag
from cpl.logs.source import Source
from cpl.store import data_path

REAL = data_path("logs", "real-t265", "test.bag")
STORE = get_typestore(Stores.ROS1_NOETIC)
TOPIC = "/camera/odom/sample"
PROVENANCE = "real-T265-third-party"


@pytest.fixture(scope="module")
def real():
    return REAL.read_bytes()


@pytest.fixture(scope="module")
def whole():
    return read_run(REAL).table


def odometry(k):
    """Return a pose a tenth of a second and of a metre further, as the driver writes it."""
    types = STORE.types
    make = {name.rpartition("/")[2]: kind for name, kind in types.items()}
    stamp = types["builtin_interfaces/msg/Time"](sec=1000 + k // 10, nanosec=k % 10 * 100_000_000)
    header = make["Header"](seq=k, stamp=stamp, frame_id="camera_odom_frame")
    pose = make["Pose"](
        position=make["Point"](x=0.1 * k, y=0.0, z=0.0),
        orientation=make["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    covariance = np.diag([0.01] * 3 + [0.0001] * 3).ravel()
    twist = make["Twist"](
        linear=make["Vector3"](x=1.0, y=0.0, z=0.0), angular=make["Vector3"](x=0.0, y=0.0, z=0.0)
    )
    return types["nav_msgs/msg/Odometry"](
        header=header,
        child_frame_id="camera_pose_frame",
        pose=make["PoseWithCovariance"](pose=pose, covariance=covariance),
        twist=make["TwistWithCovariance"](twist=twist, covariance=covariance),
    )


def bag(path, compression=None, n=60):
    """Write a bag of several chunks and return its bytes."""
    writer = Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    writer.chunk_threshold = 8000
    with writer:
        kind = "nav_msgs/msg/Odometry"
        connection = writer.add_connection(TOPIC, kind, typestore=STORE)
        for k in range(n):
            message = odometry(k)
            at = 1000 * 10**9 + k * 10**8
            writer.write(connection, at, STORE.serialize_ros1(message, kind))
    return path.read_bytes()


def chunks(data):
    """Return where the chunks of a bag begin: their op's mark stands 8 to 64 bytes behind that."""
    places, at = [], 0
    while (at := data.find(b"op=\x05", at)) >= 0:
        places.append(at)
        at += 1
    return places


@pytest.mark.parametrize("share", [0.1, 0.55, 0.999])
def test_a_cut_bag_gives_what_stands_before_the_cut(share, real, whole, tmp_path, capsys):
    path = tmp_path / "cut.bag"
    path.write_bytes(real[: int(share * len(real))])
    run = read_run(path)
    told = run.recovery
    assert not told.whole
    assert told.rows_dropped is None  # how many there were, the lost index knew
    assert 0 < len(run.table) <= len(whole)
    pd.testing.assert_frame_equal(run.table, whole.iloc[: len(run.table)])
    assert any("index at the end is missing" in fault.what for fault in told.faults)
    assert main(["logs", "check", str(path)]) == 1
    shown = capsys.readouterr().out
    assert f"damaged: {len(run.table)} rows" in shown
    assert "carry no checksums" in shown


def test_a_bag_cut_before_its_first_topic_is_unusable(real, tmp_path, capsys):
    path = tmp_path / "cut.bag"
    path.write_bytes(real[: int(0.012 * len(real))])
    with pytest.raises(DamagedLogError, match=r"^cut\.bag: .*no topic is left"):
        read_run(path)
    assert main(["logs", "check", str(path)]) == 2
    assert "unusable (DamagedLog)" in capsys.readouterr().err


@pytest.mark.parametrize("compression", ["NONE", "BZ2", "LZ4"])
def test_cut_at_every_chunk_of_every_compression(compression, tmp_path):
    format_ = Writer.CompressionFormat[compression] if compression != "NONE" else None
    data = bag(tmp_path / "whole.bag", format_)
    places = chunks(data)
    assert len(places) >= 2
    rows = []
    for place in [*places[1:], len(data) - 5]:
        path = tmp_path / "cut.bag"
        path.write_bytes(data[: place - 70])
        table = read_run(path, provenance=PROVENANCE).table
        assert table["x_m"].tolist() == pytest.approx(0.1 * np.arange(len(table)))
        rows.append(len(table))
    assert rows == sorted(rows)
    assert rows[-1] == 60


def test_damage_in_the_middle_costs_its_chunk_and_no_other(tmp_path):
    data = bytearray(bag(tmp_path / "whole.bag"))
    second = chunks(bytes(data))[1]
    message = data.find(b"op=\x02", second)
    data[message - 30 : message + 30] = b"\xff" * 60  # lengths and names of a record in it
    path = tmp_path / "hole.bag"
    path.write_bytes(data)
    run = read_run(path, provenance=PROVENANCE)
    x = run.table["x_m"].round(6).tolist()
    assert x[0] == 0.0
    assert x[-1] == 5.9
    assert len(x) < 60
    assert not run.recovery.whole
    assert run.recovery.rows_dropped == 60 - len(x)  # the index at the end is still there
    assert run.recovery.bytes_dropped > 0


def test_a_bag_without_its_first_bytes_is_known_by_its_chunks(real, whole, tmp_path):
    path = tmp_path / "headless.bag"
    path.write_bytes(real[100:])
    run = read_run(path)
    assert run.recovery.faults[0].what.startswith("the file does not begin as a bag does")
    assert not run.recovery.whole
    assert run.table["x_m"].isin(whole["x_m"]).all()
    assert len(run.table) == len(whole)


def test_a_message_definition_that_was_changed_is_refused(tmp_path):
    data = bag(tmp_path / "whole.bag").replace(b"float64 x\nfloat64 y", b"float64 y\nfloat64 x")
    path = tmp_path / "changed.bag"
    path.write_bytes(data)
    with pytest.raises(LogError, match="is not the one of ROS"):
        read_run(path, provenance=PROVENANCE)


@pytest.mark.parametrize(
    "data",
    [b"", BAG_MAGIC, BAG_MAGIC + b"\xff" * 40, BAG_MAGIC + b"\0" * 40, b"op=\x05" * 50],
    ids=["empty", "bare", "ones", "zeros", "marks"],
)
def test_any_bytes_are_survived(data):
    found = survey_bag(Source.of(data))
    assert found.damages
    assert not found.connections


def flipped(seed, real, tmp_path):
    """Flip one bit: a named error, or rows that are the file's, with the caveat said."""
    data = bytearray(real)
    rng = np.random.default_rng([7, seed])
    data[rng.integers(len(data))] ^= 1 << rng.integers(8)
    if seed % 2:
        del data[int(rng.uniform(0.3, 1.0) * len(data)) :]
    path = tmp_path / "flip.bag"
    path.write_bytes(data)
    try:
        run = read_run(path)
    except LogError as error:
        assert str(error).startswith("flip.bag")  # noqa: PT017 - any of its kinds will do
        return
    assert len(run.table) <= 228
    # A bag cannot show that a digit changed; whoever reads one is told so, every time.
    assert any("no checksums" in note for note in run.recovery.notes)
    if seed % 2:
        assert not run.recovery.whole


@pytest.mark.parametrize("seed", range(3))
def test_a_flipped_bit_is_named_or_said(seed, real, tmp_path):
    flipped(seed, real, tmp_path)


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(3, 63))
def test_sixty_flipped_bits_are_named_or_said(seed, real, tmp_path):
    flipped(seed, real, tmp_path)


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(30))
def test_thirty_cuts_never_change_a_number(seed, real, whole, tmp_path):
    path = tmp_path / "cut.bag"
    path.write_bytes(real[: int(np.random.default_rng([8, seed]).uniform(0, 1) * len(real))])
    try:
        run = read_run(path)
    except LogError as error:
        assert str(error).startswith("cut.bag")  # noqa: PT017 - any of its kinds will do
    else:
        pd.testing.assert_frame_equal(run.table, whole.iloc[: len(run.table)])
        assert not run.recovery.whole
