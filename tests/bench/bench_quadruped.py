"""How much faster than real time is the kinematic twin, and what does its time go to?"""

from collections.abc import Iterator

import numpy as np

from cpl.quadruped import GainLimits, Policy, PolicyConfig, constant_gain, run, shape
from cpl.quadruped.kinematic import FisheyeCamera, KinematicWorld, Room, WorldConfig
from tests.bench.frame import Row, fastest

PACKAGES = ("opencv-python-headless",)

STEPS = 50  # policy steps of 0.1 s a round


def measure() -> Iterator[Row]:
    """Time runs in a bright and in the dim hall of the experiments, at a low and a high gain."""
    halls = {
        "bright": WorldConfig(),
        "dim": WorldConfig(
            room=Room(light=0.2, richness=0.35), camera=FisheyeCamera(exposure_s=0.03)
        ),
    }
    for name, config in halls.items():
        world = KinematicWorld(config)
        for kp in (1.5, 4.0):
            seconds = fastest({"cpl": lambda world=world, kp=kp: _drive(world, kp)}, rounds=3)
            yield Row(
                bench=f"quadruped: twin, {name} hall, kp {kp}",
                subject="cpl",
                value=seconds["cpl"] / (STEPS * 0.1),
                unit="s/simulated s",
                limit=0.2,  # five times real time
            )
    yield from _parts(KinematicWorld(halls["dim"]))


def _drive(world: KinematicWorld, kp: float) -> None:
    limits = GainLimits(kp_min=kp, kp_max=kp)
    policy = Policy(constant_gain, limits, PolicyConfig())
    rows = run(world, shape("hexagon"), policy, None, 0)
    for _ in range(STEPS):
        next(rows)


def _parts(world: KinematicWorld) -> Iterator[Row]:
    """Time a picture alone: rendering against the whole step."""
    world.reset((0.0, 0.0, 0.0), 0)
    world.step((0.5, 0.0, 1.0))
    poses = np.concatenate([world._poses, world._poses])
    seconds = fastest({"cpl": lambda: [world._photograph(poses) for _ in range(30)]}, rounds=5)
    yield Row(
        bench="quadruped: a picture of 212 x 200",
        subject="cpl",
        value=1e3 * seconds["cpl"] / 30,
        unit="ms",
    )
