"""The published points of the switch's limit, for the explorer and its picture."""

from __future__ import annotations

__all__ = ["pareto_files"]

from cpl.figures.live import missing
from cpl.publish.live._script import as_script


def pareto_files() -> tuple[dict[str, str], str]:
    """Return the script of the explorer, and the picture that stands in for it."""
    picture = missing("No results on the limit of the switch are published yet.").svg()
    return {"pareto.js": as_script("pareto", None)}, picture
