"""What experiments ask of the trained: one convention, also for a pair that nobody trained yet."""

from dataclasses import replace

import pytest

from cpl.experiments import names
from cpl.experiments.run.job import experiment, job, job_of

UNTRAINED = 11  # published are the pairs 0 to 9
PAIRED = [name for name in names() if hasattr(experiment(name).profiles["paper"], "pairs")]


def asked(task):
    return [need for shard in task.pieces for need in task.needs(shard)]


@pytest.mark.parametrize("name", names())
def test_what_is_needed_are_shards_of_what_is_needed(name):
    for profile in experiment(name).profiles:
        for need in asked(job(name, profile)):
            assert set(need.shards) <= job_of(need.experiment, "+", need.config).pieces.keys()


@pytest.mark.parametrize("name", PAIRED)
def test_a_pair_that_nobody_trained_is_asked_for_like_any_other(name):
    config = replace(experiment(name).profiles["paper"], pairs=UNTRAINED + 1)
    task = job_of(name, "paper+", config)
    needed = asked(task)
    for need in needed:
        assert set(need.shards) <= job_of(need.experiment, "+", need.config).pieces.keys()
    trained = {shard for need in needed for shard in need.shards}
    assert not needed or any(shard.endswith(f"-{UNTRAINED}") for shard in trained)


def test_the_coverage_of_eleven_pairs_is_not_refused():
    task = job("coverage_episodes", "paper", {"pairs": 11})
    policies, forecasters = task.needs("pair-10")
    assert policies.shards == ("safe-10", "speed-10")
    assert policies.config.pairs == forecasters.config.pairs == 11
