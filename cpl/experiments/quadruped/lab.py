"""What the quadruped's experiments share: the lab, the training paths, the policies by name.

The lab was calibrated before any policy was run, in about 20 settings, one after the other, each
judged on the validation zig-zags of `numpy.random.default_rng(0..3)` at constant gains. What was
changed: the room (light, richness, a finer texture), the gait (shake and bounce), the odometry
(detector, smoothing, what counts as registered; partly so that it drifts less where it is not lost,
which had been up to 20 % of the path) and the yaw limit (2 to 3 rad/s). Where it ended: light 0.2,
richness 0.35, 30 ms of exposure, with SLAM errors in 0.000, 0.101 and 0.511 of the steps at gains
of 0.8, 1.5 and 4, four paths each. So the rates at constant gain are chosen, and no finding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import pandas as pd

from cpl.quadruped import (
    GAIN_RULES,
    GainLimits,
    Limits,
    Path,
    Policy,
    PolicyConfig,
    Predictor,
    dataset,
    zigzag,
)
from cpl.quadruped.kinematic import FisheyeCamera, KinematicWorld, Room, WorldConfig
from cpl.quadruped.training import Run
from cpl.rng import stream
from cpl.settings.ranges import Settings

__all__ = [
    "KINEMATIC",
    "POLICIES",
    "RANGES",
    "Hall",
    "Twin",
    "policy",
    "run_seed",
    "training_path",
    "training_runs",
]

LIGHT = 0.2  # [-]
RICHNESS = 0.35  # [-]
EXPOSURE_S = 0.030  # [s]

RANGES = {"in": (1.2, 1.8), "out": (0.8, 4.0)}  # [1/s] Section V-C
POLICIES = ("paper", "no_quantile", "corrected", "constant", "oracle")


@dataclass(frozen=True, kw_only=True)
class Hall(Settings):
    """Where is walked.

    Attributes:
        light: Light level of the hall, 1 = bright [-].
        richness: How much there is to be seen, 0 to 1 [-].
        exposure_s: Exposure time [s].
        room_seed: Paints the hall.
    """

    light: float = LIGHT
    richness: float = RICHNESS
    exposure_s: float = EXPOSURE_S
    room_seed: int = 0


@dataclass(frozen=True, kw_only=True)
class Twin:
    """A simulated robot and the lab that it walks in.

    Attributes:
        label: What kind of evidence its walks are.
        lab: Makes the world from the hall's light and richness [-], the camera's exposure time [s]
            and the seed that paints the hall; that takes a while.
        limits: What the robot may be asked for.
    """

    label: str
    lab: Callable[[float, float, float, int], Any]
    limits: Limits = field(default_factory=Limits)

    def world(self, hall: Hall) -> Any:  # noqa: ANN401 - a `cpl.quadruped.World`, with its config
        """Return the world that all runs of an experiment happen in."""
        return self.lab(hall.light, hall.richness, hall.exposure_s, hall.room_seed)


@lru_cache(maxsize=2)
def _lab(light: float, richness: float, exposure_s: float, room_seed: int) -> KinematicWorld:
    room = Room(light=light, richness=richness)
    camera = FisheyeCamera(exposure_s=exposure_s)
    return KinematicWorld(WorldConfig(room=room, camera=camera, room_seed=room_seed))


KINEMATIC = Twin(label="simulated-kinematic", lab=_lab)


def run_seed(seed: int, *names: str | int) -> int:
    """Return the seed of one run; policies that share the names share the world's noise."""
    return int(stream(seed, "quadruped", *names).integers(2**31))


def training_path(seed: int, trajectory: int, keypoints: int) -> Path:
    """Return a training path by its number."""
    return zigzag(stream(seed, "quadruped", "zigzag", trajectory), keypoints=keypoints)


def policy(name: str, limits: GainLimits, config: PolicyConfig, net: Predictor) -> Policy:
    """Return a fresh policy by its name.

    `oracle` is the corrected rule with the true future label for a forecast.

    Raises:
        ValueError: No such policy.
    """
    if name not in POLICIES:
        raise ValueError(f"name must be one of {POLICIES}, not {name!r}")
    if name == "oracle":
        return Policy(GAIN_RULES["corrected"], limits, config, oracle=True)
    return Policy(GAIN_RULES[name], limits, config, forecast=net)


def training_runs(rows: pd.DataFrame, seed: int, keypoints: int) -> list[Run]:
    """Return features and labels of each collected trajectory.

    Args:
        rows: The table of a collection.
        seed: The seed of the collection, which also drew the paths.
        keypoints: Keypoints a path.
    """
    return [
        dataset(_records(rows, k), training_path(seed, k, keypoints))
        for k in sorted(set(rows["trajectory"].tolist()))
    ]


def _records(rows: pd.DataFrame, trajectory: int) -> list[dict[str, Any]]:
    """Return the log rows of one trajectory."""
    chosen = rows.loc[rows["trajectory"] == trajectory]
    columns = {str(name): chosen[name].tolist() for name in chosen.columns}
    return [
        dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)
    ]
