"""Run the bench: ``python -m tests.bench [--only TOPIC ...] [--out FILE]`` from the root.

Prints a table and writes ``_build/bench.json``; a topic that is not run keeps its old rows.
"""

import argparse
import dataclasses
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from cpl.store import project_root
from tests.bench import frame

HERE = Path(__file__).resolve().parent
PACKAGES = ("numpy", "numba")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chosen topics and return the exit status."""
    known = topics()
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument(
        "--only",
        action="append",
        choices=sorted(known),
        metavar="TOPIC",
        help=f"one topic, may be given again: {', '.join(sorted(known))}",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=project_root() / "_build" / "bench.json",
        help="where the rows are kept (default: _build/bench.json)",
    )
    chosen = parser.parse_args(argv)
    names = sorted(set(chosen.only or known))
    rows = [row for name in names for row in run(name, known[name])]
    sys.stdout.write(frame.table(rows) + "\n")
    frame.write(chosen.out, frame.merge(frame.read(chosen.out), rows, names))
    sys.stdout.write(f"{len(rows)} rows -> {chosen.out}\n")
    return 0


def topics() -> dict[str, Path]:
    """Return the topics by name: the modules ``bench_<topic>.py`` beside this one."""
    return {path.stem.removeprefix("bench_"): path for path in sorted(HERE.glob("bench_*.py"))}


def run(topic: str, path: Path) -> list[dict[str, Any]]:
    """Measure one topic and return its rows, labelled with machine and versions."""
    module = _load(path)
    sys.stderr.write(f"measuring {topic} ...\n")
    label = {
        "machine": frame.machine(),
        "versions": frame.versions((*PACKAGES, *getattr(module, "PACKAGES", ()))),
    }
    return [{"topic": topic, **dataclasses.asdict(row), **label} for row in module.measure()]


def _load(path: Path) -> ModuleType:
    return importlib.import_module(f"tests.bench.{path.stem}")


if __name__ == "__main__":
    sys.exit(main())
