"""The safety case as tables: hazards with their measured times, faults by phase and placement."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
import pandas as pd

from cpl.figures.table import Table, table
from cpl.robot.drill import WHAT
from cpl.robot.safety import HAZARDS, Hazard
from cpl.robot.trials import DEEDS

__all__ = ["case", "deeds", "matrix", "seconds_of", "worst"]

_PHASES = ("standing", "walking", "stopping")


def case(stops: pd.DataFrame, faults: pd.DataFrame) -> Table:
    """Return the safety case, a line a hazard.

    Args:
        stops: The table of the experiment `robot_stops`.
        faults: That of `robot_faults`.
    """
    rows = [
        {
            "hazard": each.hazard,
            "measure": each.measure,
            "tests": "; ".join(map(_test, each.tests)),
            "zero": _measured(each, stops, faults),
            "unverified": each.unverified,
        }
        for each in HAZARDS
    ]
    heads = {"hazard": "hazard", "measure": "measure", "zero": "told zero after"}
    return table(rows, columns=heads | {"tests": "tests", "unverified": "unverified"})


def deeds(stops: pd.DataFrame) -> Table:
    """Return the distribution of the time to zero, a line a deed.

    Args:
        stops: The table of the experiment `robot_stops`.
    """
    rows = []
    for name, what in DEEDS.items():
        found = stops[(stops["deed"] == name) & (stops["phase"] == "walking")]
        median, p99, most = np.quantile(found["zero_s"], (0.5, 0.99, 1.0))
        numbers = {"trials": len(found), "median": median, "p99": p99, "most": most}
        rows.append({"what": what} | numbers | {"left": int(np.sum(found["left"]))})
    heads = {"what": "what is done", "trials": "trials", "median": "median [s]"}
    heads |= {"p99": "99th percentile [s]", "most": "longest [s]", "left": "processes left behind"}
    seconds: dict[str, str] = dict.fromkeys(("median", "p99", "most"), "{:.3f}")
    return table(rows, seconds, columns=heads)


def matrix(faults: pd.DataFrame, placement: str) -> Table:
    """Return the fault matrix with the watchdog at one place, a line a fault.

    A cell says how the run ended, after how long the robot was told zero, the largest velocity that
    reached it, and the state of the log.

    Args:
        faults: The table of the experiment `robot_faults`.
        placement: `laptop` or `robot`.
    """
    there = pd.DataFrame(faults[faults["placement"] == placement])
    cells = {(row["fault"], row["phase"]): _cell(row) for row in there.to_dict("records")}
    rows = [
        {"what": WHAT[name]} | {phase: cells[name, phase] for phase in _PHASES}
        for name in there["fault"].unique()
    ]
    return table(rows, columns={"what": "fault"} | {phase: phase for phase in _PHASES})


def seconds_of(hazard: Hazard, stops: pd.DataFrame, faults: pd.DataFrame) -> np.ndarray:
    """Return the times to zero of a hazard, from when the link or the computer was back [s].

    Faults after which the run goes on to its planned end have none.

    Args:
        hazard: A line of the safety case.
        stops: The table of the experiment `robot_stops`.
        faults: That of `robot_faults`.
    """
    walks = stops[(stops["phase"] == "walking") & stops["deed"].isin(hazard.deeds)]
    cells = faults[(faults["phase"] == "walking") & faults["fault"].isin(hazard.faults)]
    cells = cells[cells["outcome"] != "timeout"]
    late = np.maximum(np.asarray(cells["zero_s"] - cells["blind_s"]), 0.0)
    return np.concatenate([np.asarray(walks["zero_s"]), late[~np.isnan(late)]])


def worst(stops: pd.DataFrame) -> float:
    """Return the largest 99th percentile of the time to zero over all deeds and placements [s].

    Args:
        stops: The table of the experiment `robot_stops`.
    """
    walks = stops[stops["phase"] == "walking"]
    return max(
        float(np.quantile(each["zero_s"], 0.99)) for _, each in walks.groupby(["deed", "placement"])
    )


def _test(name: str) -> str:
    """Return a test's file and, in words that a narrow column can break, what it says."""
    file, _, function = name.partition("::")
    return f"`{file}`: {function.removeprefix('test_').replace('_', ' ')}"


def _measured(hazard: Hazard, stops: pd.DataFrame, faults: pd.DataFrame) -> str:
    if hazard.metres is not None:
        cells = faults[(faults["phase"] == "walking") & faults["fault"].isin(hazard.faults)]
        return f"{cells['moved_m'].max():.2f} m at most, {hazard.metres:g} m allowed"
    seconds = seconds_of(hazard, stops, faults)
    if not len(seconds):
        return "the run goes on as if nothing were" if hazard.faults else "nothing moves"
    p99, most = np.quantile(seconds, (0.99, 1.0))
    if len(seconds) < 100:
        return f"{most:.2f} s at most in {len(seconds)} runs"
    return f"{p99:.3f} s (99th percentile), {most:.3f} s at most in {len(seconds)} trials"


def _cell(row: dict[Hashable, Any]) -> str:
    said = [str(row["outcome"])]
    if np.isfinite(row["zero_s"]) and row["outcome"] != "refused":
        said.append(f"zero {row['zero_s']:.2f} s")
    said += [f"{row['fastest_mps']:.2f} m/s", f"log {row['log']}"]
    return "; ".join(said)
