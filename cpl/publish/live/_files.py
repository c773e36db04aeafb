"""All files that live figures need beside their scripts, by place in the book's folder."""

from __future__ import annotations

from cpl.conformal import Fixed, adversary, bounds, track_exact
from cpl.experiments import published
from cpl.figures.live import missing, preview
from cpl.figures.road import moments
from cpl.figures.theory import band
from cpl.publish.live._facts import ledger_file
from cpl.publish.live._pareto import pareto_files
from cpl.publish.live._rides import opening_moments, ride_scripts
from cpl.publish.live._script import as_script

__all__ = ["live_files"]

_FOLDER = "_static/live"
_LANES = 4
_PREVIEW = "_static/preview.png"


def live_files() -> dict[str, bytes]:
    """Return scripts with data, and the picture that stands in for each live figure.

    Returns:
        Content by place relative to `book/`, such as `_static/live/data/rides.js`.
    """
    rides, road = _rides()
    pareto, fronts = pareto_files()
    scripts = {**rides, **pareto}
    pictures = {"tracker.svg": _tracker_picture(), "road.svg": road, "pareto.svg": fronts}
    texts = {f"data/{name}": text for name, text in scripts.items()} | pictures
    files = {f"{_FOLDER}/{name}": text.encode() for name, text in texts.items()}
    return {**files, f"{_FOLDER}/data/ledger.json": ledger_file(), _PREVIEW: _preview()}


def _preview() -> bytes:
    worst = adversary.upper_worst_case(0.1, 0.1, 1, W=80).as_floats()
    q = track_exact(worst, Fixed(eta=0.1), alpha=0.1).q
    words = "An executable book: what holds of the paper, and what does not"
    return preview(worst, q, title="Conformal Policy Learning", words=words)


def _tracker_picture() -> str:
    worst = adversary.upper_worst_case(0.1, 0.1, 1, W=80)
    scores = worst.as_floats()
    q = track_exact(scores, Fixed(eta=0.1), alpha=0.1).q
    walls = bounds.quantile_range(0.1, 0.1, 1)
    return band(scores, q, low=float(walls.low), high=float(walls.high)).svg()


def _rides() -> tuple[dict[str, str], str]:
    """Return the rides that are published: those of learned policies if there are any."""
    for profile in ("paper", "book"):
        try:
            result = published("replays", profile)
        except FileNotFoundError:
            continue
        scripts = ride_scripts(result.table, result.config)
        return scripts, moments(
            opening_moments(result.table, result.config), lanes_count=_LANES
        ).svg()
    return {"rides.js": as_script("rides", None)}, missing("No rides are published yet.").svg()
