"""Execute a chapter whole, or not at all.

text chapter -> notebook (jupytext) -> chosen parameters -> papermill -> every cell completed?

The result is held in memory until every cell has completed and is then written in one step, so
that neither an error nor a kill leaves a notebook that looks finished.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cpl.publish.chapters import Chapter
from cpl.settings.words import Value
from cpl.store import project_root

__all__ = ["ExecutionError", "as_notebook", "execute", "with_outputs"]

Notebook = Any  # an nbformat.NotebookNode: a mapping whose keys are attributes too


class ExecutionError(RuntimeError):
    """A cell of a chapter failed, or did not run."""


def as_notebook(chapter: Chapter, values: Mapping[str, Value] | None = None) -> Notebook:
    """Turn a text chapter into a notebook in which some parameters are set.

    Args:
        chapter: The chapter.
        values: Checked parameter values; the chapter's defaults hold for the others.

    Returns:
        The notebook, not executed. Chosen values stand in a cell of their own, tagged
        `injected-parameters`, behind the declarations.
    """
    import jupytext
    from nbformat.v4 import new_code_cell

    notebook = jupytext.reads(chapter.text, fmt="md:myst")
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{number}"  # not random: the same chapter makes the same file
    if values:
        # Written here and not by papermill, whose translation turns a tuple into a string. A value
        # is a plain literal by now: nothing that was typed reaches the kernel as code.
        source = "\n".join(f"{name} = {value!r}" for name, value in values.items())
        injected = new_code_cell(source, id="cell-parameters")
        injected.metadata["tags"] = ["injected-parameters"]
        notebook.cells.insert(_place_of_parameters(notebook) + 1, injected)
    return notebook


def execute(chapter: Chapter, values: Mapping[str, Value] | None = None) -> Notebook:
    """Run a chapter in a fresh kernel.

    The kernel works in an empty folder of its own, with its own settings of IPython, so that what
    a chapter shows depends neither on where it was started nor on whose machine it is.

    Args:
        chapter: The chapter.
        values: Checked parameter values; the chapter's defaults hold for the others.

    Returns:
        The executed notebook.

    Raises:
        ExecutionError: If a cell fails or the kernel dies; the message has the traceback.
    """
    from nbclient.exceptions import DeadKernelError
    from papermill.exceptions import PapermillExecutionError
    from papermill.execute import execute_notebook

    notebook = as_notebook(chapter, values)
    with tempfile.TemporaryDirectory(prefix="cpl-") as scratch, _kernel_settings(Path(scratch)):
        work = Path(scratch) / "work"
        work.mkdir()
        try:
            done = execute_notebook(
                notebook,
                None,  # nothing is written until everything has run
                kernel_name="python3",
                progress_bar=False,
                cwd=str(work),
                config=_transport(Path(scratch)),
            )
        except PapermillExecutionError as error:
            raise ExecutionError(_failure(chapter, error)) from error
        except DeadKernelError as error:
            msg = f"{chapter.name}: the kernel died"
            raise ExecutionError(msg) from error
    _require_completed(chapter, done)
    return _tidy(done)


def with_outputs(chapter: Chapter, executed: Notebook) -> Notebook:
    """Return the chapter as it reads now, with the outputs of an execution of the same code.

    Args:
        chapter: The chapter, whose text may have been improved since.
        executed: The executed notebook; its code cells are those of the chapter.

    Raises:
        ExecutionError: If the code differs.
    """
    notebook = as_notebook(chapter)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    done = [cell for cell in executed.cells if cell.cell_type == "code"]
    if [cell.source for cell in code] != [cell.source for cell in done]:
        msg = f"{chapter.name}: the executed notebook has other code than the chapter"
        raise ExecutionError(msg)
    for cell, old in zip(code, done, strict=True):
        cell["outputs"], cell["execution_count"] = old.outputs, old.execution_count
    return notebook


def _place_of_parameters(notebook: Notebook) -> int:
    tags = [cell.metadata.get("tags", []) for cell in notebook.cells]
    return next(place for place, tags in enumerate(tags) if "parameters" in tags)


@contextmanager
def _kernel_settings(scratch: Path) -> Iterator[None]:
    """Set the environment from which the kernel starts, and put the old one back."""
    profile = scratch / "ipython" / "profile_default"
    profile.mkdir(parents=True)
    (profile / "ipython_kernel_config.py").write_text(_IPYTHON, encoding="utf-8")
    path = os.pathsep.join([str(project_root()), os.environ.get("PYTHONPATH", "")])
    chosen = {
        "IPYTHONDIR": str(profile.parent),
        "JUPYTER_RUNTIME_DIR": str(scratch),
        "JUPYTER_PREFER_ENV_PATH": "1",  # the kernel of this environment, not one of the user's
        "PYTHONPATH": path.strip(os.pathsep),
    }
    before = {name: os.environ.get(name) for name in chosen}
    os.environ.update(chosen)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _transport(scratch: Path) -> Any:  # noqa: ANN401 (a traitlets.config.Config)
    """Talk to the kernel through files that only this user can open, where paths allow it."""
    from traitlets.config import Config

    short = len(str(scratch)) <= 40  # a socket's path holds about 100 characters
    private = sys.platform == "linux" and short
    return Config({"KernelManager": {"transport": "ipc"}} if private else {})


def _failure(chapter: Chapter, error: Any) -> str:  # noqa: ANN401 (papermill is not typed)
    trace = re.sub(r"\x1b\[[0-9;]*m", "", "\n".join(error.traceback)).strip()
    line = next(
        (cell.line for cell in chapter.cells if cell.code and cell.source == error.source), None
    )
    where = f"{chapter.path.name}:{line}" if line else chapter.path.name
    if error.ename in _ABOUT_FILES:  # a parameter names what is not there: no trace explains more
        return f"{chapter.name}: the cell at {where} failed: {error.evalue}"
    return f"{chapter.name}: the cell at {where} failed: {error.ename}\n\n{trace}"


def _require_completed(chapter: Chapter, notebook: Notebook) -> None:
    for number, cell in enumerate(c for c in notebook.cells if c.cell_type == "code"):
        status = cell.metadata.get("papermill", {}).get("status")
        if status != "completed" or (cell.source.strip() and not cell.execution_count):
            msg = f"{chapter.name}: code cell {number + 1} was not completed (status {status})"
            raise ExecutionError(msg)


def _tidy(notebook: Notebook) -> Notebook:
    """Drop papermill's notes (times, paths of this machine), which provenance replaces."""
    for part in [notebook, *notebook.cells]:
        for key in ("papermill", "execution"):
            part.metadata.pop(key, None)
    return notebook


_ABOUT_FILES = ("FileNotFoundError", "IsADirectoryError", "NotADirectoryError", "PermissionError")
_IPYTHON = """
c.Application.log_level = 50  # a failing cell is reported by its traceback
c.HistoryManager.enabled = False
c.InlineBackend.figure_formats = {"png"}
c.InlineBackend.rc = {"figure.dpi": 144}
"""
