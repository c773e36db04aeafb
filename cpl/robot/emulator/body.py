"""A robot whose eyes never err: the twin's body without its camera, to test everything else."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from cpl.quadruped import Observation
from cpl.quadruped.kinematic.body import STATE, SUBSTEPS, Body, walk
from cpl.rng import stream

__all__ = ["Ideal"]

NOISE_M = 1e-4  # [m] of a pose: a real one never stands still
REACH_M = 4.5  # [m] to the walls


class Ideal:
    """Walk as the twin does and know the pose, but for a tenth of a millimetre.

    >>> world = Ideal()
    >>> world.reset((0.0, 0.0, 0.0), seed=0).confidence
    3
    >>> world.step((0.5, 0.0, 0.0)).t_s
    0.1
    """

    provenance = "simulated-kinematic"

    def __init__(self) -> None:
        self._body = Body().vector
        self._reach = np.full(2, REACH_M)

    def reset(self, start: tuple[float, float, float], seed: int) -> Observation:
        """Put the robot at rest at a pose."""
        self._rng = stream(seed, "robot", "ideal")
        self._state = np.zeros(STATE)
        self._state[:3] = start
        self._steps, self._touched = 0, False
        return self._observe()

    def step(self, command: tuple[float, float, float]) -> Observation:
        """Walk for 0.1 s."""
        poses = np.empty((SUBSTEPS, 12))
        noise = self._rng.standard_normal((SUBSTEPS, 5))
        wanted = np.array(command)
        self._touched |= walk(self._state, wanted, self._body, self._reach, noise, poses)
        self._steps += 1
        return self._observe()

    def _observe(self) -> Observation:
        x, y, yaw, v_x, v_y, turn = self._state[:6].tolist()
        n_x, n_y, n_z = (NOISE_M * self._rng.standard_normal(3)).tolist()
        return Observation(
            t_s=self._steps / 10,
            position=(x + n_x, y + n_y, 0.35 + n_z),
            quaternion=(0.0, 0.0, sin(yaw / 2), cos(yaw / 2)),
            yaw=yaw,
            twist=(v_x, v_y, turn),
            confidence=3,
            slam_error=0,
            true_pose=(x, y, yaw),
            touched=self._touched,
        )
