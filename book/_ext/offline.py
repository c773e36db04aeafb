"""A Sphinx extension: pages that need no other host, and say what they are about.

- MathJax comes from the installed package `sphinx-mathjax-offline`; of its 24 MB only the parts
  that pages load, the fonts and the small TeX extensions are published.
- Each page describes itself to search engines and link previews with its first sentences.
- Roles that the theme gives wrongly, and that mislead screen readers, are taken back.
- Files that no page ever loads (translations of the theme, source maps) are left out.
"""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

_MATHJAX = (
    "startup.js",
    "core.js",
    "input/tex.js",
    "input/tex/extensions",
    "output/chtml.js",
    "output/chtml/fonts/tex.js",
    "output/chtml/fonts/woff-v2",
    "a11y/assistive-mml.js",
)
_MATHJAX_PARTS = ["input/tex", "output/chtml", "a11y/assistive-mml"]  # without its menu
_NEVER_LOADED = ("_static/locales", "_static/**/*.map", "_static/**/*.ttf", "_static/images/logo_*")
_WRONG_ROLES = {
    ' role="list" class="citation-list"': ' class="citation-list"',
    ' role="doc-biblioentry"': "",
}
_DESCRIPTION = 200  # characters that a search engine shows


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension."""
    app.connect("config-inited", _use_local_mathjax)
    app.connect("html-page-context", _describe)
    app.connect("html-page-context", _mend_roles)
    app.connect("build-finished", _copy_mathjax)
    app.connect("build-finished", _leave_out)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _use_local_mathjax(_app: Sphinx, config: Any) -> None:
    config.mathjax_path = "mathjax/startup.js"
    config.mathjax3_config = {
        **(config.mathjax3_config or {}),
        "loader": {"load": _MATHJAX_PARTS},
    }


def _copy_mathjax(app: Sphinx, exception: Exception | None) -> None:
    if exception is not None or app.builder.format != "html":
        return
    package = find_spec("sphinx-mathjax-offline")
    if package is None or package.origin is None:
        message = "sphinx-mathjax-offline is not installed"
        raise ModuleNotFoundError(message)
    source = Path(package.origin).parent / "static" / "mathjax"
    target = Path(app.outdir) / "_static" / "mathjax"
    for part in _MATHJAX:
        (target / part).parent.mkdir(parents=True, exist_ok=True)
        if (source / part).is_dir():
            shutil.copytree(source / part, target / part, dirs_exist_ok=True)
        else:
            shutil.copyfile(source / part, target / part)


def _leave_out(app: Sphinx, exception: Exception | None) -> None:
    if exception is not None or app.builder.format != "html":
        return
    for pattern in _NEVER_LOADED:
        for path in Path(app.outdir).glob(pattern):
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink()


def _describe(
    _app: Sphinx, page: str, _template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Add the page's description, unless its author wrote one."""
    if context.get("title") == context.get("docstitle"):
        context["title"] = "Start here"  # not "Book - Book"
    if doctree is None or 'name="description"' in context.get("metatags", ""):
        return
    text = next((_words(p) for p in doctree.findall(nodes.paragraph) if len(_words(p)) > 60), "")
    if len(text) > _DESCRIPTION:
        text = text[:_DESCRIPTION].rsplit(" ", 1)[0] + " …"
    values = {"description": text, "og:title": context.get("title", page), "og:description": text}
    if (Path(_app.srcdir) / "book/_static/preview.png").exists():
        up = "../" * page.count("/")
        values |= {"og:image": f"{up}_static/preview.png", "og:image:alt": "A tracker at work"}
    tags = "".join(_tag(name, value) for name, value in values.items() if value)
    context["metatags"] = context.get("metatags", "") + tags


def _mend_roles(
    _app: Sphinx,
    _page: str,
    _template: str,
    context: dict[str, Any],
    _doctree: nodes.document | None,
) -> None:
    """Make the bibliography plain text: its roles are deprecated, or forbid its links."""
    for wrong, right in _WRONG_ROLES.items():
        context["body"] = context.get("body", "").replace(wrong, right)


def _words(paragraph: nodes.paragraph) -> str:
    return " ".join(paragraph.astext().split())


def _tag(name: str, value: str) -> str:
    plain = value.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    kind = "property" if name.startswith("og:") else "name"
    return f'<meta {kind}="{name}" content="{plain}" />\n'
