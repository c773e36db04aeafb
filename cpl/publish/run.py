"""Run one chapter with chosen parameters, or all chapters whose results are not at hand."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from datetime import datetime
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from cpl.publish import cache
from cpl.publish.chapters import Chapter
from cpl.publish.execute import ExecutionError, execute
from cpl.publish.page import standalone
from cpl.publish.provenance import record
from cpl.settings.words import Value
from cpl.store import atomic_write

__all__ = ["execute_all", "new_folder", "run_chapter"]

Report = Callable[[str], None]


def run_chapter(chapter: Chapter, chosen: Mapping[str, Value], folder: Path, root: Path) -> Path:
    """Execute a chapter and write the notebook, its page and its provenance into a folder.

    Args:
        chapter: The chapter.
        chosen: Checked parameter values.
        folder: Where the three files go; made if it does not exist.
        root: The project's folder.

    Returns:
        The folder.

    Raises:
        ExecutionError: If a cell fails; nothing is written then.
    """
    notebook, made = _execute(chapter, chosen, root)
    page = standalone(chapter, notebook, made, root)
    folder.mkdir(parents=True, exist_ok=True)
    atomic_write(folder / f"{chapter.name}.html", page)
    cache.save(folder, chapter.name, notebook, made)
    return folder


def new_folder(root: Path, chapter: Chapter, chosen: Mapping[str, Value]) -> Path:
    """Make a folder below `_build/runs`, named by time and settings, that no other run has."""
    settings = "_".join(f"{name}-{value}" for name, value in chosen.items())
    plain = "".join(c if c.isalnum() or c in ".-_" else "-" for c in settings)[:80]
    stamp = datetime.now().astimezone().strftime("%Y%m%dT%H%M%S")
    stem = root / "_build" / "runs" / chapter.name / f"{stamp}_{plain or 'default'}"
    for n in range(1000):
        folder = stem.with_name(stem.name + (f"-{n}" if n else ""))
        try:
            folder.mkdir(parents=True)
        except FileExistsError:  # of a run in the same second, perhaps in another process
            continue
        return folder
    msg = f"{stem} and 999 folders beside it exist already"
    raise FileExistsError(msg)


def execute_all(
    chapters: Sequence[Chapter],
    root: Path,
    *,
    jobs: int = 2,
    report: Report = print,
) -> dict[str, tuple[str, dict[str, Any]]]:
    """Execute the chapters whose results are not at hand, in parallel processes.

    Args:
        chapters: The chapters, each with its default parameters.
        root: The project's folder; results are kept in its `_build/executed`.
        jobs: How many run at a time.
        report: Told of each beginning and end.

    Returns:
        For each chapter's name the executed notebook, as text, and its provenance.

    Raises:
        ExecutionError: If chapters failed, once all others are done; it holds all messages.
    """
    folder = root / "_build" / "executed"
    done: dict[str, tuple[str, dict[str, Any]]] = {}
    reach: dict[str, int] = {}
    for chapter in chapters:
        now = record(chapter, {}, root)
        kept = cache.load(folder, chapter.name, now["key"])
        if kept is None:
            reach[chapter.name] = len(now["modules"])
        else:
            done[chapter.name] = kept
    # What rests on much of cpl is likely to take long: begin with that, and nobody waits for it.
    missing = [chapter for chapter in chapters if chapter.name in reach]
    missing.sort(key=lambda chapter: -reach[chapter.name])
    report(f"{len(done)} of {len(chapters)} chapters are up to date")
    failures: list[str] = []
    with ProcessPoolExecutor(min(jobs, len(missing)) or 1, get_context("spawn")) as pool:
        running = {pool.submit(_keep, chapter, root, folder): chapter for chapter in missing}
        if running:
            report("executing " + ", ".join(chapter.name for chapter in missing))
        for number, future in enumerate(as_completed(running), 1):
            name = running[future].name
            failures += _collect(future, name, done)
            ending = f"{done[name][1]['seconds']:.1f} s" if name in done else "FAILED"
            report(f"[{number}/{len(missing)}] {name}: {ending}")
    if failures:
        raise ExecutionError("\n\n".join(failures))
    return {chapter.name: done[chapter.name] for chapter in chapters}


def _collect(
    future: Future[tuple[str, dict[str, Any]]], name: str, done: dict[str, Any]
) -> list[str]:
    """Note the result of a chapter, or return why there is none."""
    try:
        done[name] = future.result()
    except ExecutionError as error:
        return [str(error)]
    return []


def _keep(chapter: Chapter, root: Path, folder: Path) -> tuple[str, dict[str, Any]]:
    notebook, made = _execute(chapter, {}, root)
    cache.save(folder, chapter.name, notebook, made)
    return notebook, made


def _execute(
    chapter: Chapter, chosen: Mapping[str, Value], root: Path
) -> tuple[str, dict[str, Any]]:
    """Execute a chapter; the record is taken before, so that it says what was there to run."""
    made = record(chapter, chosen, root)
    begin = time.perf_counter()
    notebook = execute(chapter, chosen)
    seconds = round(time.perf_counter() - begin, 2)
    text = json.dumps(notebook, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
    return text, {**made, "seconds": seconds}
