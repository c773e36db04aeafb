import re
from dataclasses import replace

import pytest

from cpl.experiments import compute, names, published, verify
from cpl.experiments.run import publication as machinery
from cpl.experiments.run.found import module_of
from cpl.experiments.run.job import question
from cpl.experiments.run.spec import Shard
from cpl.experiments.theory import split_conformal
from cpl.store import DamagedResultError, import_closure

THEORY = [
    "adaptive_step", "certificates", "eventually_safe", "miscoverage", "pathwise", "proximity",
    "quantile_range", "split_conformal", "update_rule", "windows",
]  # fmt: skip


@pytest.fixture
def layer(tmp_path, monkeypatch):
    """A published layer of the test's own."""
    folder = tmp_path / "results"
    monkeypatch.setattr("cpl.store.published.data_path", lambda *parts: folder.joinpath(*parts[1:]))
    return folder


def uniform(_kind, draws, size, rng):
    return rng.random((draws, size))


@pytest.fixture
def small(monkeypatch):
    """Let the profile that is published be the small one."""
    profiles = {**split_conformal.PROFILES, "paper": split_conformal.PROFILES["smoke"]}
    shrunken = replace(split_conformal.EXPERIMENT, profiles=profiles)
    monkeypatch.setattr(split_conformal, "EXPERIMENT", shrunken)
    return shrunken


def test_the_theory_experiments_are_there_and_not_imported_by_the_package():
    assert set(THEORY) <= set(names())
    closure = import_closure("cpl.experiments")
    assert not any(module_of(name) in closure for name in THEORY)


@pytest.mark.parametrize("name", names())
def test_every_experiment_keeps_the_contract(name):
    spec = machinery.experiment(name)
    assert list(spec.profiles) == ["smoke", "book", "paper"]
    assert "?" in question(name)
    for config in spec.profiles.values():
        pieces = spec.shards(config)
        assert len({piece.name for piece in pieces}) == len(pieces)
        assert type(config).__dataclass_params__.frozen


@pytest.mark.parametrize("name", sorted(set(THEORY) - {"proximity"}))
def test_every_experiment_does_not_depend_on_how_it_is_kept(name):
    """Its key must not change when the store, the fan-out or the machinery does.

    (The highway's package imports the store; what runs on it depends on both.)
    """
    closure = set(import_closure(module_of(name)))
    assert not closure & {"cpl.store", "cpl.sweep", "cpl.experiments.run.publication"}


def test_compute_is_pure_and_found_again():
    first, second = compute("miscoverage", "smoke"), compute("miscoverage", "smoke")
    assert first.provenance.content == second.provenance.content
    assert first.provenance.seconds == second.provenance.seconds
    assert first.provenance.seeds == {"seed": 0}
    assert "smoke" in str(first.provenance)
    other = compute("miscoverage", "smoke", seed=1, alphas=(0.3,))
    assert other.provenance.profile == "smoke+"
    assert other.provenance.content != first.provenance.content
    assert other.config.alphas == (0.3,)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("split_conformol",), r"no experiment 'split_conformol'; did you mean 'split_conformal'"),
        (("_machinery",), "no experiment '_machinery'"),
        (("windows", "papr"), r"no profile of windows 'papr'; did you mean 'paper'"),
    ],
)
def test_unknown_names_are_refused_with_a_guess(words, named):
    with pytest.raises(ValueError, match=re.escape(named)):
        compute(*words)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"drows": 5}, "did you mean 'draws'"),
        ({"draws": 2.5}, "draws must be an int in [1, inf), got 2.5"),
        ({"draws": True}, "draws must be an int in [1, inf), got True"),
        ({"alpha": float("nan")}, "alpha must be a float, got nan"),
        ({"alpha": "0.1"}, "alpha must be a float, got '0.1'"),
        ({"alpha": 2.0}, r"alpha must lie in (0, 1), got 2.0"),
        ({"n": 3}, "n=3"),
    ],
)
def test_settings_that_do_not_fit_are_refused(changes, named):
    with pytest.raises(ValueError, match=re.escape(named)):
        compute("split_conformal", "smoke", **changes)


def test_an_integer_is_a_number():
    assert machinery.job("proximity", "smoke", {"farthest_m": 50}).config.farthest_m == 50.0


def publish(name):
    return machinery.publish_result(compute(name, "paper"))


def test_publish_read_verify(layer, small):
    manifest = publish("split_conformal")
    assert manifest.experiment == "split_conformal"
    result = published("split_conformal")
    assert result.config == small.profiles["paper"]
    assert result.provenance.verified is not None
    assert result.provenance.stale == ()
    report = verify("split_conformal", sample=99)
    assert report.agrees
    assert len(report.checked) == report.of == 4


def test_verify_draws_by_seed(layer, small):
    publish("split_conformal")
    drawn = {seed: verify("split_conformal", sample=2, seed=seed).checked for seed in range(8)}
    assert len(set(drawn.values())) > 1
    assert drawn[3] == verify("split_conformal", sample=2, seed=3).checked


def test_only_whole_profiles_are_published(layer, small):
    with pytest.raises(ValueError, match="profile must be unchanged"):
        machinery.publish_result(compute("split_conformal", "paper", seed=1))


def test_a_change_of_code_is_noticed_and_a_change_of_numbers_differs(layer, small, monkeypatch):
    publish("split_conformal")
    monkeypatch.setattr(
        "cpl.store.published.module_digests", lambda *origins: {"cpl.rng": "changed"}
    )
    told = published("split_conformal").provenance
    assert told.verified is None
    assert "code changed: cpl.rng" in told.stale
    monkeypatch.setattr(
        split_conformal, "_draw", lambda kind, draws, size, rng: rng.random((draws, size))
    )
    report = verify("split_conformal", sample=4)
    assert not report.agrees
    assert any("column" in line for line in report.differences)


def test_a_verification_is_recorded_only_if_asked_and_only_if_it_agrees(layer, small, monkeypatch):
    publish("split_conformal")
    before = (layer / "split_conformal" / "paper.json").read_bytes()
    verify("split_conformal")
    assert (layer / "split_conformal" / "paper.json").read_bytes() == before
    machinery.verify("split_conformal", "paper", sample=1, seed=0, record=True)
    told = published("split_conformal").provenance
    assert told.verified is not None
    assert (layer / "split_conformal" / "paper.json").read_bytes() != before
    again = (layer / "split_conformal" / "paper.json").read_bytes()
    monkeypatch.setattr(
        split_conformal, "_draw", lambda kind, draws, size, rng: rng.random((draws, size))
    )
    assert not machinery.verify("split_conformal", "paper", sample=4, seed=0, record=True).agrees
    assert (layer / "split_conformal" / "paper.json").read_bytes() == again


def test_a_changed_profile_is_said_so(layer, small, monkeypatch):
    publish("split_conformal")
    other = {"paper": replace(small.profiles["paper"], alpha=0.2)}
    monkeypatch.setattr(split_conformal, "EXPERIMENT", replace(small, profiles=other))
    assert "parameter alpha: 0.1 -> 0.2" in published("split_conformal").provenance.stale


def test_damage_is_refused(layer, small):
    publish("split_conformal")
    path = layer / "split_conformal" / "paper.parquet"
    content = bytearray(path.read_bytes())
    content[100] ^= 1
    path.write_bytes(content)
    for call in (published, verify):
        with pytest.raises(DamagedResultError):
            call("split_conformal")


@pytest.mark.parametrize("sample", [0, -1])
def test_a_sample_must_be_positive(sample):
    with pytest.raises(ValueError, match="sample"):
        verify("split_conformal", sample=sample)


def test_a_shard_is_a_name_with_values():
    piece = Shard("a-1", {"kind": "a", "part": 1})
    assert (piece.text("kind"), piece.number("part")) == ("a", 1)


@pytest.mark.parametrize("name", THEORY)
def test_what_is_published_is_whole_and_a_shard_of_it_agrees(name):
    """The published numbers of the book, one piece of each recomputed."""
    result = published(name)
    assert len(result.table) == sum(shard.rows for shard in result.provenance.shards)
    cheap = min(result.provenance.shards, key=lambda shard: shard.rows)
    assert cheap.rows > 0
    if name not in {"pathwise", "eventually_safe", "windows"}:  # these take seconds a shard
        report = verify(name, sample=1, seed=1)
        assert report.agrees, report.differences
