"""The greedy driver on whole batches."""

import numpy as np
import pytest

from cpl.highway import Config, run_episodes
from cpl.policies import Greedy
from cpl.policies.dqn.initial import initial_network


def test_a_batch_drives_as_one_by_one():
    drive = Greedy(initial_network((25, 16, 5), seed=0))
    obs = np.random.default_rng(0).random((9, 5, 5), dtype=np.float32)
    actions = drive(obs)
    assert actions.dtype == np.int64
    assert actions.tolist() == [int(drive(row[None])[0]) for row in obs]
    assert actions.tolist() == drive(obs.reshape(9, 25)).tolist()
    assert (drive.values(obs).argmax(axis=1) == actions).all()
    assert drive(obs[:0]).shape == (0,)


def test_it_drives_on_the_road():
    table = run_episodes(
        Config(vehicles_count=3, duration=4), Greedy(initial_network((25, 5), 0)), [0]
    )
    assert len(table) == 1


def test_a_wrong_size_is_refused():
    with pytest.raises(ValueError, match="25"):
        Greedy(initial_network((25, 5), 0))(np.zeros((2, 4, 5), np.float32))
