"""What made a result: the record beside an execution, and the footer of its page."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cpl.publish.cache import basis, key_of
from cpl.publish.chapters import Chapter
from cpl.settings.words import Value

__all__ = ["command", "footer", "record", "source_state"]


def record(chapter: Chapter, chosen: Mapping[str, Value], root: Path) -> dict[str, Any]:
    """Write down what an execution will rest on, before it begins.

    Args:
        chapter: The chapter.
        chosen: The parameters that were set; the defaults hold for the others.
        root: The project's folder.

    Returns:
        A record ready for JSON; whoever executes adds `seconds`.
    """
    values = {p.name: chosen.get(p.name, p.default) for p in chapter.parameters}
    rests_on = basis(chapter, values, root)
    return {
        "chapter": chapter.name,
        "title": chapter.title,
        "key": key_of(rests_on),
        "command": command(chapter, chosen),
        "chosen": dict(chosen),
        "seeds": {name: value for name, value in values.items() if _is_seed(name)},
        "source": {**source_state(root), "file": chapter.path.relative_to(root).as_posix()},
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        **rests_on,
    }


def command(chapter: Chapter, chosen: Mapping[str, Value]) -> str:
    """Return the command that runs the chapter with these parameters."""
    words = ["cpl", "run", chapter.name]
    for name, value in chosen.items():
        members = value if isinstance(value, tuple) else (value,)
        text = ",".join(str(member) for member in members)
        words += ["--set", f"{name}={text.lower() if isinstance(value, bool) else text}"]
    return shlex.join(words)


def source_state(root: Path) -> dict[str, Any]:
    """Return the commit that is checked out and whether files in git differ from it.

    Without git, or outside a repository, the commit is None: the fingerprint still says what ran.
    """
    commit = _git(root, "rev-parse", "HEAD")
    if commit is None:
        return {"commit": None, "dirty": None}
    return {"commit": commit, "dirty": bool(_git(root, "status", "--porcelain", "-uno"))}


def footer(chapter: Chapter, record: Mapping[str, Any]) -> str:
    """Write the last section of the page in MyST: what made it, and how to make it again."""
    source = record["source"]
    commit = f"`{source['commit'][:12]}`" if source["commit"] else "not known (no git)"
    if source["dirty"]:
        commit += ", with changes that are not committed"
    seeds = ", ".join(_code(f"{name} = {value}") for name, value in record["seeds"].items())
    rows = [
        ("Code state", commit),
        ("Fingerprint of the code it rests on", f"`{record['fingerprint'][:16] or 'none'}`"),
        ("Seeds", seeds or "none: nothing is drawn at random from a parameter"),
        ("Executed", f"{record['started']}, in {record['seconds']:.1f} s"),
        ("Versions", ", ".join(f"{name} {v}" for name, v in record["versions"].items())),
    ]
    parameters = [
        (_code(p.name), _code(record["parameters"][p.name]), p.unit, p.allowed(), p.meaning)
        for p in chapter.parameters
    ]
    lines = [
        "## How this page was made",
        "",
        "Every number above was computed by this chapter's code. To compute it again:",
        "",
        "```bash",
        record["command"],
        "```",
        "",
        "Add `--set name=value` for any parameter below to see what changes with it.",
        "",
        "````{dropdown} Parameters, source state and versions",
        *_table(("parameter", "value", "unit", "allowed", "meaning"), parameters),
        "",
        *_table(("made from", ""), rows),
        "````",
        "",
    ]
    return "\n".join(lines)


def _code(value: object) -> str:
    """Quote a value as code, whatever it holds: the fence is longer than any in the value."""
    fence = "`"
    while fence in str(value):
        fence += "`"
    return f"{fence} {value} {fence}" if len(fence) > 1 else f"`{value}`"


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """Write a MyST list table, in which no cell can break out of its place."""
    options = [":header-rows: 1", ":class: provenance"]
    lines = ["```{list-table}", *options, ""]
    for row in [head, *rows]:
        for place, cell in enumerate(row):
            lines.append(("* - " if place == 0 else "  - ") + " ".join(cell.split()))
    return [*lines, "```"]


def _is_seed(name: str) -> bool:
    return name == "seed" or name.endswith("_seed") or name in ("seeds", "n_seeds")


def _git(root: Path, *words: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *words], capture_output=True, encoding="utf-8", check=False
        )
    except FileNotFoundError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None
