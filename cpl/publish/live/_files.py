"""The files that live figures and badges need beside their scripts."""

from __future__ import annotations

import re
from collections.abc import Callable

from cpl.claims import discussed_in
from cpl.conformal import Fixed, adversary, bounds, track_exact
from cpl.experiments import published
from cpl.figures.live import missing, preview
from cpl.figures.road import moments
from cpl.figures.theory import band
from cpl.publish.live._facts import judged_files, ledger_file
from cpl.publish.live._pareto import pareto_files, pareto_picture
from cpl.publish.live._rides import opening_moments, ride_scripts
from cpl.publish.live._script import as_script
from cpl.publish.live._tab import tab_scripts

__all__ = ["files_for_page", "files_for_site"]

_FOLDER = "_static/live"
_LANES = 4
_FIGURE = re.compile(r"\{live\} (\w+)")
_BADGE = re.compile(r"\{claim\}`(\d+)`")
_LEDGER = f"{_FOLDER}/data/ledger.json"


def files_for_site(text: str) -> dict[str, bytes]:
    """Return what the pages of a site need: data and pictures of their figures, and the ledger.

    Args:
        text: The pages' text. Without a live figure in it nothing is needed.

    Returns:
        Content by place relative to `book/`, such as `_static/live/data/rides.js`.
    """
    figures = _figures(text)
    if not figures:
        return {}
    judged = {f"{_FOLDER}/data/{name}": content for name, content in judged_files().items()}
    return {**figures, **judged, _LEDGER: ledger_file(), "_static/preview.png": _preview()}


def files_for_page(text: str, slug: str) -> dict[str, bytes]:
    """Return what one page that stands alone needs; of the ledger, the rows that it shows.

    Args:
        text: The page's text.
        slug: The chapter's name.

    Returns:
        As for `files_for_site`.
    """
    rows = {*discussed_in(slug), *(int(number) for number in _BADGE.findall(text))}
    return {**_figures(text), **({_LEDGER: ledger_file(sorted(rows))} if rows else {})}


def _figures(text: str) -> dict[str, bytes]:
    """Return data and pictures of the live figures that a text places."""
    texts: dict[str, str] = {}
    for name in sorted(set(_FIGURE.findall(text)) & _DRAWN.keys()):
        scripts, picture = _DRAWN[name]()
        texts |= {f"data/{script}": content for script, content in scripts.items()}
        texts[f"{name}.svg"] = picture
    return {f"{_FOLDER}/{name}": content.encode() for name, content in texts.items()}


def _preview() -> bytes:
    worst = adversary.upper_worst_case(0.1, 0.1, 1, W=80).as_floats()
    q = track_exact(worst, Fixed(eta=0.1), alpha=0.1).q
    words = "An executable book: what holds of the paper, and what does not"
    return preview(worst, q, title="Conformal Policy Learning", words=words)


def _tracker() -> tuple[dict[str, str], str]:
    worst = adversary.upper_worst_case(0.1, 0.1, 1, W=80)
    scores = worst.as_floats()
    q = track_exact(scores, Fixed(eta=0.1), alpha=0.1).q
    walls = bounds.quantile_range(0.1, 0.1, 1)
    return {}, band(scores, q, low=float(walls.low), high=float(walls.high)).svg()


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


def _wheel() -> tuple[dict[str, str], str]:
    return tab_scripts(), _rides()[1]


def _trial() -> tuple[dict[str, str], str]:
    return tab_scripts(), pareto_picture()


_DRAWN: dict[str, Callable[[], tuple[dict[str, str], str]]] = {
    "tracker": _tracker,
    "road": _rides,
    "pareto": pareto_files,
    "wheel": _wheel,
    "trial": _trial,
}
