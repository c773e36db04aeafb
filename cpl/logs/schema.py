"""What does a log hold? Its channels, their fields, units and frames, and its provenances.

One MCAP file a run, JSON messages. A *row* is one policy step (10 Hz); its messages, one a channel,
share the log time (nanoseconds after ``start_unix_ns``) and the sequence number, which is the row's
number. Schemas are Foxglove's where one fits, so that a log opens in its viewer as it is.

===================== ===================== ===== =========================================
topic                 schema                frame columns
===================== ===================== ===== =========================================
/odometry/pose        foxglove.PoseInFrame  world x_m y_m z_m qx qy qz qw yaw_rad
/odometry/twist       cpl.Twist             body  v_x_mps v_y_mps yaw_rate_radps
/odometry/confidence  cpl.Confidence              confidence
/odometry/slam_error  cpl.SlamError               slam_error
/policy/command       cpl.Command           body  cmd_v_x_mps cmd_v_y_mps cmd_yaw_rate_radps
/policy/gain          cpl.Gain                    kp
/policy/waypoint      cpl.Waypoint                waypoint_index
/policy/prediction    cpl.Prediction              l_hat q
/policy/feedback      cpl.Feedback                score err
/supervisor/event     foxglove.Log                supervisor
/truth/pose           cpl.PlanarPose        world true_x_m true_y_m true_yaw_rad
/run/outcome          foxglove.Log                outcome
===================== ===================== ===== =========================================

Only the pose is required. A channel that is there is there in every row, but for the two logs,
which have a message only when there is something to say.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, TypedDict

__all__ = [
    "CHANNELS",
    "COLUMNS",
    "FIELDS",
    "FRAMES",
    "PROVENANCES",
    "SLAM_ERRORS",
    "Channel",
    "Field",
    "Row",
    "channel_of",
    "json_schema",
]

PROVENANCES = (
    "simulated-kinematic",
    "simulated-legged",
    "real-T265-third-party",
    "real-third-party",
    "real-Go1",
    "unstated",
)
# What lies beyond is a number gone wrong: the earth is 4e7 m around, and no robot is that fast.
FARTHEST_M, FASTEST, LARGEST = 1e8, 1e4, 1e12
SLAM_ERRORS = {0: "none", 1: "Vision", 2: "Speed", 3: "Other"}
FRAMES = {
    "world": "right-handed, z up; the origin is where the estimator says it is",
    "body": "x forward, y left, z up; fixed to the robot or to the camera",
}


class Row(TypedDict, total=False):
    """One policy step. `t_s` and the pose are required; NaN means that nobody knows."""

    t_s: float
    x_m: float
    y_m: float
    z_m: float
    qx: float
    qy: float
    qz: float
    qw: float
    yaw_rad: float
    v_x_mps: float
    v_y_mps: float
    yaw_rate_radps: float
    confidence: int
    slam_error: int
    cmd_v_x_mps: float
    cmd_v_y_mps: float
    cmd_yaw_rate_radps: float
    kp: float
    waypoint_index: int
    l_hat: float
    q: float
    score: float
    err: int
    supervisor: str
    true_x_m: float
    true_y_m: float
    true_yaw_rad: float
    outcome: str


@dataclass(frozen=True, kw_only=True)
class Field:
    """One number or word of a message.

    Attributes:
        column: Its name in tables.
        meaning: In words.
        unit: ``-`` for none.
        at: Where it is in the message.
        kind: ``float``, ``int`` or ``text``.
        low: Least value that it can have.
        high: Largest value that it can have.
        nullable: Whether NaN (JSON: null) may stand for "not known".
    """

    column: str
    meaning: str
    at: tuple[str, ...]
    unit: str = "-"
    kind: Literal["float", "int", "text"] = "float"
    low: float = float("-inf")
    high: float = float("inf")
    nullable: bool = False


@dataclass(frozen=True, kw_only=True)
class Channel:
    """A topic of the log.

    Attributes:
        topic: Its name.
        schema: Name of its messages' schema.
        fields: What they hold.
        frame: The frame of the numbers, a key of `FRAMES`; empty where they have none.
        constant: What every message says besides.
        sparse: Whether there is a message only when the text is not empty.
        required: Whether a log without it is unusable.
    """

    topic: str
    schema: str
    fields: tuple[Field, ...]
    frame: str = ""
    constant: dict[str, Any] = field(default_factory=dict)
    sparse: bool = False
    required: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its fields in tables."""
        return tuple(each.column for each in self.fields)

    @property
    def units(self) -> dict[str, str]:
        """Unit by column."""
        return {each.column: each.unit for each in self.fields}


def channel_of(column: str) -> Channel:
    """Return the channel that carries a column.

    Raises:
        ValueError: No channel does.

    Examples:
        >>> channel_of("kp").topic
        '/policy/gain'
    """
    for channel in CHANNELS:
        if column in channel.columns:
            return channel
    msg = f"column must be one of {', '.join(COLUMNS)}, got {column!r}"
    raise ValueError(msg)


def json_schema(channel: Channel) -> dict[str, Any]:
    """Return the JSON schema of a channel's messages.

    Examples:
        >>> json_schema(channel_of("kp"))["properties"]["kp"]["description"]
        'gain [1/s]'
    """
    properties: dict[str, Any] = {"timestamp": _TIME}
    if channel.frame:
        properties["frame_id"] = {"type": "string"}
    for name, value in channel.constant.items():
        properties[name] = {"type": "integer" if isinstance(value, int) else "string"}
    for each in channel.fields:
        _place(properties, each.at, _described(each))
    return {"type": "object", "title": channel.schema, "properties": properties}


_TIME = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}


def _described(each: Field) -> dict[str, Any]:
    kind = {"float": "number", "int": "integer", "text": "string"}[each.kind]
    unit = "" if each.unit == "-" else f" [{each.unit}]"
    type_ = [kind, "null"] if each.nullable else kind
    return {"type": type_, "description": f"{each.meaning}{unit}"}


def _place(properties: dict[str, Any], at: tuple[str, ...], schema: dict[str, Any]) -> None:
    *outer, name = at
    for part in outer:
        inner = properties.setdefault(part, {"type": "object", "properties": {}})
        properties = inner["properties"]
    properties[name] = schema


_LIMITS = {"m": FARTHEST_M, "m/s": FASTEST, "rad/s": FASTEST}


def _flat(column: str, meaning: str, unit: str = "-", **rest: Any) -> Field:  # noqa: ANN401
    limit = _LIMITS.get(unit, LARGEST)
    ends: dict[str, Any] = {"low": -limit, "high": limit, **rest}
    return Field(column=column, meaning=meaning, unit=unit, at=(column,), **ends)


_POSITION = tuple(
    Field(
        column=f"{axis}_m",
        meaning="estimated position",
        unit="m",
        at=("pose", "position", axis),
        low=-FARTHEST_M,
        high=FARTHEST_M,
    )
    for axis in "xyz"
)
_QUATERNION = tuple(
    Field(
        column=f"q{axis}",
        meaning="estimated attitude, body to world, unit quaternion",
        at=("pose", "orientation", axis),
        low=-LARGEST,
        high=LARGEST,
    )
    for axis in "xyzw"
)
_LOG = {"level": 3, "file": "", "line": 0}  # Foxglove's level 3 is a warning

CHANNELS: tuple[Channel, ...] = (
    Channel(
        topic="/odometry/pose",
        schema="foxglove.PoseInFrame",
        frame="world",
        required=True,
        fields=(
            *_POSITION,
            *_QUATERNION,
            _flat("yaw_rad", "estimated heading", "rad"),
        ),
    ),
    Channel(
        topic="/odometry/twist",
        schema="cpl.Twist",
        frame="body",
        fields=(
            _flat("v_x_mps", "estimated forward velocity", "m/s"),
            _flat("v_y_mps", "estimated velocity to the left", "m/s"),
            _flat("yaw_rate_radps", "measured yaw rate", "rad/s"),
        ),
    ),
    Channel(
        topic="/odometry/confidence",
        schema="cpl.Confidence",
        fields=(
            _flat(
                "confidence",
                "the tracker's: 0 failed, 1 low, 2 medium, 3 high",
                kind="int",
                low=0,
                high=3,
            ),
        ),
    ),
    Channel(
        topic="/odometry/slam_error",
        schema="cpl.SlamError",
        fields=(
            _flat(
                "slam_error",
                "since the row before: 0 none, 1 Vision, 2 Speed, 3 Other",
                kind="int",
                low=0,
                high=3,
            ),
        ),
    ),
    Channel(
        topic="/policy/command",
        schema="cpl.Command",
        frame="body",
        fields=(
            _flat("cmd_v_x_mps", "forward velocity sent to the robot", "m/s"),
            _flat("cmd_v_y_mps", "velocity to the left sent to the robot", "m/s"),
            _flat("cmd_yaw_rate_radps", "yaw rate sent to the robot", "rad/s"),
        ),
    ),
    Channel(topic="/policy/gain", schema="cpl.Gain", fields=(_flat("kp", "gain", "1/s", low=0),)),
    Channel(
        topic="/policy/waypoint",
        schema="cpl.Waypoint",
        fields=(_flat("waypoint_index", "the target's index", kind="int", low=0),),
    ),
    Channel(
        topic="/policy/prediction",
        schema="cpl.Prediction",
        fields=(
            _flat(
                "l_hat",
                "predicted probability of a SLAM error two rows later",
                low=0,
                high=1,
                nullable=True,
            ),
            _flat("q", "threshold in force for l_hat", "score", nullable=True),
        ),
    ),
    Channel(
        topic="/policy/feedback",
        schema="cpl.Feedback",
        fields=(
            _flat(
                "score",
                "|l - l_hat| of the prediction two rows earlier, known now",
                "score",
                low=0,
                nullable=True,
            ),
            _flat(
                "err",
                "1 if that score was above the q it met, 0 if not, -1 before any is known",
                kind="int",
                low=-1,
                high=1,
            ),
        ),
    ),
    Channel(
        topic="/supervisor/event",
        schema="foxglove.Log",
        sparse=True,
        constant=_LOG | {"name": "supervisor"},
        fields=(
            Field(
                column="supervisor",
                meaning="why the command sent is not the policy's; empty if it is",
                at=("message",),
                kind="text",
            ),
        ),
    ),
    Channel(
        topic="/truth/pose",
        schema="cpl.PlanarPose",
        frame="world",
        fields=(
            _flat("true_x_m", "true position", "m"),
            _flat("true_y_m", "true position", "m"),
            _flat("true_yaw_rad", "true heading", "rad"),
        ),
    ),
    Channel(
        topic="/run/outcome",
        schema="foxglove.Log",
        sparse=True,
        constant=_LOG | {"name": "run", "level": 2},
        fields=(
            Field(
                column="outcome",
                meaning="in the last row why the run ended, else empty",
                at=("message",),
                kind="text",
            ),
        ),
    ),
)

_TIME_S = _flat("t_s", "time since the run began", "s")
FIELDS: dict[str, Field] = {"t_s": _TIME_S} | {
    each.column: each for channel in CHANNELS for each in channel.fields
}
"""Every column's field, the time's too."""

COLUMNS: dict[str, str] = {
    "t_s": "time since the run began [s]",
    **{
        each.column: each.meaning + ("" if each.unit == "-" else f" [{each.unit}]")
        for channel in CHANNELS
        for each in channel.fields
    },
}
