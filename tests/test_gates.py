"""The gates that every change passes: style, types, floors, spelling. All of them work offline."""

import os
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from cpl.store import cpl_imports, project_root

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


@cache
def modules() -> dict[str, Path]:
    """Return the files of the package by the dotted names of what they define."""
    root = project_root()
    found = {}
    for path in (root / "cpl").rglob("*.py"):
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def imported(name: str, path: Path) -> set[str]:
    """Return the modules of the package that one imports, also inside functions."""
    here = modules()
    named = cpl_imports(path.read_text(encoding="utf-8"))
    return {other for other in named if other in here and other != name}


# What a tab runs is lowered from the very kernels that the package runs.
LOWERED = {
    "cpl.wasm.gate imports cpl.policies.gate._kernels",
    "cpl.wasm._exports imports cpl.conformal._kernels",
}


def room(name: str) -> list[str]:
    """Return the room that a module is in; a question's folder is one of its own."""
    parts = name.split(".")
    return parts[: 3 if parts[1:2] == ["experiments"] else 2]


def test_no_private_module_is_imported_from_another_room():
    wrong = {
        f"{name} imports {other}"
        for name, path in modules().items()
        for other in imported(name, path)
        if any(part[0] == "_" and part[:2] != "__" for part in other.split("."))
        and room(name) != room(other)
    }
    assert wrong == LOWERED


def test_no_module_imports_itself_by_way_of_others():
    # What a package's face imports when it is asked is no part of importing what lies below it.
    graph = {
        name: imported(name, path) for name, path in modules().items() if path.name != "__init__.py"
    }
    TopologicalSorter(graph).prepare()


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
