"""The gates that every change passes: style, types, floors, spelling. All of them work offline."""

import os
import subprocess
import sys

import pytest

from cpl.store import project_root

TEXTS = (
    "README.md",
    "CONTRIBUTING.md",
    "CITATION.cff",
    "Makefile",
    "pyproject.toml",
    "_config.yml",
)


def tool(*words: str) -> subprocess.CompletedProcess[str]:
    """Run an installed tool of this environment at the project's root."""
    return subprocess.run(
        [sys.executable, "-m", *words],
        cwd=project_root(),
        env={**os.environ, "PYRIGHT_PYTHON_IGNORE_WARNINGS": "1"},  # it would ask for new versions
        capture_output=True,
        text=True,
        check=False,
    )


def passes(done: subprocess.CompletedProcess[str]) -> None:
    if done.returncode != 0:
        pytest.fail(f"{done.stdout}\n{done.stderr}".strip(), pytrace=False)


def test_ruff_finds_nothing():
    passes(tool("ruff", "check", "--quiet", "--output-format", "concise", "cpl", "tests", "book"))


def test_the_code_is_formatted():
    passes(tool("ruff", "format", "--check", "--quiet", "cpl", "tests", "book"))


def test_pyright_finds_nothing():
    passes(tool("pyright", "--pythonpath", sys.executable))


def test_no_room_imports_a_floor_above_it():
    code = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())"
    passes(
        subprocess.run(
            [sys.executable, "-c", code],
            cwd=project_root(),
            capture_output=True,
            text=True,
            check=False,
        )
    )


def test_nothing_is_misspelt():
    texts = [name for name in TEXTS if (project_root() / name).exists()]
    passes(tool("codespell_lib", "cpl", "tests", "book", *texts))


def test_the_makefile_has_few_commands_and_explains_them():
    make = subprocess.run(
        ["make", "--no-print-directory", "help"],
        cwd=project_root(),
        capture_output=True,
        text=True,
        check=True,
    )
    listed = [line.split()[0] for line in make.stdout.splitlines()]
    text = (project_root() / "Makefile").read_text()
    (phony,) = [line for line in text.splitlines() if line.startswith(".PHONY:")]
    assert listed == phony.removeprefix(".PHONY:").split()
    assert len(listed) <= 14


@pytest.mark.parametrize("heavy", ["pandas", "numba", "matplotlib", "papermill", "jupytext"])
def test_a_refusal_imports_nothing_heavy(heavy):
    code = f"import sys, cpl.cli as c; c.main(['params']); sys.exit({heavy!r} in sys.modules)"
    passes(
        subprocess.run(
            [sys.executable, "-c", code],
            cwd=project_root(),
            capture_output=True,
            text=True,
            check=False,
        )
    )
