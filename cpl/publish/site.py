"""From chapters to the site: execute what is not at hand, lay it out, render it."""

from __future__ import annotations

from pathlib import Path

from cpl.publish.chapters import find_chapters, find_pages
from cpl.publish.render import render
from cpl.publish.run import Report, execute_all
from cpl.publish.stage import remove, write_stage
from cpl.store import atomic_write

__all__ = ["build", "write_entrance"]


def build(root: Path, *, jobs: int = 2, report: Report = print) -> Path:
    """Build the site: execute what is not at hand, lay it out, render it.

    Args:
        root: The project's folder.
        jobs: How many chapters run at a time.
        report: Told what is going on.

    Returns:
        The front page, `_build/html/index.html`.

    Raises:
        ExecutionError: If a chapter fails.
        SiteError: If the renderer fails or warns; the old site is then left as it was.
    """
    pages = set(find_pages(root))
    chapters = {n: c for n, c in find_chapters(root).items() if c.path in pages}
    executed = execute_all(list(chapters.values()), root, jobs=jobs, report=report)
    stage = root / "_build" / "stage"
    write_stage(stage, root, chapters, executed)
    report(f"rendering {len(pages)} pages")
    fresh = render(stage, root / "_build" / "render")
    write_entrance(fresh, root)
    site, old = root / "_build" / "html", root / "_build" / "html.old"
    remove(old)
    if site.exists():
        site.rename(old)
    fresh.rename(site)
    remove(old)
    return site / "index.html"


def write_entrance(site: Path, root: Path) -> None:
    """Write the `index.html` that leads to the front page, which lies one folder deeper."""
    front = find_pages(root)[0].relative_to(root).with_suffix(".html").as_posix()
    atomic_write(site / "index.html", _ENTRANCE.format(front=front))


# A static host and a reader with a file manager both open index.html first.
_ENTRANCE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8" />
<meta http-equiv="refresh" content="0; url={front}" />
<title>To the front page</title>
</head>
<body><p><a href="{front}">To the front page</a></p></body>
</html>
"""
