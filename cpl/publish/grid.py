"""A chapter over a grid of parameters: one run a point, and one page that compares them."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from html import escape
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from cpl.publish import cache
from cpl.publish.chapters import Chapter
from cpl.publish.execute import ExecutionError
from cpl.publish.numbers import quoted
from cpl.publish.provenance import command, record
from cpl.publish.render import SiteError
from cpl.publish.run import run_chapter
from cpl.settings.words import Parameter, ParameterError, Value, suggestion
from cpl.store import atomic_write

__all__ = ["LARGEST", "axes", "points", "run_grid"]

LARGEST = 200
"""Most runs of one grid: a slip of the keyboard should not take a week."""

Chosen = Mapping[str, Value]


def axes(
    parameters: Iterable[Parameter], texts: Iterable[str], where: str = "the chapter"
) -> dict[str, list[Value]]:
    """Check `name=value,value,...` texts against the parameters of a chapter.

    Values of a parameter that is itself a list are separated by semicolons.

    Args:
        parameters: What the chapter declares.
        texts: What was typed, one parameter each.
        where: The chapter's name, for messages.

    Returns:
        The values of each parameter, in the order typed.

    Raises:
        ParameterError: For an unknown, repeated, ill-typed or out-of-range setting.
    """
    known = {parameter.name: parameter for parameter in parameters}
    found: dict[str, list[Value]] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        name = name.strip()
        if not equals:
            msg = f"a sweep is written name=value,value,..., got {text[:60]!r}"
            raise ParameterError(msg)
        if name not in known:
            msg = f"{where} has no parameter {name[:60]!r}{suggestion(name, known)} It has: "
            raise ParameterError(msg + (", ".join(known) or "none"))
        if name in found:
            msg = f"{name} is swept twice"
            raise ParameterError(msg)
        parameter = known[name]
        separator = ";" if parameter.type.startswith("tuple") else ","
        chosen = [parameter.convert(value.strip()) for value in values.split(separator)]
        found[name] = list(dict.fromkeys(chosen))
    return found


def points(swept: Mapping[str, Sequence[Value]], fixed: Chosen) -> list[dict[str, Value]]:
    """Return the grid's points: every combination, the last parameter fastest.

    Args:
        swept: Values of each swept parameter.
        fixed: What is set in all points.

    Raises:
        ParameterError: If a parameter is both swept and set, or there are too many points.

    Examples:
        >>> points({"alpha": [0.1, 0.2], "seed": [0, 1]}, {"delay": 3})[1]
        {'delay': 3, 'alpha': 0.1, 'seed': 1}
    """
    if twice := sorted(swept.keys() & fixed.keys()):
        msg = f"{', '.join(twice)} is both set and swept"
        raise ParameterError(msg)
    grid = [dict(zip(swept, values, strict=True)) for values in itertools.product(*swept.values())]
    if len(grid) > LARGEST:
        msg = f"a sweep may have {LARGEST} runs at most, got {len(grid)}"
        raise ParameterError(msg)
    return [{**fixed, **point} for point in grid]


def run_grid(
    chapter: Chapter,
    grid: Sequence[Chosen],
    folder: Path,
    root: Path,
    *,
    jobs: int = 2,
    report: Callable[[str], None] = print,
) -> Path:
    """Run a chapter at every point and write the page that compares the runs.

    A point that was run before with the same code, data and versions is not run again, so that
    after Ctrl-C the same folder goes on where it stopped. A point that fails is named on the page.

    Args:
        chapter: The chapter.
        grid: The points.
        folder: Where everything goes: one folder a point, `index.html` and `sweep.json`.
        root: The project's folder.
        jobs: How many run at a time.
        report: Told of each end.

    Returns:
        The path of the page.

    Raises:
        ExecutionError: If every point failed.
    """
    places = [folder / f"{number:03d}" for number in range(len(grid))]
    missing = [
        n
        for n, (c, p) in enumerate(zip(grid, places, strict=True))
        if not _kept(chapter, c, p, root)
    ]
    report(f"{len(grid) - len(missing)} of {len(grid)} runs are at hand")
    failures: dict[int, str] = {}
    with ProcessPoolExecutor(min(jobs, len(missing)) or 1, get_context("spawn")) as pool:
        running = {pool.submit(run_chapter, chapter, grid[n], places[n], root): n for n in missing}
        for done, future in enumerate(as_completed(running), 1):
            number = running[future]
            try:
                future.result()
            except (ExecutionError, SiteError) as error:
                failures[number] = str(error)
            ending = "FAILED" if number in failures else "done"
            report(f"[{done}/{len(missing)}] {_spelled(grid[number])}: {ending}")
    if len(failures) == len(grid):
        raise ExecutionError(next(iter(failures.values())))
    runs = [_summary(chapter, grid[n], places[n], failures.get(n)) for n in range(len(grid))]
    told = {"chapter": chapter.name, "runs": runs}
    atomic_write(folder / "sweep.json", json.dumps(told, indent=1, sort_keys=True) + "\n")
    return atomic_write(folder / "index.html", _page(chapter, runs))


def _kept(chapter: Chapter, chosen: Chosen, place: Path, root: Path) -> bool:
    """Say whether a point was run before, with everything that it rests on as it is today."""
    there = (place / f"{chapter.name}.html").is_file()
    return (
        there and cache.load(place, chapter.name, record(chapter, chosen, root)["key"]) is not None
    )


def _summary(chapter: Chapter, chosen: Chosen, place: Path, failure: str | None) -> dict[str, Any]:
    told: dict[str, Any] = {
        "parameters": {name: _text(value) for name, value in chosen.items()},
        "command": command(chapter, chosen),
        "page": f"{place.name}/{chapter.name}.html",
        "failure": failure,
        "numbers": {},
    }
    if failure is None:
        notebook = (place / f"{chapter.name}.ipynb").read_text(encoding="utf-8")
        told["numbers"] = quoted(notebook)
    return told


def _text(value: Value) -> str:
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _spelled(chosen: Chosen) -> str:
    return ", ".join(f"{name} = {_text(value)}" for name, value in chosen.items())


def _page(chapter: Chapter, runs: Sequence[Mapping[str, Any]]) -> str:
    """Write the page: one column a run, one row a number; what differs between runs is marked."""
    names = list(dict.fromkeys(name for run in runs for name in run["parameters"]))
    numbers = list(dict.fromkeys(name for run in runs for name in run["numbers"]))
    body = [_row("run", [_link(n, run) for n, run in enumerate(runs)], head=True)]
    body += [_row(n, [escape(run["parameters"].get(n, "")) for run in runs]) for n in names]
    for name in numbers:
        texts = [run["numbers"].get(name, "") for run in runs]
        body.append(_row(name, [escape(text) for text in texts], differs=len(set(texts)) > 1))
    failed = [
        f"<h2>Run {n} failed</h2><pre>{escape(run['failure'])}</pre>"
        for n, run in enumerate(runs)
        if run["failure"]
    ]
    title = f"{chapter.title}: {len(runs)} runs"
    return _HTML.format(
        title=escape(title), rows="\n".join(body), failed="\n".join(failed), count=len(numbers)
    )


def _link(number: int, run: Mapping[str, Any]) -> str:
    if run["failure"]:
        return f"{number} (failed)"
    return f'<a href="{escape(run["page"], quote=True)}">run {number}</a>'


def _row(name: str, cells: Sequence[str], *, head: bool = False, differs: bool = False) -> str:
    tag, scope = ("th", ' scope="col"') if head else ("td", "")
    mark = ' class="differs"' if differs else ""
    note = ' <span class="note">differs</span>' if differs else ""
    first = f'<th scope="row">{escape(name)}{note}</th>'
    return f"<tr{mark}>{first}" + "".join(f"<{tag}{scope}>{c}</{tag}>" for c in cells) + "</tr>"


_HTML = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ max-width: 72rem; margin: 2rem auto; padding: 0 1rem; font-family: system-ui, sans-serif;
       line-height: 1.5; }}
.wide {{ overflow-x: auto; }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; }}
td, th {{ padding: .3rem .7rem; border-bottom: 1px solid #8886; text-align: left; }}
.note {{ font-size: .75rem; font-weight: normal; border: 1px solid; border-radius: 4px;
        padding: 0 .3rem; }}
pre {{ overflow-x: auto; }}
</style>
</head>
<body>
<h1>{title}</h1>
<p>One column a run; below the parameters, the {count} numbers that the chapter's text quotes.</p>
<div class="wide" tabindex="0" role="region" aria-label="comparison of the runs">
<table>
{rows}
</table>
</div>
{failed}
</body>
</html>
"""
