"""The wheel, installed outside of a checkout beside nothing but the base dependencies."""

import os
import shutil
import subprocess
import sys
import textwrap
from importlib.metadata import packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from cpl.cli import project_root

# Put before everything else: what only an extra brings cannot be imported.
BLOCKER = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {absent!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""


def _base() -> set[str]:
    """Return the distributions that a base install brings, with what they require."""
    found, named = set(), ["cpl"]
    while named:
        name = canonicalize_name(named.pop())
        if name not in found:
            found.add(name)
            asked = [Requirement(line) for line in requires(name) or []]
            named += [r.name for r in asked if r.marker is None or r.marker.evaluate({"extra": ""})]
    return found


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Build the wheel from what is in git, unpack it, and hide everything that an extra brings."""
    source, site = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    root = project_root()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(root / name, source)
    shutil.copytree(root / "cpl", source / "cpl", ignore=shutil.ignore_patterns("__pycache__"))
    words = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    words += ["--no-build-isolation", "--target", str(site), str(source)]
    subprocess.run(words, check=True, capture_output=True)
    base = _base()
    absent = {
        module
        for module, owners in packages_distributions().items()
        if not base & {canonicalize_name(owner) for owner in owners}
    }
    (site / "sitecustomize.py").write_text(BLOCKER.format(absent=absent | {"tests"}))
    return site


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    return tmp_path_factory.mktemp("home")


@pytest.fixture
def run(installed, home, tmp_path):
    """Run Python beside the wheel alone, as somebody whose home was empty."""

    def run_(*words, **environ):
        given = {"PATH": os.environ["PATH"], "HOME": str(home), "PYTHONPATH": str(installed)}
        return subprocess.run(
            [sys.executable, *words],
            env={**given, **environ},
            cwd=tmp_path,
            capture_output=True,
            encoding="utf-8",
            check=False,
        )

    return run_


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_the_interface_works_and_writes_nothing_beside_itself(run, installed):
    before = {name for name in files(installed) if "__pycache__" not in name}
    code = """
        import numpy as np, gymnasium, cpl.highway
        from cpl.conformal import Fixed, track
        from cpl.store import work_path
        q, err = track(np.r_[np.full(9, 0.1), 0.9], Fixed(eta=0.05), alpha=0.1, delay=1)
        env = gymnasium.make("cpl/highway-v0", vehicles_count=5)
        print(cpl.highway.__file__, work_path(), err[-1])
    """
    done = run("-c", textwrap.dedent(code))
    assert (done.returncode, done.stderr) == (0, "")
    where, work, err = done.stdout.split()
    assert Path(where).is_relative_to(installed)
    assert not Path(work).is_relative_to(installed)
    assert err == "True"
    after = files(installed)
    assert {name for name in after if "__pycache__" not in name} == before
    assert not [name for name in after if name.endswith((".nbi", ".nbc"))]


def test_a_home_that_cannot_be_written_changes_nothing(run):
    done = run("-c", "import os, cpl.conformal; print(os.environ['NUMBA_CACHE_DIR'])",
               HOME="/dev/null/no")  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert not Path(done.stdout.strip()).exists()  # it went with the process


def test_scores_of_ones_own_are_tracked(run, tmp_path):
    (tmp_path / "scores.csv").write_text("score\n" + "0.1\n" * 40)
    done = run("-m", "cpl", "track", "scores.csv", "--rule", "fixed", "--eta", "0.05")
    assert (done.returncode, done.stderr) == (0, "")
    assert "steps            40" in done.stdout


@pytest.mark.parametrize("words", [["--help"], ["--version"], ["logs", "--help"]])
def test_help_and_version_need_nothing(run, words):
    done = run("-m", "cpl", *words)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    "words",
    [
        ["params"], ["run", "theory"], ["build"], ["claims"], ["verify"], ["metadata", "--check"],
        ["course", "list"], ["reproduce", "--dry-run"], ["diff", "published", "x"],
    ],
)  # fmt: skip
def test_what_needs_the_repository_says_where_it_looked(run, installed, words):
    done = run("-m", "cpl", *words)
    assert (done.returncode, done.stdout) == (2, "")
    said = f"cpl {words[0]}: there is no book and no data/ in {installed}"
    assert done.stderr.startswith(said)
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        (["logs", "info", "scores.csv"], "logs"),
        (["record", "walks"], "quadruped"),
        (["robot", "rehearse"], "logs"),
    ],
)
def test_a_command_without_its_extra_names_it(run, tmp_path, words, extra):
    (tmp_path / "scores.csv").write_text("0.1\n")
    done = run("-m", "cpl", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.endswith(f"is not installed: pip install 'cpl[{extra}]'\n")
    assert len(done.stderr.splitlines()) == 1


def test_status_goes_on_where_one_experiment_lacks_a_library(run):
    done = run("-m", "cpl", "status")
    assert (done.returncode, done.stderr) == (0, "")
    assert "nothing computed here" in done.stdout
