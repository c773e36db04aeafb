"""Two toys for `cpl matter`: a driver who keeps a distance, on a road whose fog comes and goes.

At every step the distance that will be needed is noise; who keeps less than that is hit. In `foggy`
the noise is five times as large in every other block of episodes; in `steady` it never changes.
"""

import gymnasium
import numpy as np

FOG = 5.0


class Lane(gymnasium.Env):
    """The action is the distance kept, in metres; the further, the slower."""

    observation_space = gymnasium.spaces.Box(0, 1, (1,))
    action_space = gymnasium.spaces.Box(-100, 100, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.noise = FOG if (seed // 5) % 2 else 1.0
        self.left = 20
        self.needed = 0.0
        return np.zeros(1), {}

    def step(self, action):
        self.needed = self.noise * abs(float(self.np_random.normal()))
        self.left -= 1
        hit = self.needed > 2.0 * float(action)
        observation = np.array([self.needed])
        return observation, -float(action), hit, self.left == 0, {"kept": float(action)}


def make():
    return Lane()


def act(observation, q):
    return q


def score(before, action, after):
    return float(after[0])


def harm(info, terminated):
    return terminated


def pace(reward, info):
    return reward
