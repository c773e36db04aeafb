"""Foreign surroundings: what is unwritable, unspellable or gone is no reason for a traceback."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from cpl import environ
from cpl.cli import main, project_root
from cpl.store import work_path

C_LOCALE = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
RIDE = """
import hashlib, gymnasium, cpl.highway
env = gymnasium.make("cpl/highway-v0", lanes_count=3, vehicles_count=4)
seen = hashlib.sha256(env.reset(seed=0)[0].tobytes())
for action in (3, 0, 1):
    observation, reward, *_ = env.step(action)
    seen.update(observation.tobytes() + repr(float(reward)).encode())
print(seen.hexdigest())
"""


def python(*words, **given):
    return subprocess.run(
        [sys.executable, *words],
        cwd=project_root(),
        env={**os.environ, **given},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A project folder of one's own, with or without what makes it a checkout."""
    monkeypatch.setattr(environ, "PACKAGE", tmp_path / "cpl")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.delenv("CPL_STORE", raising=False)
    (tmp_path / "cpl").mkdir()
    (tmp_path / "book").mkdir()
    (tmp_path / "pyproject.toml").touch()
    return tmp_path


def refuse(monkeypatch, *folders):
    """Let folders look as if they could not be written; root may write everywhere."""
    real = os.access
    told = lambda path, mode: mode != os.W_OK or Path(path) not in folders  # noqa: E731
    monkeypatch.setattr(os, "access", lambda path, mode: told(path, mode) and real(path, mode))


def test_a_checkout_keeps_its_own(checkout):
    assert environ.in_checkout()
    assert work_path() == checkout / "_build" / "store"
    environ.keep_compiled_code()
    assert "NUMBA_CACHE_DIR" not in os.environ


def test_a_read_only_checkout_keeps_in_the_users_folders(checkout, monkeypatch):
    refuse(monkeypatch, checkout, checkout / "cpl")
    assert work_path() == checkout / "data" / "cpl" / "store"
    environ.keep_compiled_code()
    assert os.environ["NUMBA_CACHE_DIR"] == str(checkout / "cache" / "cpl" / "numba")
    monkeypatch.delenv("NUMBA_CACHE_DIR")


def test_where_nothing_can_be_written_code_is_kept_for_the_process_alone(checkout, monkeypatch):
    refuse(monkeypatch, checkout / "cpl")
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    kept = []
    monkeypatch.setattr(environ.atexit, "register", lambda *words, **_: kept.append(words[1]))
    environ.keep_compiled_code()
    assert os.environ["NUMBA_CACHE_DIR"] == str(kept[0])
    kept[0].rmdir()
    monkeypatch.delenv("NUMBA_CACHE_DIR")


def test_linear_algebra_has_one_thread_unless_more_are_asked_for(monkeypatch):
    for name in environ.ONE_THREAD:
        monkeypatch.delenv(name, raising=False)
    environ.one_thread()
    assert {os.environ[name] for name in environ.ONE_THREAD} == {"1"}
    for name in environ.ONE_THREAD:
        monkeypatch.delenv(name)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    environ.one_thread()
    assert "OPENBLAS_NUM_THREADS" not in os.environ


def test_without_a_compiler_the_road_is_the_same_to_the_bit():
    compiled, plain = python("-c", RIDE), python("-W", "error", "-c", RIDE, NUMBA_DISABLE_JIT="1")
    assert (plain.returncode, plain.stderr) == (0, "")
    assert plain.stdout == compiled.stdout
    assert len(plain.stdout.strip()) == hashlib.sha256().digest_size * 2


@pytest.mark.parametrize("words", [["params"], ["params", "theory"], ["claims"], ["--help"]])
def test_a_locale_that_knows_ascii_alone_is_no_obstacle(words):
    done = python("-m", "cpl", *words, **C_LOCALE)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout


@pytest.mark.parametrize("words", [["params"], ["claims"], ["--version", "--long"]])
def test_a_reader_that_leaves_early_ends_the_command_quietly(words):
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as gone:
        done = subprocess.run(
            [sys.executable, "-m", "cpl", *words],
            stdin=subprocess.DEVNULL,
            stdout=gone,
            stderr=subprocess.PIPE,
            cwd=project_root(),
            check=False,
        )
    assert (done.returncode, done.stderr) == (141, b"")


def test_a_folder_that_cannot_be_written_is_one_line(capsys):
    assert main(["course", "build", "--only", "labs", "--out", "/dev/null/course"]) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("cpl course: Not a directory: ")


def test_a_file_that_is_not_there_is_one_line(capsys):
    assert main(["run", "yours", "--set", "file=no-such.csv"]) == 1
    executing, said = capsys.readouterr().err.splitlines()
    assert executing.startswith("executing yours")
    assert said.startswith("cpl run: yours: the cell at yours.md:")
    assert "no-such.csv" in said
