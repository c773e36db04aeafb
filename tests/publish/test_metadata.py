"""What is said about `data/` is what lies there."""

import json
import shutil

import pytest

from cpl.cli import main
from cpl.publish.metadata import CHECKSUMS, CRATE, CROISSANT, checksums, differences, write
from cpl.store import data_path, manifests


def test_the_checksums_are_those_of_the_tree():
    assert differences() == [], "run: cpl metadata"


def test_the_crate_names_every_file_with_its_checksum():
    graph = json.loads(data_path(CRATE).read_text())["@graph"]
    files = {entry["@id"]: entry["sha256"] for entry in graph if entry["@type"] == "File"}
    assert files == checksums()


def test_croissant_describes_every_published_table_column_by_column():
    told = json.loads(data_path(CROISSANT).read_text())
    columns = {
        records["name"]: [field["source"]["extract"]["column"] for field in records["field"]]
        for records in told["recordSet"]
    }
    assert columns == {f"{m.experiment}-{m.profile}-rows": list(m.columns) for m in manifests()}
    sums = checksums()
    assert all(file["sha256"] == sums[file["contentUrl"]] for file in told["distribution"])


@pytest.fixture
def small(tmp_path):
    """A folder with one published result, and nothing else."""
    source = data_path("results", "proximity")
    shutil.copytree(source, tmp_path / "results" / "proximity")
    write(tmp_path)
    return tmp_path


def test_what_changed_is_missing_or_new_is_named(small):
    assert differences(small) == []
    (small / "results" / "proximity" / "new.txt").write_text("x")
    (small / "results" / "proximity" / "paper.json").write_text("{}")
    (small / "results" / "proximity" / "paper.parquet").unlink()
    assert differences(small) == [
        "missing: results/proximity/paper.parquet",
        "not listed: results/proximity/new.txt",
        "changed: results/proximity/paper.json",
    ]


def test_writing_twice_gives_the_same_files(small):
    before = {name: (small / name).read_bytes() for name in (CHECKSUMS, CRATE, CROISSANT)}
    write(small)
    assert {name: (small / name).read_bytes() for name in before} == before


def test_the_command_checks(capsys, monkeypatch, small):
    monkeypatch.setattr("cpl.publish.metadata.data_path", lambda: small)
    assert main(["metadata", "--check"]) == 0
    (small / "stray.txt").write_text("x")
    assert main(["metadata", "--check"]) == 1
    assert capsys.readouterr().err == "not listed: stray.txt\n"
