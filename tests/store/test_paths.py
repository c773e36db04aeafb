import multiprocessing
import os
from pathlib import Path

import pytest

from cpl.store import atomic_write, data_path, project_root, work_path


def test_paths_do_not_depend_on_the_working_directory(tmp_path, monkeypatch):
    before = project_root(), data_path("results")
    monkeypatch.chdir(tmp_path)
    assert (project_root(), data_path("results")) == before
    assert (project_root() / "pyproject.toml").is_file()


@pytest.mark.parametrize("parts", [("..", "x"), ("/etc", "passwd"), ("results", "..", "..", "x")])
def test_data_path_stays_below_data(parts):
    with pytest.raises(ValueError, match="parts"):
        data_path(*parts)


def test_work_path_is_moved_by_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("CPL_STORE", str(tmp_path / "elsewhere"))
    assert work_path() == (tmp_path / "elsewhere").resolve()
    monkeypatch.delenv("CPL_STORE")
    assert work_path() == project_root() / "_build" / "store"


def test_atomic_write_makes_folders_and_replaces(tmp_path):
    path = tmp_path / "a" / "b.txt"
    assert atomic_write(path, "first\n") == path
    atomic_write(path, b"second\r\n")
    assert path.read_bytes() == b"second\r\n"
    assert [p.name for p in path.parent.iterdir()] == ["b.txt"]


def test_atomic_write_respects_the_umask(tmp_path):
    plain = tmp_path / "plain"
    plain.write_text("x")
    assert atomic_write(tmp_path / "mine", "x").stat().st_mode == plain.stat().st_mode


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path, monkeypatch):
    path = atomic_write(tmp_path / "x", "old")

    def full(_handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        atomic_write(path, "new")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


def _write_many(path: str, letter: str) -> None:
    for _ in range(30):
        atomic_write(Path(path), letter * 100_000)


def test_concurrent_writers_never_mix(tmp_path):
    path = tmp_path / "shared"
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write_many, args=(str(path), c)) for c in "ab"]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        if path.exists():
            content = path.read_text()
            assert len(content) == 100_000
            assert len(set(content)) == 1
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    assert [p.name for p in tmp_path.iterdir()] == ["shared"]
