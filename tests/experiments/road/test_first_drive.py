"""The first rides: the real highway-env, shrunken."""

import numpy as np
import pytest

from cpl.experiments import published
from cpl.experiments.road import first_drive
from cpl.experiments.road.first_drive import EXPERIMENT, PROFILES, Config, along


@pytest.fixture(scope="module")
def ride():
    config = PROFILES["smoke"]
    return EXPERIMENT.run(config, EXPERIMENT.shards(config)[1])


def test_a_ride_starts_with_the_reset_and_has_one_own_row_a_step(ride):
    own = along(ride)
    assert own["step"].tolist() == list(range(len(own)))
    assert set(own["top_speed_mps"]) == {40.0}
    assert own["speed_mps"].iloc[0] == 25.0
    assert own["action"].iloc[-1] == -1


def test_the_nearest_car_of_the_table_is_at_the_distance_that_is_told(ride):
    for _, frame in ride.groupby("step"):
        own = frame[frame["vehicle"] == 0].iloc[0]
        others = frame[frame["vehicle"] > 0]
        gaps = np.hypot(others["x_m"] - own["x_m"], others["y_m"] - own["y_m"])
        assert gaps.min() == pytest.approx(own["l_m"])


def test_both_ranges_start_in_the_same_traffic():
    config = PROFILES["smoke"]
    pieces = EXPERIMENT.shards(config)
    starts = [EXPERIMENT.run(config, shard).query("step == 0") for shard in pieces]
    np.testing.assert_array_equal(starts[0]["x_m"], starts[1]["x_m"])


def test_what_is_published_is_what_the_chapter_tells():
    result = published("first_drive")
    assert result.config == PROFILES["paper"]
    assert result.table.groupby(["top_speed_mps", "ride"]).ngroups == 2 * result.config.rides


@pytest.mark.parametrize(
    ("setting", "value"),
    [("rides", 0), ("levels", 1), ("top_speeds_mps", (20.0,))],
)
def test_impossible_rides_are_refused(setting, value):
    with pytest.raises(ValueError, match=setting):
        Config(**{"rides": 1, "duration_s": 5, setting: value})


def test_the_tolerance_allows_for_other_processors():
    assert 0 < first_drive.EXPERIMENT.rtol < 1e-3
