"""What a budget reaches of the published results, and that a lie is found."""

from dataclasses import replace

import pytest

from cpl.cli import main
from cpl.experiments import compute
from cpl.experiments.run import attestation, examine, publication
from cpl.experiments.run.attestation import Attestation
from cpl.experiments.run.examine import Piece, coverage, pending, plan
from cpl.store import Manifest, manifests, publish, read_manifest, read_published


@pytest.fixture
def layer(tmp_path, monkeypatch):
    """A published layer of the test's own, with one small result in four pieces."""
    from cpl.experiments.theory import split_conformal

    for place in ("cpl.store.published.data_path", "cpl.experiments.run.attestation.data_path"):
        monkeypatch.setattr(place, lambda *parts: tmp_path.joinpath(*parts))
    profiles = {**split_conformal.PROFILES, "paper": split_conformal.PROFILES["smoke"]}
    monkeypatch.setattr(
        split_conformal, "EXPERIMENT", replace(split_conformal.EXPERIMENT, profiles=profiles)
    )
    publication.publish_result(compute("split_conformal", "paper"))
    return tmp_path / "results"


def pieces(name, seconds, count=4):
    manifest = replace(BLANK, experiment=name)
    return [
        Piece(manifest=manifest, name=f"{name}-{k}", rows=10, seconds=seconds) for k in range(count)
    ]


BLANK = Manifest(
    experiment="blank", profile="paper", parameters={}, seeds={}, label="exact", commit="",
    origins=[], modules={}, versions={}, machine={}, made="", seconds=0.0,
    verified=publication.Verification(date="", modules={}, versions={}, shards=[], of=0),
)  # fmt: skip


def names(chosen):
    return [piece.name for piece in chosen]


def test_cheap_results_are_whole_and_the_rest_is_sampled_within_the_budget():
    every = [pieces("dear", 100.0), pieces("cheap", 1.0), pieces("middle", 9.0)]
    chosen = plan(every, 60.0, seed=1)
    assert names(chosen)[:8] == names([*every[1], *every[2]])
    assert len(chosen) == 8  # no dear one fits
    assert sum(piece.seconds for piece in plan(every, 300.0, seed=1)) <= 300.0
    assert len(plan(every, 300.0, seed=1)) == 10
    drawn = {tuple(names(plan(every, 300.0, seed=seed))) for seed in range(12)}
    assert len(drawn) > 3


def test_a_result_alone_has_the_whole_budget():
    assert len(plan([pieces("one", 14.0)], 60.0, seed=0)) == 4
    assert len(plan([pieces("one", 16.0)], 60.0, seed=0)) == 3


def test_every_piece_can_be_drawn():
    every = [pieces("cheap", 1.0), pieces("long", 10.0, count=20)]
    seen = {name for seed in range(60) for name in names(plan(every, 60.0, seed))}
    assert seen == set(names([*every[0], *every[1]]))


def test_what_agreed_is_attested_at_once_and_not_asked_again(layer, capsys):
    every = examine.results()
    assert len(pending(every)) == 4
    first = pending(every)[:1]
    for report, rows in examine.examine(first, 60.0, record=True):
        assert report.agrees
        assert rows == first[0].rows
    assert names(pending(every)) == names(every[0])[1:]
    told = coverage(every, 0)
    assert told.ever == told.today == first[0].rows
    assert main(["verify", "--record"]) == 0
    assert "split_conformal/paper: agrees (3 of 4" in capsys.readouterr().out
    assert pending(every) == []
    assert set(read_manifest("split_conformal", "paper").verified.shards) == set(names(every[0]))


def test_another_source_attests_anew(layer, monkeypatch):
    manifest = read_manifest("split_conformal", "paper")
    some = [shard.name for shard in manifest.shards]
    Attestation().add(manifest, some)
    monkeypatch.setattr(attestation, "fingerprint", lambda _module: "another source")
    assert Attestation().ever(manifest) == set(some)
    assert Attestation().today(manifest) == set()
    Attestation().add(manifest, some[:1])
    assert Attestation().today(manifest) == {some[0]}
    assert Attestation().ever(manifest) == set(some)


def test_what_says_something_else_now_is_not_attested(layer):
    manifest = read_manifest("split_conformal", "paper")
    Attestation().add(manifest, [manifest.shards[0].name])
    assert Attestation().ever(replace(manifest, content="something else")) == set()


def test_the_budget_ends_a_run_and_the_next_goes_on(layer, monkeypatch):
    clock = iter(range(0, 10_000, 10))
    monkeypatch.setattr(examine.time, "monotonic", lambda: float(next(clock)))
    every = examine.results()
    seen = []
    while left := pending(every):
        assert len(seen) < 10
        for report, _ in examine.examine(left, 15.0, record=True):
            seen += report.checked
    assert sorted(seen) == sorted(names(every[0]))


@pytest.mark.parametrize("where", range(4))
def test_a_number_that_was_changed_with_all_its_digests_is_found(layer, capsys, where):
    """Whoever publishes a lie makes its digests right; computing the piece again does not."""
    table, manifest = read_published("split_conformal", "paper")
    row = manifest.shards[where].first_row
    table.loc[row, "covered"] = table["covered"].iloc[row] + 1
    publish(table, manifest)
    assert main(["verify"]) == 1
    out = capsys.readouterr().out
    assert "DIFFERS" in out
    assert manifest.shards[where].name in out
    assert main(["verify", "--record"]) == 1
    assert manifest.shards[where].name not in Attestation().ever(
        read_manifest("split_conformal", "paper")
    )


def test_the_default_seed_is_a_new_one_and_can_be_given(layer, capsys):
    def seed(*words):
        assert main(["verify", *words]) == 0
        return capsys.readouterr().out.splitlines()[0]

    assert len({seed() for _ in range(3)}) == 3
    assert seed("--seed", "5") == "seed 5"


@pytest.mark.parametrize(
    ("words", "named"),
    [(["--budget", "0"], "--budget must be positive"), (["--sample", "0"], "sample must be")],
)
def test_bad_words_are_named(layer, capsys, words, named):
    assert main(["verify", *words]) == 2
    assert named in capsys.readouterr().err


def test_most_published_results_fit_into_the_default_budget():
    """Every result of the book can be reached, most of them whole."""
    every = [examine._pieces(manifest) for manifest in manifests()]
    chosen = plan(every, 60.0, seed=0)
    assert sum(piece.seconds for piece in chosen) <= 60.0
    whole = [p for p in every if {(x.manifest.experiment, x.name) for x in p}
             <= {(x.manifest.experiment, x.name) for x in chosen}]  # fmt: skip
    assert len(whole) >= 12


def test_a_result_that_needs_a_missing_library_is_named_and_the_rest_goes_on(
    layer, monkeypatch, capsys
):
    def lacking(*_):
        raise ModuleNotFoundError("No module named 'envpool'", name="envpool")

    monkeypatch.setattr(examine, "verify_pieces", lacking)
    assert main(["verify", "--budget", "60"]) == 0
    assert (
        "split_conformal/paper: not run here: No module named 'envpool'" in capsys.readouterr().out
    )
