"""What a reproduction from an empty store found: its report as sentences and tables."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpl.figures.table import Table, rows_or_note, table

__all__ = ["Reproduction", "read"]

_NONE = "No reproduction has been published with this edition; `cpl reproduce --publish` makes one."
_MARKS = {True: "agrees", False: "differs", None: "one seed cannot say"}


@dataclass(frozen=True)
class Reproduction:
    """A report of `cpl reproduce`; empty if there is none."""

    report: Mapping[str, Any]

    @property
    def steps(self) -> Sequence[Mapping[str, Any]]:
        """The experiments that were computed again."""
        return [step for step in self.report.get("steps", []) if not step["missing"]]

    def when(self) -> str:
        """Say what was run, when, where, from which source, and how long it took."""
        if not self.report:
            return _NONE
        report, machine = self.report, self.report["machine"]
        place = "a cluster" if report["cluster"] else f"{report['workers']} processes"
        text = (
            f"Made {report['made']} from the source {report['commit'][:8]} on "
            f"{machine['processor']} ({machine['cores']} cores, {machine['system']}), "
            f"with {place}: "
            f"{report['wall_s'] / 60:.1f} minutes, "
            f"{report['processor_s'] / 60:.1f} of processor time."
        )
        if report["resumed"]:
            text += " It was stopped and went on, so the minutes are those of the last part."
        compared = report["compared"]
        if compared["commit"] != report["commit"]:
            text += f" Compared again {compared['date']} by the source {compared['commit'][:8]}."
        return text

    def covers(self) -> str:
        """Say what was computed again, and what was left out and why."""
        if not self.report:
            return "Nothing is covered."
        whole = sum(step["whole"] for step in self.steps)
        text = (
            f"{len(self.steps)} experiments, {whole} of them exactly as published and the others "
            f"with one training seed."
        )
        out = dict(self.report["left_out"])
        out |= {s["experiment"]: s["missing"] for s in self.report["steps"] if s["missing"]}
        reasons: dict[str, list[str]] = {}
        for name, reason in sorted(out.items()):
            reasons.setdefault(reason, []).append(name)
        left = "; ".join(f"{', '.join(names)} ({why})" for why, names in reasons.items())
        return f"{text} Left out: {left}." if left else f"{text} Nothing was left out."

    def count(self, what: str) -> int:
        """Return how many pieces were `compared` or are the `same`."""
        compared = sum(step["pieces"]["compared"] for step in self.steps)
        differing = sum(len(step["pieces"]["differing"]) for step in self.steps)
        return {"compared": compared, "same": compared - differing}[what]

    def outcome(self) -> str:
        """Say how many pieces and claims came out the same."""
        if not self.report:
            return "So nothing is claimed here."
        return (
            f"Of {self.count('compared'):,} published pieces that were computed again, "
            f"{self.count('same'):,} are the same. Of the claims, {self.claims(True)} agree, "
            f"{self.claims(False)} differ, and about {self.claims(None)} one training seed "
            "cannot say."
        )

    def claims(self, agrees: bool | None) -> int:
        """Return for how many claims the number agrees, differs, or cannot be compared."""
        return sum(claim["agrees"] is agrees for claim in self.report.get("claims", []))

    def experiments(self) -> Table:
        """One line an experiment: what was run, how long it took, how many pieces are the same."""
        if not self.report:
            return Table(f"*{_NONE}*")
        rows = [
            {
                "experiment": step["experiment"],
                "extent": "as published" if step["whole"] else "one training seed",
                "pieces": step["shards"],
                "minutes": step["processor_s"] / 60,
                "same": _share(step["pieces"]),
            }
            for step in self.steps
        ]
        heads = {"experiment": "experiment", "extent": "extent", "pieces": "pieces"}
        heads |= {"minutes": "processor [min]", "same": "the same as published"}
        return table(rows, {"minutes": "{:.2f}"}, columns=heads)

    def differences(self) -> Table:
        """One line for each piece that differs from the published one."""
        import pandas as pd

        lines = [
            {"experiment": step["experiment"], "difference": line}
            for step in self.steps
            for line in step["pieces"]["differing"]
        ]
        if not lines:
            return Table("*No piece differs.*" if self.report else f"*{_NONE}*")
        heads = {"experiment": "experiment", "difference": "what differs first"}
        return rows_or_note(pd.DataFrame(lines), heads, {})

    def ledger(self) -> Table:
        """One line a claim: the published number, the one found again, and what follows."""
        if not self.report.get("claims"):
            return Table(f"*{_NONE}*")
        rows = [
            {
                "row": claim["row"],
                "claim": claim["claim"],
                "published": _number(claim["published"]),
                "again": _number(claim["again"]),
                "seeds": "the same" if claim["whole"] else "one of several",
                "result": _MARKS[claim["agrees"]],
            }
            for claim in self.report["claims"]
        ]
        heads = {"row": "#", "claim": "claim", "published": "published", "again": "again"}
        return table(rows, columns=heads | {"seeds": "training seeds", "result": "result"})


def read(path: Path) -> Reproduction:
    """Read a report; an empty one if there is no such file."""
    return Reproduction(json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {})


def _share(pieces: Mapping[str, Any]) -> str:
    same = pieces["compared"] - len(pieces["differing"])
    return f"{same} of {pieces['compared']}" if pieces["compared"] else "other settings"


def _number(number: Sequence[float | None]) -> str:
    value, low, high = number
    if value is None:
        return "–"
    interval = "" if low is None or high is None else f" [{low:.3g}, {high:.3g}]"
    return f"{value:.4g}{interval}"
