"""Experiments that stand on other experiments: found, computed once, keyed by what went in."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from cpl.experiments.run import graph
from cpl.experiments.run import job as _job
from cpl.experiments.run import publication as _machinery
from cpl.experiments.run.job import job_of
from cpl.experiments.run.publication import publish_result, published, run_job, verify
from cpl.experiments.run.spec import Experiment, Need, grid
from cpl.store import encode_model, table_digest


@dataclass(frozen=True, kw_only=True)
class Base:
    seeds: int = 2
    scale: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Above:
    seeds: int = 2
    scale: float = 1.0
    shift: float = 0.0


@pytest.fixture
def toys(monkeypatch, tmp_path):
    """Two toy experiments under the names of real ones, whose source their digests come from."""
    runs = []

    def make(config, shard):
        runs.append(f"base {shard.name}")
        weights = np.full(2, config.scale * shard.number("seed"))
        return pd.DataFrame(
            {"seed": [shard.number("seed")], "model": [encode_model({"w": weights}, {})]}
        )

    def use(config, shard, inputs):
        runs.append(f"above {shard.name}")
        base = inputs["base"][f"seed-{shard.number('seed')}"]
        return pd.DataFrame({"seed": base["seed"] + config.shift, "bytes": [len(base["model"][0])]})

    def needs(config, shard):
        need = Base(seeds=config.seeds, scale=config.scale)
        return [Need(experiment="proximity", config=need, shards=(shard.name,), name="base")]

    cut = grid("seed-{seed}", seed="seeds")
    common = {"label": "exact", "shards": cut, "extent": ("seeds",)}
    known = {
        "proximity": Experiment(profiles={"paper": Base()}, run=make, **common),
        "pathwise": Experiment(profiles={"paper": Above()}, run=use, needs=needs, **common),
    }
    for module in (_job, _machinery, graph):
        monkeypatch.setattr(module, "experiment", known.__getitem__)
    results = tmp_path / "data" / "results"
    for module in ("published", "paths"):
        monkeypatch.setattr(
            f"cpl.store.{module}.data_path", lambda *parts: results.joinpath(*parts[1:])
        )
    monkeypatch.setattr(
        "cpl.experiments.run.inputs.data_path", lambda *parts: results.joinpath(*parts[1:])
    )
    return SimpleNamespace(runs=runs, known=known, results=results)


def above(**changes):
    return job_of("pathwise", "paper", replace(Above(), **changes))


def test_inputs_are_computed_first_and_once(toys):
    table = run_job(above()).table
    assert table["seed"].tolist() == [0.0, 1.0]
    assert toys.runs == ["base seed-0", "base seed-1", "above seed-0", "above seed-1"]
    run_job(above())
    assert len(toys.runs) == 4


def test_more_seeds_recompute_nothing(toys):
    run_job(above())
    run_job(above(seeds=3))
    assert toys.runs[4:] == ["base seed-2", "above seed-2"]


def test_other_inputs_are_another_key(toys):
    run_job(above())
    run_job(above(scale=2.0))
    assert toys.runs[4:] == toys.runs[:4]


def test_published_inputs_serve_until_asked_to_start_afresh(toys, monkeypatch):
    publish_result(run_job(job_of("proximity", "paper", Base())))
    assert published("proximity", "paper").table["model"].map(bool).all()
    toys.runs.clear()
    monkeypatch.setenv("CPL_STORE", str(toys.results.parent / "empty"))
    first = run_job(above()).table
    assert toys.runs == ["above seed-0", "above seed-1"]
    monkeypatch.setenv("CPL_FRESH", "1")
    monkeypatch.setenv("CPL_STORE", str(toys.results.parent / "empty too"))
    again = run_job(above()).table
    assert toys.runs[2:] == ["base seed-0", "base seed-1", "above seed-0", "above seed-1"]
    assert table_digest(first) == table_digest(again)


def test_verification_runs_the_shard_but_not_its_published_inputs(toys):
    publish_result(run_job(job_of("proximity", "paper", Base())))
    publish_result(run_job(above()))
    toys.runs.clear()
    assert verify("pathwise", "paper", sample=2, seed=0).agrees
    assert toys.runs == ["above seed-0", "above seed-1"]


def test_a_need_for_shards_that_do_not_exist_is_refused(toys):
    def needs(_config, _shard):
        return [Need(experiment="proximity", config=Base(), shards=("seed-9",))]

    toys.known["pathwise"] = replace(toys.known["pathwise"], needs=needs)
    with pytest.raises(ValueError, match=r"shards of 'proximity' must be among its own.*seed-9"):
        run_job(above())
