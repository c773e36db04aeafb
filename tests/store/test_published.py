import hashlib
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cpl.rng import stream
from cpl.store import (
    DamagedModelError,
    DamagedResultError,
    Manifest,
    PublishedShard,
    Verification,
    canonical_json,
    encode_model,
    machine,
    manifests,
    module_digests,
    publish,
    published,
    read_manifest,
    read_published,
    record_verification,
    same_table,
    source_commit,
    staleness,
    today,
    versions_below,
)

ORIGIN = "cpl.rng"


@pytest.fixture
def table():
    return pd.DataFrame({"n": np.arange(4), "share": [0.1, 0.2, 0.3, np.nan], "rule": list("aabb")})


@pytest.fixture
def manifest():
    modules, versions = module_digests(ORIGIN), versions_below(ORIGIN)
    return Manifest(
        experiment="toy",
        profile="paper",
        parameters={"alpha": 0.1, "n": 4},
        seeds={"seed": 0},
        label="simulated",
        commit=source_commit(),
        origins=[ORIGIN],
        modules=modules,
        versions=versions,
        machine=machine(),
        made=today(),
        seconds=0.1,
        verified=Verification(
            date=today(), modules=modules, versions=versions, shards=["a", "b"], of=2
        ),
        shards=[
            PublishedShard(name="a", first_row=0, rows=2),
            PublishedShard(name="b", first_row=2, rows=2),
        ],
    )


def test_publish_and_read(tmp_path, table, manifest):
    path = publish(table, manifest, root=tmp_path)
    assert path == tmp_path / "toy" / "paper.json"
    back, told = read_published("toy", "paper", root=tmp_path)
    assert same_table(back, table, rtol=0, atol=0) is None
    assert told.rows == 4
    assert told.columns == {"n": "int64", "share": "float64", "rule": "str"}
    assert told.parameters == {"alpha": 0.1, "n": 4}
    assert manifests(root=tmp_path) == [told]
    assert pd.read_parquet(path.with_suffix(".parquet"))["rule"].tolist() == list("aabb")


def test_what_a_file_says_is_decoded_once(tmp_path, table, manifest, monkeypatch):
    decoded = []
    real = published.decode_table
    monkeypatch.setattr(published, "decode_table", lambda b: decoded.append(b) or real(b))
    for root in (tmp_path / "a", tmp_path / "a", tmp_path / "b"):
        publish(table.assign(n=table["n"] + 97), manifest, root=root)
        back, _ = read_published("toy", "paper", root=root)
        assert back["n"].tolist() == [97, 98, 99, 100]
        back.loc[0, "n"] = -1  # a caller's own
    assert len(decoded) == 1
    publish(table.assign(n=table["n"] + 98), manifest, root=tmp_path / "a")
    assert read_published("toy", "paper", root=tmp_path / "a")[0]["n"].tolist()[0] == 98


def test_publishing_twice_writes_the_same_bytes(tmp_path, table, manifest):
    path = publish(table, manifest, root=tmp_path)
    before = path.read_bytes(), path.with_suffix(".parquet").read_bytes()
    publish(table.copy(), manifest, root=tmp_path)
    assert (path.read_bytes(), path.with_suffix(".parquet").read_bytes()) == before


def test_what_is_not_published_says_how_to_make_it(tmp_path):
    with pytest.raises(FileNotFoundError, match="cpl compute toy --profile paper --publish"):
        read_published("toy", "paper", root=tmp_path)


def test_shards_must_add_up(tmp_path, table, manifest):
    with pytest.raises(ValueError, match="4 rows"):
        publish(table, replace(manifest, shards=manifest.shards[:1]), root=tmp_path)


@pytest.mark.parametrize("name", ["../toy", "Toy", "", "a/b", "toy.x"])
def test_names_cannot_leave_the_layer(tmp_path, table, manifest, name):
    with pytest.raises(ValueError, match="experiment"):
        publish(table, replace(manifest, experiment=name), root=tmp_path)


def check_faults(folder, table, manifest, suffix, count):
    """Cut and flip: every time it is refused, or (never seen) what it says is unchanged."""
    path = publish(table, manifest, root=folder).with_suffix(suffix)
    whole, rng = path.read_bytes(), stream(0, "faults", suffix)
    told = read_manifest("toy", "paper", root=folder)
    for cut in rng.integers(0, len(whole) - 1, count):
        path.write_bytes(whole[:cut])
        with pytest.raises(DamagedResultError):
            read_published("toy", "paper", root=folder)
    for place in rng.integers(0, len(whole), count):
        flipped = bytes([whole[place] ^ (1 << int(rng.integers(0, 8)))])
        path.write_bytes(whole[:place] + flipped + whole[place + 1 :])
        try:
            back, now = read_published("toy", "paper", root=folder)
        except DamagedResultError:
            continue
        assert now == told
        assert same_table(back, table, rtol=0, atol=0) is None


@pytest.mark.parametrize("suffix", [".json", ".parquet"])
def test_damage_is_never_used(tmp_path, table, manifest, suffix):
    check_faults(tmp_path, table, manifest, suffix, 20)


@pytest.mark.faults
@pytest.mark.parametrize("suffix", [".json", ".parquet"])
def test_damage_is_never_used_200_each(tmp_path, table, manifest, suffix):
    check_faults(tmp_path, table, manifest, suffix, 200)


def test_a_manifest_cannot_be_edited_by_hand(tmp_path, table, manifest):
    path = publish(table, manifest, root=tmp_path)
    path.write_text(path.read_text().replace('"alpha": 0.1', '"alpha": 0.2'))
    with pytest.raises(DamagedResultError, match="seal"):
        read_manifest("toy", "paper", root=tmp_path)


def test_a_missing_table_is_named(tmp_path, table, manifest):
    publish(table, manifest, root=tmp_path).with_suffix(".parquet").unlink()
    with pytest.raises(DamagedResultError, match="missing"):
        read_published("toy", "paper", root=tmp_path)


def test_a_table_swapped_under_a_fresh_sha_is_refused(tmp_path, table, manifest):
    path = publish(table, manifest, root=tmp_path)
    other = publish(table.assign(n=9), replace(manifest, profile="book"), root=tmp_path)
    path.with_suffix(".parquet").write_bytes(other.with_suffix(".parquet").read_bytes())
    content = json.loads(path.read_text())
    content["sha256"] = json.loads(other.read_text())["sha256"]
    del content["seal"]
    content["seal"] = hashlib.sha256(canonical_json(content).encode()).hexdigest()
    path.write_text(json.dumps(content))
    with pytest.raises(DamagedResultError, match="does not say"):
        read_published("toy", "paper", root=tmp_path)


def test_a_fresh_result_is_verified(manifest):
    assert staleness(manifest) == []
    assert staleness(manifest, {"alpha": 0.1, "n": 4}) == []


def test_staleness_says_why(manifest):
    seen = manifest.verified
    old = replace(seen, modules={**seen.modules, ORIGIN: "0" * 64}, versions={"numpy": "1.0"})
    reasons = staleness(replace(manifest, verified=old), {"alpha": 0.2, "n": 4})
    assert reasons[0] == "parameter alpha: 0.1 -> 0.2"
    assert reasons[1] == "code changed: cpl.rng"
    assert reasons[2].startswith("version of numpy: 1.0 -> ")


def test_a_removed_module_makes_a_result_unverified_not_unreadable(manifest):
    (reason,) = staleness(replace(manifest, origins=["cpl.gone"]))
    assert "cpl.gone" in reason


def test_what_it_no_longer_rests_on_says_nothing(manifest):
    seen = manifest.verified
    more = replace(seen, modules={**seen.modules, "cpl.sweep": "0" * 64}, versions={
        **seen.versions, "joblib": "0.1",
    })  # fmt: skip
    assert staleness(replace(manifest, verified=more)) == []
    gone = replace(seen, modules={**seen.modules, "cpl.gone": "0" * 64})
    assert staleness(replace(manifest, verified=gone)) == ["code changed: cpl.gone"]


def test_recording_a_verification_leaves_the_table(tmp_path, table, manifest):
    path = publish(table, manifest, root=tmp_path)
    before = path.with_suffix(".parquet").read_bytes()
    told = read_manifest("toy", "paper", root=tmp_path)
    later = replace(told.verified, date="2030-01-01", shards=["b"])
    record_verification(told, later, root=tmp_path)
    assert read_manifest("toy", "paper", root=tmp_path) == replace(told, verified=later)
    assert path.with_suffix(".parquet").read_bytes() == before


@pytest.fixture
def learned():
    models = [
        b"",
        encode_model({"w": np.ones(3)}, {"seed": 0}),
        b"",
        encode_model({"w": np.zeros(3)}, {"seed": 1}),
    ]
    return pd.DataFrame({"seed": [0, 0, 1, 1], "step": [0, 1, 0, 1], "model": models})


def test_models_lie_beside_the_table_and_come_back(learned, manifest, tmp_path):
    root = tmp_path / "results"
    publish(learned, manifest, root=root)
    files = sorted(path.name for path in (tmp_path / "models" / "toy-paper").iterdir())
    names = [shard.name for shard in manifest.shards]
    assert files == sorted(f"{n}{suffix}" for n in names for suffix in (".json", ".safetensors"))
    back, _ = read_published("toy", "paper", root=root)
    assert same_table(back, learned) is None
    told = json.loads((tmp_path / "models/toy-paper" / f"{names[1]}.json").read_text())
    assert told["config"] == {"seed": 1}
    assert told["sha256"] == hashlib.sha256(learned["model"].iloc[3]).hexdigest()


@pytest.mark.parametrize("how", ["flip", "remove", "swap"])
def test_a_damaged_model_is_refused(learned, manifest, tmp_path, how):
    root = tmp_path / "results"
    publish(learned, manifest, root=root)
    first, second = sorted((tmp_path / "models" / "toy-paper").glob("*.safetensors"))
    if how == "flip":
        content = bytearray(first.read_bytes())
        content[-1] ^= 1
        first.write_bytes(content)
    elif how == "remove":
        first.unlink()
    else:
        first.write_bytes(second.read_bytes())
    with pytest.raises(DamagedResultError, match=first.name):
        read_published("toy", "paper", root=root)


def test_a_shard_holds_one_model(learned, manifest, tmp_path):
    one = replace(manifest, shards=[PublishedShard(name="all", first_row=0, rows=4)])
    with pytest.raises(ValueError, match="one model at most"):
        publish(learned, one, root=tmp_path / "results")


def test_bytes_that_are_no_model_are_not_published(learned, manifest, tmp_path):
    with pytest.raises(DamagedModelError):
        publish(learned.assign(model=[b"", b"x", b"", b"y"]), manifest, root=tmp_path / "results")
    assert not (tmp_path / "results").exists()
