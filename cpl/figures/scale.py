"""How long everything would take on many workers: predicted from what each piece took here."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.experiments.run.costs import Stage, stages
from cpl.experiments.run.schedule import Piece, longest_path_s, makespan, one_after_another
from cpl.figures.style import BLUE, GREY, INK, Card, card, drawn
from cpl.figures.table import Table, bench_table
from cpl.store import data_path

__all__ = [
    "Costs",
    "by_experiment",
    "costs",
    "curve",
    "driver_row",
    "enough",
    "measured",
    "measured_table",
    "predictions",
]

_DRIVER = "driver busy"


@dataclass(frozen=True, kw_only=True)
class Costs:
    """What the experiments cost, piece by piece.

    Attributes:
        stages: The experiments in an order in which each has what it needs.
        unknown: Experiments that nobody has computed at their full size yet.
        driver_s: Processor time of the driver for each piece [s], as measured.
    """

    stages: tuple[Stage, ...]
    unknown: tuple[str, ...]
    driver_s: float

    @property
    def pieces(self) -> dict[tuple[str, str], Piece]:
        """All pieces by experiment and shard."""
        return {name: piece for stage in self.stages for name, piece in stage.pieces.items()}

    @property
    def work_s(self) -> float:
        """Processor seconds of all pieces together."""
        return sum(piece.seconds for piece in self.pieces.values())

    @property
    def longest_s(self) -> float:
        """Seconds of the longest chain of pieces that need each other."""
        return longest_path_s(self.pieces)

    @property
    def timed(self) -> int:
        """How many pieces were timed by themselves; a mean stands for the others."""
        return sum(stage.timed for stage in self.stages)


def costs() -> Costs:
    """Read what each piece took when it was computed, and what a driver takes for each."""
    known, unknown = stages()
    row = driver_row()
    driver_s = 0.0 if row is None else 1e-3 * float(str(row["value"]))
    return Costs(stages=tuple(known), unknown=tuple(unknown), driver_s=driver_s)


def measured() -> list[dict[str, object]]:
    """Return the stored rows of the bench `scale`; none if it was never run."""
    path = data_path("bench", "bench.json")
    rows = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else []
    return [row for row in rows if row["topic"] == "scale"]


def measured_table() -> Table:
    """Lay out the measured rows, or say that there are none."""
    rows = measured()
    if not rows:
        return Table("*Not measured with this edition: `make bench` measures it.*")
    return bench_table(rows)


def driver_row() -> dict[str, object] | None:
    """Return the row that says what the driver of the largest measured cluster takes a piece."""
    rows = [row for row in measured() if str(row["subject"]).endswith(_DRIVER)]
    clusters = [row for row in rows if "workers" in str(row["subject"])]
    return max(clusters, key=lambda row: int(str(row["subject"]).split()[0]), default=None)


def predictions(known: Costs, workers: Sequence[int], *, driver_s: float) -> pd.DataFrame:
    """Predict how long everything takes.

    Args:
        known: What the pieces cost.
        workers: Numbers of workers, each with one thread, as fast as this machine's cores.
        driver_s: Time of the driver for each piece [s].

    Returns:
        A row a number of workers: `turn_min` and `turn_busy` for one experiment after the other, as
        the commands do it; `once_min` and `once_busy` with all experiments under way at once, each
        piece as soon as its inputs are there, the head of the longest chain first; `bound_min`,
        below which no schedule is.
    """
    rows: list[dict[str, float]] = []
    pieces = known.pieces
    each = [stage.pieces for stage in known.stages]
    for count in workers:
        turn = one_after_another(each, count, driver_s=driver_s)
        once = makespan(pieces, count, driver_s=driver_s)
        rows.append(
            {
                "workers": count,
                "turn_min": turn.seconds / 60,
                "turn_busy": turn.busy,
                "once_min": once.seconds / 60,
                "once_busy": once.busy,
                "bound_min": once.bound_s / 60,
            }
        )
    return pd.DataFrame(rows)


def enough(known: Costs, *, driver_s: float, share: float = 0.05) -> int:
    """Return how many workers come within a share of the longest chain, all experiments at once."""
    limit = (1 + share) * max(known.longest_s, driver_s * len(known.pieces))
    low, high = 1, max(len(known.pieces), 1)
    while low < high:
        middle = (low + high) // 2
        if makespan(known.pieces, middle, driver_s=driver_s).seconds <= limit + driver_s:
            high = middle
        else:
            low = middle + 1
    return low


def by_experiment(known: Costs) -> pd.DataFrame:
    """Return a row an experiment: pieces, work, the longest piece, and what it stands on."""
    rows: list[dict[str, object]] = []
    for stage in known.stages:
        seconds = [piece.seconds for piece in stage.pieces.values()]
        below = {need[0] for piece in stage.pieces.values() for need in piece.needs}
        rows.append(
            {
                "experiment": stage.experiment,
                "pieces": len(seconds),
                "timed": stage.timed,
                "work_min": sum(seconds) / 60,
                "longest_s": max(seconds),
                "stands_on": ", ".join(sorted(below)) or "nothing",
            }
        )
    table = pd.DataFrame(rows)
    return table.sort_values("work_min", ascending=False, ignore_index=True)


@drawn
def curve(known: Costs, *, driver_s: float, most: int = 1000) -> Card:
    """Draw the predicted time against the number of workers, both axes logarithmic."""
    counts = np.unique(np.geomspace(1, most, 25).astype(int))
    predicted = predictions(known, counts.tolist(), driver_s=driver_s)
    figure, axes = card(height=3.2)
    axes.loglog(predicted["workers"], predicted["turn_min"], color=GREY, linestyle=(0, (4, 2)),
                marker="s", markersize=3)  # fmt: skip
    axes.loglog(predicted["workers"], predicted["once_min"], color=BLUE, marker="o", markersize=3)
    axes.loglog(predicted["workers"], predicted["bound_min"], color=INK, linewidth=1)
    last = predicted.iloc[-1]
    middle = predicted.iloc[len(predicted) // 2]
    for text, column, colour, offset in (
        ("one experiment after the other", "turn_min", GREY, (6, 8)),
        ("all at once", "once_min", BLUE, (6, 6)),
    ):
        axes.annotate(text, (middle["workers"], middle[column]), xytext=offset, color=colour,
                      textcoords="offset points")  # fmt: skip
    axes.annotate("no schedule is below", (last["workers"], last["bound_min"]), xytext=(0, -12),
                  textcoords="offset points", ha="right", color=INK)  # fmt: skip
    axes.set(xlabel="workers, one thread each", ylabel="time [min], predicted")
    return figure
