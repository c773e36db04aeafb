"""A Sphinx extension: the licences of what others made and the site carries, beside it.

They go to `_static/licences/`: a list of what is there and whose it is, and the licence files that
the installed packages bring. MathJax's package brings none; its licence, Apache 2.0, is taken from
a package that has the text. A package that is carried and has no licence file fails the build.
"""

from __future__ import annotations

from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

__all__ = ["CARRIED", "licence_files", "setup", "write"]

CARRIED = {
    "MathJax with its fonts (_static/mathjax)": ("Apache-2.0", "packaging"),
    "Bootstrap, Font Awesome, pydata-sphinx-theme (_static/scripts, styles, vendor)": (
        "MIT; Font Awesome: icons CC BY 4.0, fonts SIL OFL 1.1, code MIT; BSD-3-Clause",
        "pydata-sphinx-theme",
    ),
    "sphinx-book-theme (_static/scripts, styles)": ("BSD-3-Clause", "sphinx-book-theme"),
    "search and basic scripts (_static/*.js)": ("BSD-2-Clause", "sphinx"),
    "clipboard.js and copy buttons (_static/clipboard.min.js, copybutton*)": (
        "MIT", "sphinx-copybutton",
    ),
    "toggle buttons (_static/togglebutton*)": ("MIT", "sphinx-togglebutton"),
    "design elements (_static/sphinx-design*, design-tabs.js)": ("MIT", "sphinx-design"),
}  # fmt: skip
"""What the site carries: where it lies, under which licence, and whose package has the text."""

_HEAD = """What this site carries of others, and under which licence. The book itself is MIT.
The licence texts lie beside this list; Font Awesome's notice is scripts/fontawesome.js.LICENSE.txt.

"""


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension."""
    app.connect("build-finished", _write)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def licence_files(package: str) -> list[Path]:
    """Return the licence files of an installed package.

    Raises:
        FileNotFoundError: It has none.
    """
    dist = distribution(package)
    found = [
        Path(str(dist.locate_file(file)))
        for file in dist.files or []
        if ".dist-info" in str(file) and "licen" in file.name.lower()
    ]
    if not found:
        raise FileNotFoundError(f"{package} has no licence file, and the site carries its files")
    return found


def write(folder: Path) -> None:
    """Write the list and the texts into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = []
    for what, (licence, package) in CARRIED.items():
        texts = licence_files(package)
        if licence == "Apache-2.0":  # packaging may be had under either of two
            texts = [path for path in texts if path.suffix == ".APACHE"]
        for path in texts:
            name = f"{package if licence != 'Apache-2.0' else 'mathjax'}-{path.name}"
            (folder / f"{Path(name).stem}{path.suffix}.txt").write_bytes(path.read_bytes())
        lines.append(f"{what}\n    {licence}\n")
    (folder / "README.txt").write_text(_HEAD + "\n".join(lines), encoding="utf-8")


def _write(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        write(Path(app.outdir) / "_static" / "licences")
