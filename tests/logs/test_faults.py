"""Logs whose bytes are whole and whose content is not: each fault has a name and a place."""

import json
import math

import pytest

from cpl.logs import (
    DamagedLogError,
    DuplicateChannelError,
    EmptyLogError,
    FrameError,
    MissingChannelError,
    NotFiniteError,
    ProvenanceError,
    QuaternionError,
    RangeError,
    SchemaError,
    TimeOrderError,
    UnitError,
    read_run,
    write_run,
)
from cpl.logs.info import packed
from cpl.logs.schema import CHANNELS

POSE, TWIST, GAIN = "/odometry/pose", "/odometry/twist", "/policy/gain"


def set_in(topic, *way_and_value):
    *way, name, value = way_and_value

    def spoil(log):
        inner = log.body(topic, 7)
        for part in way:
            inner = inner[part]
        inner[name] = value

    return spoil


def replaced(topic, body):
    def spoil(log):
        next(m for m in log.messages if (m.topic, m.row) == (topic, 7)).body = body

    return spoil


def moved(ns):
    def spoil(log):
        for m in log.of(7):
            m.t += ns

    return spoil


def without(topic):
    def spoil(log):
        log.messages = [m for m in log.messages if (m.topic, m.row) != (topic, 7)]

    return spoil


def twice(log):
    other = next(m for m in log.messages if (m.topic, m.row) == (GAIN, 7))
    log.messages.append(type(other)(**vars(other)))


def twice_differing(log):
    twice(log)
    log.messages[-1].body = log.messages[-1].body | {"kp": 9.0}


def apart(log):
    log.of(7)[2].t += 5_000_000


def lacking(log):
    del log.body(TWIST, 7)["v_y_mps"]


SURVIVED = {
    "NaN position": (set_in(POSE, "pose", "position", "x", math.nan), NotFiniteError),
    "infinite velocity": (set_in(TWIST, "v_x_mps", math.inf), NotFiniteError),
    "number of 400 digits": (replaced(GAIN, b'{"kp":1' + b"0" * 400 + b"}"), NotFiniteError),
    "number of 5000 digits": (replaced(GAIN, b'{"kp":1' + b"0" * 5000 + b"}"), SchemaError),
    "time runs backwards": (moved(-300_000_000), TimeOrderError),
    "time stands still": (moved(-100_000_000), TimeOrderError),
    "messages of a row apart": (apart, TimeOrderError),
    "message twice, differing": (twice_differing, DuplicateChannelError),
    "row without a message": (without(GAIN), MissingChannelError),
    "row without a pose": (without(POSE), MissingChannelError),
    "quaternion of length 2": (set_in(POSE, "pose", "orientation", "w", 2.0), QuaternionError),
    "quaternion of length 0": (
        set_in(POSE, "pose", "orientation", dict.fromkeys("xyzw", 0.0)),
        QuaternionError,
    ),
    "quaternion against heading": (set_in(POSE, "yaw_rad", 3.0), QuaternionError),
    "confidence of 7": (set_in("/odometry/confidence", "confidence", 7), RangeError),
    "SLAM error of -1": (set_in("/odometry/slam_error", "slam_error", -1), RangeError),
    "probability of 1.2": (set_in("/policy/prediction", "l_hat", 1.2), RangeError),
    "err of 2": (set_in("/policy/feedback", "err", 2), RangeError),
    "not JSON": (replaced(GAIN, b'{"kp": 1.'), SchemaError),
    "not UTF-8": (replaced(GAIN, b'{"kp": "\xff\xfe"}'), SchemaError),
    "nested too deep": (replaced(GAIN, b"[" * 100_000), SchemaError),
    "a list": (replaced(GAIN, b"[1.5]"), SchemaError),
    "nothing": (replaced(GAIN, b""), SchemaError),
    "null": (set_in(GAIN, "kp", None), SchemaError),
    "text for a number": (set_in(GAIN, "kp", "1.5"), SchemaError),
    "true for a number": (set_in("/odometry/slam_error", "slam_error", True), SchemaError),
    "fraction for a whole number": (set_in("/policy/waypoint", "waypoint_index", 1.5), SchemaError),
    "field missing": (lacking, SchemaError),
    "frame of a message": (set_in(TWIST, "frame_id", "world"), SchemaError),
}


@pytest.mark.parametrize("name", SURVIVED)
def test_a_bad_row_is_dropped_named_and_nothing_else(name, forger, tmp_path, rows_of, info):
    spoil, error = SURVIVED[name]
    if name == "quaternion of length 0":
        forger.body(POSE, 7)["pose"]["orientation"] = dict.fromkeys("xyzw", 0.0)
    else:
        spoil(forger)
    path = forger.save(tmp_path / "run.mcap")
    run = read_run(path)
    assert run.table.index.tolist() == [*range(7), *range(8, 40)]
    assert run.recovery.rows_dropped == 1
    (fault,) = run.recovery.faults
    assert (fault.error, fault.rows) == (error, 1)
    assert "row 7" in fault.where
    assert len(run.segments()) == 2
    good = read_run(write_run(tmp_path / "good.mcap", rows_of(40), info)).table
    assert run.table.equals(good.drop(index=7))
    with pytest.raises(error, match=r"^run\.mcap: row 7"):
        read_run(path, strict=True)


def test_the_same_message_twice_costs_no_row(forger, tmp_path):
    twice(forger)
    run = read_run(forger.save(tmp_path / "run.mcap"))
    assert len(run.table) == 40
    (fault,) = run.recovery.faults
    assert (fault.error, fault.rows) == (DuplicateChannelError, 0)


def test_a_missing_channel_leaves_its_columns_out_and_is_named(forger, tmp_path):
    forger.messages = [m for m in forger.messages if m.topic != GAIN]
    run = read_run(forger.save(tmp_path / "run.mcap"))
    assert len(run.table) == 40
    assert "kp" not in run.table
    assert run.missing == (GAIN,)
    (fault,) = run.recovery.faults
    assert (fault.error, fault.where) == (MissingChannelError, GAIN)
    with pytest.raises(MissingChannelError, match=r"run\.mcap: has no kp: .*/policy/gain"):
        run.require("t_s", "kp")


def test_a_topic_that_is_not_ours_is_left_alone_and_said(forger, tmp_path):
    forger.channels["/camera"] = {"schema": "x", "frame": "", "units": {}}
    extra = type(forger.messages[0])(topic="/camera", row=3, t=5, body={})
    forger.messages.append(extra)
    run = read_run(forger.save(tmp_path / "run.mcap"), strict=True)
    assert run.recovery.notes == ("1 messages of /camera were not read",)


def no_pose(log):
    log.messages = [m for m in log.messages if m.topic != POSE]


def no_rows(log):
    log.messages = []


def described(**changes):
    def spoil(log):
        from cpl.logs.info import _seal

        for number, copy in enumerate(log.metadata):
            content = {k: v for k, v in (copy | changes).items() if k != "sha256" and v is not None}
            log.metadata[number] = content | {"sha256": _seal(content)}

    return spoil


def channel(topic, **changes):
    return lambda log: log.channels[topic].update(changes)


UNUSABLE = {
    "no row": (no_rows, EmptyLogError, "no usable row"),
    "no pose": (no_pose, MissingChannelError, "there is no pose"),
    "a topic twice": (lambda log: log.twice.append(TWIST), DuplicateChannelError, "is there twice"),
    "millimetres": (
        channel(POSE, units={"x_m": "mm"}),
        UnitError,
        "/odometry/pose: units must be",
    ),
    "no unit": (channel(GAIN, units={}), UnitError, "units must be"),
    "another frame": (channel(TWIST, frame="world"), FrameError, "frame must be 'body'"),
    "another schema": (channel(GAIN, schema="x"), SchemaError, "schema must be 'cpl.Gain'"),
    "another provenance": (described(provenance="real"), ProvenanceError, "got 'real'"),
    "no provenance": (described(provenance=None), ProvenanceError, "lacks 'provenance'"),
    "a later version": (described(version="2"), SchemaError, "version must be '1', got '2'"),
    "units of the whole": (described(units="{}"), UnitError, "units must be"),
    "frames of the whole": (described(frames='{"world":"y up"}'), FrameError, "frames must be"),
    "a channel nobody knows": (described(channels='["/x"]'), SchemaError, "'/x'"),
    "a seed that is none": (described(seed='"three"'), SchemaError, "seed must be"),
    "no description": (
        lambda log: log.metadata.clear(),
        ProvenanceError,
        "does not say where it comes from",
    ),
}


@pytest.mark.parametrize("name", UNUSABLE)
def test_what_spoils_the_whole_is_an_error_with_a_name(name, forger, tmp_path):
    spoil, error, says = UNUSABLE[name]
    spoil(forger)
    with pytest.raises(error, match=r"^run\.mcap: ") as caught:
        read_run(forger.save(tmp_path / "run.mcap"))
    assert says in str(caught.value)


def test_two_descriptions_that_differ_are_not_chosen_from(forger, info, tmp_path):
    topics = tuple(json.loads(forger.metadata[0]["channels"]))
    forger.metadata[1] = packed(type(info)(provenance="real-Go1"), topics, 40)
    with pytest.raises(DamagedLogError, match="contradict each other"):
        read_run(forger.save(tmp_path / "run.mcap"))


def test_rows_before_the_start_are_dropped(forger, info, tmp_path):
    later = type(info)(provenance=info.provenance, start_unix_ns=250_000_000)
    topics = tuple(json.loads(forger.metadata[0]["channels"]))
    forger.metadata = [packed(later, topics), packed(later, topics, 40)]
    run = read_run(forger.save(tmp_path / "run.mcap"))
    assert run.table.index[0] == 3
    assert [fault.error for fault in run.recovery.faults] == [TimeOrderError] * 3


def scaled(rows, factor, *columns):
    return [row | {name: row[name] * factor for name in columns} for row in rows]


NUMBERS = {
    "poses in millimetres": ((1000.0, "x_m", "y_m", "z_m"), UnitError, "poses move at"),
    "poses in kilometres": ((1e-3, "x_m", "y_m", "z_m"), UnitError, "is a unit wrong"),
    "time in milliseconds": ((1000.0, "t_s"), UnitError, "is a unit wrong"),
    "twist in mm/s": ((1000.0, "v_x_mps", "v_y_mps"), UnitError, "the twist says 500 m/s"),
    "yaw rate in degrees": ((180 / math.pi, "yaw_rate_radps"), UnitError, "in degrees?"),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_that_contradict_their_units_are_refused(name, rows_of, info, tmp_path):
    change, error, says = NUMBERS[name]
    path = write_run(tmp_path / "run.mcap", scaled(rows_of(100), *change), info)
    with pytest.raises(error) as caught:
        read_run(path)
    assert says in str(caught.value)


def test_a_world_frame_twist_is_not_taken_for_a_body_frame_one(rows_of, info, tmp_path):
    rows = [
        row | {"v_x_mps": 0.5 * math.cos(row["yaw_rad"]), "v_y_mps": 0.5 * math.sin(row["yaw_rad"])}
        for row in rows_of(100)
    ]
    with pytest.raises(FrameError, match="not recorded in the frame that is claimed"):
        read_run(write_run(tmp_path / "run.mcap", rows, info))


def test_a_lost_estimator_is_not_mistaken_for_a_wrong_unit(rows_of, info, tmp_path):
    frozen = [row | {"x_m": 0.0, "y_m": 0.0} if k > 60 else row
              for k, row in enumerate(rows_of(100))]  # fmt: skip
    jumped = [row | {"x_m": row["x_m"] + 40.0 * (k % 9 == 0)} for k, row in enumerate(rows_of(100))]
    for number, rows in enumerate((frozen, jumped)):
        run = read_run(write_run(tmp_path / f"{number}.mcap", rows, info), strict=True)
        assert len(run.table) == 100


def test_one_row_is_a_log(rows_of, info, tmp_path):
    run = read_run(write_run(tmp_path / "one.mcap", rows_of(1), info), strict=True)
    assert (len(run.table), run.duration_s, len(run.segments())) == (1, 0.0, 1)


def test_no_row_is_none(info, tmp_path):
    with pytest.raises(EmptyLogError, match=r"none\.mcap: has no usable row"):
        read_run(write_run(tmp_path / "none.mcap", [], info))


def test_every_channel_names_a_unit_for_each_of_its_columns():
    for each in CHANNELS:
        assert set(each.units) == set(each.columns)
        assert all(each.units.values())
