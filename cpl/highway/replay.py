"""Episodes as JSON, for a viewer that knows nothing of Python.

An episode is its configuration, its seed and its actions: the engine drives it again, exactly, and
writes down every frame. The file is one JSON object::

    format, version   "cpl.highway.replay", 1
    label, seed       what drove, and the seed of the reset
    config            the fields of `Config`
    road              lanes_count, lane_width_m
    car               length_m, width_m
    frame_rate_hz, frames_per_decision
    outcome           crashed, duration_s, distance_m
    decisions         action: [...], reward: [...], series: {name: [number or null, ...]}
    frames            x_m, y_m, heading_rad, speed_mps: one list a frame, one number a car, the ego
                      first; crashed: one list a frame of the cars that have crashed

Frame 0 is the reset; decision d is taken at frame d * frames_per_decision. Numbers are rounded to
a millimetre, 0.1 mrad and 1 mm/s.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from cpl.highway.config import LANE_WIDTH, Config
from cpl.highway.engine import Engine

__all__ = ["Replay", "export_replay", "read_replay", "record_replay"]

_FORMAT, _VERSION = "cpl.highway.replay", 1
_IDLE = 1
_Kind = TypeVar("_Kind")
_CAR = {"length_m": 5.0, "width_m": 2.0}
_TRACKS = {"x_m": 3, "y_m": 3, "heading_rad": 4, "speed_mps": 3}  # name: decimals kept


@dataclass(frozen=True, kw_only=True)
class Replay:
    """An episode, frame by frame.

    Attributes:
        config: the road.
        seed: the seed of its reset.
        label: what drove.
        x_m: position along the road, (frames, cars) [m]; the ego is car 0.
        y_m: position across the road, (frames, cars) [m], to the right.
        heading_rad: (frames, cars) [rad].
        speed_mps: (frames, cars) [m/s].
        crashed: whether each car has crashed, (frames, cars).
        action: the actions, (decisions,).
        reward: what each earned, (decisions,).
        series: further numbers of each decision, such as a threshold; NaN where there is none.
    """

    config: Config
    seed: int
    label: str
    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    heading_rad: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    crashed: NDArray[np.bool_]
    action: NDArray[np.int64]
    reward: NDArray[np.float64]
    series: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


def record_replay(
    config: Config,
    seed: int,
    actions: Sequence[int] | NDArray[np.integer],
    *,
    label: str = "",
    series: Mapping[str, Sequence[float] | NDArray[np.floating]] | None = None,
) -> Replay:
    """Drive an episode again and write down every frame.

    Args:
        config: the road.
        seed: the seed of its reset.
        actions: the actions taken, as many as are to be shown and no more than the episode had.
        label: what drove.
        series: numbers that belong to the decisions, as many as actions each.

    Returns:
        The episode.

    Raises:
        ValueError: for an action out of range, actions after the episode's end, or a series of
            another length.

    Example:
        >>> replay = record_replay(Config(vehicles_count=3), 7, [1, 3], label="faster")
        >>> replay.x_m.shape
        (31, 4)
    """
    stream = np.asarray(actions, dtype=np.int64)
    named = {name: np.asarray(values, dtype=np.float64) for name, values in (series or {}).items()}
    for name, values in named.items():
        if values.shape != stream.shape:
            raise ValueError(f"series {name!r} has shape {values.shape}, not {stream.shape}")
    engine, seeds = Engine(config, 1), np.array([seed])
    frames = Engine(_frame_by_frame(config), 1)
    engine.reset(seeds)
    frames.reset(seeds)
    rewards, rows, ended = [], [_row(frames)], False
    for number, action in enumerate(stream):
        if ended:
            raise ValueError(f"actions has {len(stream)} entries; the episode ended at {number}")
        out = engine.step(np.array([action]))
        rewards.append(float(out.reward[0]))
        ended = bool(out.terminated[0] or out.truncated[0])
        for frame in range(config.frames):
            frames.step(np.array([action if frame == 0 else _IDLE]))
            rows.append(_row(frames))
    x, y, heading, speed, crashed = (np.stack(column) for column in zip(*rows, strict=True))
    return Replay(
        config=config,
        seed=seed,
        label=label,
        x_m=x,
        y_m=y,
        heading_rad=heading,
        speed_mps=speed,
        crashed=crashed,
        action=stream,
        reward=np.array(rewards),
        series=named,
    )


def export_replay(path: Path | str, replay: Replay) -> Path:
    """Write an episode as one JSON file, whole or not at all.

    Args:
        path: where to.
        replay: the episode.

    Returns:
        The path.
    """
    from cpl.store import atomic_write

    document = _document(replay)
    _replay(document)
    text = json.dumps(document, separators=(",", ":"), allow_nan=False)
    return atomic_write(Path(path), text + "\n")


def read_replay(path: Path | str) -> Replay:
    """Read and check an episode.

    Args:
        path: a file that `export_replay` wrote.

    Returns:
        The episode, with the numbers as rounded in the file.

    Raises:
        ValueError: naming what is missing or does not fit together.
    """
    content = Path(path).read_text(encoding="utf-8")
    try:
        document = json.loads(content, parse_constant=_refuse)
    except ValueError as error:
        raise ValueError(f"{path} is not a replay: {error}") from error
    try:
        return _replay(document)
    except ValueError as error:
        raise ValueError(f"{path} is not a replay: {error}") from error


def _frame_by_frame(config: Config) -> Config:
    """The same road with a decision each frame; what only the observation draws is left out."""
    return replace(
        config,
        policy_frequency=config.simulation_frequency,
        observation_noise=0.0,
        observation_dropout=0.0,
        order="sorted",
    )


def _row(engine: Engine) -> tuple[NDArray[Any], ...]:
    state = engine.state()
    names = ("x", "y", "heading", "speed", "crashed")
    return tuple(np.array(getattr(state, name)[0]) for name in names)


def _document(replay: Replay) -> dict[str, Any]:
    config = replay.config
    return {
        "format": _FORMAT,
        "version": _VERSION,
        "label": replay.label,
        "seed": int(replay.seed),
        "config": asdict(config),
        "road": {"lanes_count": config.lanes_count, "lane_width_m": LANE_WIDTH},
        "car": _CAR,
        "frame_rate_hz": config.simulation_frequency,
        "frames_per_decision": config.frames,
        "outcome": {
            "crashed": bool(replay.crashed[-1, 0]),
            "duration_s": len(replay.action) / config.policy_frequency,
            "distance_m": round(float(replay.x_m[-1, 0] - replay.x_m[0, 0]), 3),
        },
        "decisions": {
            "action": replay.action.tolist(),
            "reward": replay.reward.tolist(),
            "series": {
                name: [None if np.isnan(v) else v for v in values.tolist()]
                for name, values in replay.series.items()
            },
        },
        "frames": {
            **{n: np.round(getattr(replay, n), digits).tolist() for n, digits in _TRACKS.items()},
            "crashed": [np.flatnonzero(row).tolist() for row in replay.crashed],
        },
    }


def _replay(document: object) -> Replay:
    """Build the episode from a file's object, checking every part of it."""
    whole = _mapping(document, "the file")
    if (whole.get("format"), whole.get("version")) != (_FORMAT, _VERSION):
        raise ValueError(f"format and version must be {_FORMAT!r} and {_VERSION}")
    config = _config(_part(whole, "config", dict))
    decisions, frames = _part(whole, "decisions", dict), _part(whole, "frames", dict)
    action = _numbers(_part(decisions, "action", list), "action", (None,))
    if not (np.isin(action, range(5)).all()):
        raise ValueError("action holds something else than 0 to 4")
    count, cars = len(action) * config.frames + 1, config.vehicles_count + 1
    tracks = {name: _numbers(_part(frames, name, list), name, (count, cars)) for name in _TRACKS}
    if any(np.isnan(track).any() for track in tracks.values()):
        raise ValueError("frames hold a null")
    return Replay(
        config=config,
        seed=_part(whole, "seed", int),
        label=_part(whole, "label", str),
        **tracks,
        crashed=_crashed(_part(frames, "crashed", list), count, cars),
        action=action.astype(np.int64),
        reward=_numbers(_part(decisions, "reward", list), "reward", action.shape),
        series={
            name: _numbers(values, name, action.shape)
            for name, values in _part(decisions, "series", dict).items()
        },
    )


def _config(options: dict[str, Any]) -> Config:
    plain: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in options.items()}
    try:
        return Config(**plain)
    except TypeError as error:
        raise ValueError(f"config does not fit: {error}") from error


def _crashed(rows: list[Any], count: int, cars: int) -> NDArray[np.bool_]:
    table = np.zeros((count, cars), dtype=np.bool_)
    if len(rows) != count:
        raise ValueError(f"crashed has {len(rows)} frames, not {count}")
    for frame, row in enumerate(rows):
        for car in row:
            if not isinstance(car, int) or not 0 <= car < cars:
                raise ValueError(f"crashed names car {car!r} of {cars}")
            table[frame, car] = True
    return table


def _numbers(values: object, name: str, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} is not an array of numbers") from error
    if len(array.shape) != len(shape) or any(
        want not in (None, have) for want, have in zip(shape, array.shape, strict=True)
    ):
        raise ValueError(f"{name} has shape {array.shape}, not {shape}")
    return array


def _mapping(value: object, name: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{name} is not an object")
    return value


def _part(whole: Mapping[str, Any], name: str, kind: type[_Kind]) -> _Kind:
    if not isinstance(whole.get(name), kind):
        raise ValueError(f"{name} is missing or not a {kind.__name__}")
    return whole[name]


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no JSON number")
