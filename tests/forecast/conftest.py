"""A small road, a driver who looks a little, and rollouts of it."""

from dataclasses import replace

import numpy as np
import pytest

from cpl.forecast.rollouts import collect
from cpl.highway import PAPER


@pytest.fixture(scope="session")
def small_road():
    """Few cars and a short episode, observed as on the paper's road."""
    return replace(PAPER, vehicles_count=12, duration=16.0)


@pytest.fixture(scope="session")
def weaving():
    """A driver that depends on what it sees and on nothing else."""

    def drive(obs):
        return np.where(obs[:, 1, 1] < 0.2, 0, np.where(obs[:, 0, 2] > 0.4, 3, 2)).astype(np.int64)

    return drive


@pytest.fixture(scope="session")
def rollouts(small_road, weaving):
    """Sixty episodes, some of them with a crash."""
    return collect(small_road, weaving, np.arange(60), n_envs=16)
