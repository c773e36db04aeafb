"""A second process that fills idle cores while a reproduction waits for a step with one piece.

With one training seed many steps have a single piece, which leaves all cores but one without work.
The steps fall into groups that need nothing of each other: roads and agents, the robot, the theory.
The costliest group goes first, and at low priority this process computes the others beside it, into
the same store. Where both come to the same piece it is computed twice, to the same table.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cpl.reproduce.reproduction import Step

__all__ = ["ahead", "groups"]

_NICENESS = 10
_END_S = 10  # to end after being asked


def groups(steps: Sequence[Step]) -> list[list[Step]]:
    """Part steps into groups that need nothing of each other, the costliest first.

    Args:
        steps: In an order in which they can be run, which each group keeps.
    """
    parts: list[list[Step]] = []
    for step in steps:
        needed = {need.experiment for piece in step.job.pieces for need in step.job.needs(piece)}
        mine = [p for p in parts if any(other.experiment in needed for other in p)]
        parts = [p for p in parts if p not in mine]
        parts.append([*(other for part in mine for other in part), step])
    return sorted(parts, key=lambda part: -sum(step.expected_s or 0.0 for step in part))


@contextmanager
def ahead(steps: Sequence[Step], store: Path) -> Generator[None, None, None]:
    """Let a process of low priority compute steps into a store, until the end of the block.

    Args:
        steps: In an order in which they can be run.
        store: Folder of the work layer.
    """
    if not steps:
        yield
        return
    asked = [f"{step.experiment}:{step.job.profile.removesuffix('+')}" for step in steps]
    words = [sys.executable, "-m", "cpl.reproduce._ahead", str(store), *asked]
    with subprocess.Popen(words, stdin=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.terminate()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _main(store: str, asked: Sequence[str]) -> None:
    from cpl.experiments.run.execute import run_job
    from cpl.reproduce.reproduction import plan
    from cpl.store import WorkStore

    os.nice(_NICENESS)
    parent = os.getppid()
    for name, _, profile in (one.partition(":") for one in asked):
        if os.getppid() != parent:  # whoever wanted this is gone
            return
        (step,) = plan(profile, [name])
        try:
            run_job(step.job, store=WorkStore(Path(store)), workers=1)
        except ModuleNotFoundError:  # an extra is missing: the reproduction itself says so
            continue


if __name__ == "__main__":
    try:
        _main(sys.argv[1], sys.argv[2:])
    except KeyboardInterrupt:  # meant for both; the other one tells
        sys.exit(130)
