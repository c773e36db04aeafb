"""Provoke faults: ``python -m tests.faults [--only TOPIC ...] [--count N] [--out FILE]``.

Prints a table and writes ``_build/faults.json``; a topic that is not run keeps its old rows. Exit
status 1 if anything was wrong and silent.
"""

import argparse
import importlib
import logging
import os
import platform
import sys
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from cpl.store import machine, project_root, source_commit, today
from tests.faults import frame

HERE = Path(__file__).resolve().parent


def topics() -> list[str]:
    """Return the topics: the modules ``provoke_<topic>.py`` beside this one."""
    return sorted(path.stem.removeprefix("provoke_") for path in HERE.glob("provoke_*.py"))


def main(argv: Sequence[str] | None = None) -> int:
    """Provoke the chosen topics and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--only", action="append", choices=topics(), metavar="TOPIC")
    parser.add_argument("--count", type=int, default=200, help="attempts a fault with variants")
    parser.add_argument("--kills", type=int, default=50, help="processes that are killed")
    parser.add_argument("--out", type=Path, default=project_root() / "_build" / "faults.json")
    chosen = parser.parse_args(argv)
    logging.disable(logging.CRITICAL)  # each damaged file is reported, as it should be
    silent = 0
    for name in chosen.only or topics():
        sys.stderr.write(f"provoking {name} ...\n")
        begun, busy = time.monotonic(), _processor_s()
        module = importlib.import_module(f"tests.faults.provoke_{name}")
        rows = list(module.provoke(chosen.kills if name == "kills" else chosen.count))
        sys.stdout.write(frame.table(rows) + "\n")
        about = {
            "made": today(),
            "commit": source_commit(),
            "machine": machine(),
            "versions": versions(),
            "wall_s": round(time.monotonic() - begun, 1),
            "processor_s": round(_processor_s() - busy, 1),
        }
        frame.write(chosen.out, name, rows, about)
        silent += sum(row.silent for row in rows)
        tried = sum(row.tried for row in rows)
        sys.stdout.write(f"{name}: {tried} faults, {silent} wrong and silent -> {chosen.out}\n")
    return 1 if silent else 0


def _processor_s() -> float:
    """Return the processor time of this process and of those that it started and that ended."""
    return sum(os.times()[:4])


def versions() -> dict[str, str]:
    """Return the versions of what reads and writes the stored formats."""
    names = ("numpy", "pandas", "pyarrow", "mcap", "joblib", "distributed")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}


if __name__ == "__main__":
    sys.exit(main())
