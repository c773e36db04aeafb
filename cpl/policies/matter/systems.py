"""The book's own systems, asked like anybody's: from what was published of them."""

from __future__ import annotations

import numpy as np
import pandas as pd

from cpl.conformal import RunningMax
from cpl.policies.matter.log import LogAnswer, ask_log
from cpl.policies.matter.outcomes import Answer, judge
from cpl.store import data_path, read_published

__all__ = ["SYSTEMS", "WALKS", "ask_system", "ask_walks"]

SYSTEMS = {
    "switch": "the paper's switch on the road 20-40, with the paper's step",
    "gate": "the look-ahead's gate over a stream of eight worlds",
    "gate-in": "the same, in the calm world only",
    "gate-noise": "the same, in the noisy world only",
    "gate-in-turn": "the same, in the calm and the noisy world in turn",
}
"""Played systems, by name."""

WALKS = {
    "walks-usual": "the quadruped's shipped walks with usual gains, scored by its predictor",
    "walks-larger": "the same, then walks with larger gains",
}
"""Logs, by name."""

_WALKER = "paper"  # the walks under the paper's own policy

_PARTS = {"gate-in": ["in"], "gate-noise": ["noise"], "gate-in-turn": ["in", "noise"]}


def ask_system(name: str, *, margin: float = 0.03) -> Answer:
    """Judge one of the book's systems.

    Args:
        name: One of `SYSTEMS`.
        margin: As in `judge`.

    Raises:
        ValueError: If there is no such system.
        FileNotFoundError: If its results are not published.
    """
    if name not in SYSTEMS:
        raise ValueError(f"name must be one of {', '.join(SYSTEMS)}, got {name!r}")
    if name == "switch":
        table, _ = read_published("gate_family", "paper")
        return judge(_outcomes(table.query("setting == 'switch'"), "fixed"), margin=margin)
    table, _ = read_published("gate_stream", "paper")
    if name in _PARTS:
        table = table.query(f"world in {_PARTS[name]}")
    return judge(_outcomes(table, "quantile"), margin=margin)


def ask_walks(name: str) -> LogAnswer:
    """Ask the quadruped's shipped logs.

    Args:
        name: One of `WALKS`.

    Raises:
        ValueError: If there is no such system.
        FileNotFoundError: If the logs are not there.
    """
    if name not in WALKS:
        raise ValueError(f"name must be one of {', '.join(WALKS)}, got {name!r}")
    from cpl.logs import read_runs

    runs = read_runs(data_path("logs", "quadruped"))
    own = pd.DataFrame(runs.summary[runs.summary["config.policy"] == _WALKER])
    if name == "walks-usual":
        own = pd.DataFrame(own[own["config.range"] == "in"])
    own = own.sort_values(["config.range", "config.repeat", "config.shape"])  # "in" before "out"
    by = {run: rows["score"].dropna().to_numpy() for run, rows in runs.table.groupby("run")}
    parts = [by[run] for run in own["run"]]
    log = pd.DataFrame(
        {
            "score": np.concatenate(parts),
            "episode": np.repeat(np.arange(len(parts)), [len(part) for part in parts]),
        }
    )
    return ask_log(log, RunningMax(c=0.1), alpha=0.2, delay=2)


def _outcomes(table: pd.DataFrame, tracked: str) -> pd.DataFrame:
    method = table["method"].replace({tracked: "tracked"})
    return pd.DataFrame(
        {
            "method": np.where(method == "EWMA tuned", "EWMA", method),
            "value": table["value"],
            "group": table["pair"],
            "unit": table["stream"],
            "harms": table["crashes"],
            "episodes": table["episodes"],
            "pace": table["speed_sum"],
            "steps": table["steps"],
        }
    )
