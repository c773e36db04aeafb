"""A world without rendering: an exact body whose SLAM errors are scripted by the test."""

import math
from dataclasses import replace

import pytest

from cpl.quadruped import Observation


class PlainWorld:
    """Follow every command exactly; report the errors given for each step, and no drift."""

    provenance = "test"

    def __init__(self, errors=(), lost=(), walls=()):
        self.errors, self.lost, self.walls = set(errors), set(lost), set(walls)
        self.commands = []

    def reset(self, start, seed):
        del seed
        self.k, self.pose, self.commands = 0, start, []
        return self.observe()

    def step(self, command):
        x, y, yaw = self.pose
        c, s = math.cos(yaw), math.sin(yaw)
        x += 0.1 * (c * command[0] - s * command[1])
        y += 0.1 * (s * command[0] + c * command[1])
        self.pose = (x, y, yaw + 0.1 * command[2])
        self.k += 1
        self.commands.append(command)
        return self.observe()

    def fork(self):
        twin = PlainWorld(self.errors, self.lost, self.walls)
        twin.k, twin.pose = self.k, self.pose
        return twin

    def observe(self):
        x, y, yaw = self.pose
        seen = Observation(
            t_s=self.k / 10,
            position=(x, y, 0.0),
            quaternion=(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
            yaw=yaw,
            twist=(0.0, 0.0, 0.0),
            confidence=0 if self.k in self.lost else 3,
            slam_error=int(self.k in self.errors),
            true_pose=self.pose,
        )
        return replace(seen, touched=self.k in self.walls)


@pytest.fixture
def plain_world():
    """Return the class, so that a test chooses the script."""
    return PlainWorld
