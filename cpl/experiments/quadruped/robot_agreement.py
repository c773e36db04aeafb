"""How often would the gate between camera and legs end a run without need?

The shipped logs of the twins hold the camera's estimate and the true place. The true place, with a
drift in scale and direction, stands in for the odometry of a robot whose real one nobody here has
recorded. In distribution each alarm is a false one: there the camera loses track only now and then.
Out of distribution the camera is lost for seconds, and an alarm is what the gate is for.
"""

from dataclasses import dataclass
from math import cos, hypot, radians, sin

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard
from cpl.logs import read_run
from cpl.robot.agreement import Agreement, AgreementConfig, compare
from cpl.settings.ranges import Count, Settings
from cpl.store import data_path

__all__ = ["EXPERIMENT", "PROFILES", "Config"]

FOLDERS = ("quadruped", "quadruped-legged")
RANGES = ("in", "out")


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How wrong the odometry is, and how many logs are read.

    Attributes:
        logs: At most so many of each folder and range.
        scale: By which the odometry is off [-].
        turn_deg: By which its direction is off [deg].
    """

    logs: Count
    scale: float = 0.02
    turn_deg: float = 1.0


PROFILES = {"smoke": Config(logs=1), "book": Config(logs=10), "paper": Config(logs=1000)}


def shards(config: Config) -> list[Shard]:
    """Return one shard a folder and range of the gain."""
    del config
    return [
        Shard(f"{folder}-{gains}", {"folder": folder, "range": gains})
        for folder in FOLDERS
        for gains in RANGES
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Hold the gate against the logs of one folder.

    Returns:
        One row a log: `folder`, `range`, `log`, `walked_m`; `apart_m`, the largest difference of
        the two places; `share`, the same over the way walked (at least a metre); `change_m`, the
        largest change of the difference within a second; whether the gate `alarmed`, and at
        which distance, `alarm_m` (NaN if never); and `end_m`, how far from the true place the run
        would have `arrived`.
    """
    folder, gains = shard.text("folder"), shard.text("range")
    paths = sorted(data_path("logs", folder).glob(f"*-{gains}-*.mcap"))[: config.logs]
    turn, scale = radians(config.turn_deg), 1 + config.scale
    rows = []
    for path in paths:
        table = read_run(path).table
        camera, true = (
            table[[f"{which}x_m", f"{which}y_m"]].to_numpy(dtype=np.float64)
            for which in ("", "true_")
        )
        walked = scale * (true - true[0])
        legs = walked @ np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]])
        moved = camera - camera[0]
        rows.append(
            {"folder": folder, "range": gains, "log": path.stem}
            | _held(table["t_s"].to_numpy(dtype=np.float64), moved, legs)
            | {"end_m": float(np.hypot(*(moved[-1] - legs[-1])))}
        )
    return pd.DataFrame(rows)


def _held(t_s: np.ndarray, camera: np.ndarray, legs: np.ndarray) -> dict[str, float | bool]:
    state, config, alarm_m = Agreement(), AgreementConfig(), float("nan")
    apart = share = change = 0.0
    for now, place, by_legs in zip(t_s.tolist(), camera.tolist(), legs.tolist(), strict=True):
        before = state
        state = compare(state, now, tuple(place), tuple(by_legs), config)
        if state.broken and not before.broken:
            alarm_m = hypot(place[0] - by_legs[0], place[1] - by_legs[1])
        _, x, y = state.parts[-1]
        apart = max(apart, hypot(x, y))
        share = max(share, hypot(x, y) / max(1.0, state.walked_m))
        change = max(change, *(hypot(x - u, y - v) for _, u, v in state.parts))
    return {
        "walked_m": state.walked_m,
        "apart_m": apart,
        "share": share,
        "change_m": change,
        "alarmed": state.broken,
        "alarm_m": alarm_m,
    }


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=shards,
    label="simulated-kinematic",
)
