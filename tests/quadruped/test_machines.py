"""The experiment on recordings of real machines, on the one that is shipped."""

import pandas as pd
import pytest

from cpl.experiments.quadruped import recorded
from cpl.logs.fetch import PACKAGES, RecordingsError

SMOKE = recorded.PROFILES["smoke"]


def test_every_machine_is_met_by_every_forecaster():
    shards = recorded.EXPERIMENT.shards(recorded.PROFILES["paper"])
    assert len(shards) == 36
    assert {shard.text("met") for shard in shards} == set(recorded.MACHINES) - {"t265"}


def test_a_shard_is_a_pure_function_of_the_shipped_bag():
    (shard,) = recorded.EXPERIMENT.shards(SMOKE)
    table = recorded.run_shard(SMOKE, shard)
    assert table[["trained", "met"]].drop_duplicates().to_numpy().tolist() == [["t265", "t265"]]
    assert {"coverage", "coverage_frozen", "bursts", "windows_broken"} <= set(table["number"])
    assert table.set_index("number").loc["windows_broken", "value"] == 0
    pd.testing.assert_frame_equal(recorded.run_shard(SMOKE, shard), table)


def test_without_the_recordings_it_says_how_to_get_them(tmp_path, monkeypatch):
    monkeypatch.setattr("cpl.logs.fetch.project_root", lambda: tmp_path)
    recorded.series.cache_clear()
    with pytest.raises(RecordingsError, match="make recordings"):
        recorded.series("staircase", horizon_s=1.0, step_s=0.1)


def test_no_pose_of_others_is_part_of_the_project():
    from cpl.store import project_root

    names = {name for each in PACKAGES for name in each.files}
    shipped = {path.name for folder in ("data", "tests", "book")
               for path in (project_root() / folder).rglob("*")}  # fmt: skip
    assert not names & shipped


def test_a_machine_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="machines"):
        recorded.Config(machines=("submarine",))
