"""A Sphinx extension: of the theme's icons, only those that pages show.

The theme loads a script of 1.5 MB with every icon there is, and preloads three fonts. The dozen
that pages show is taken from it once the site is written, and becomes a small style sheet. The
font stays, for the few marks that the theme's own style sheet sets with it.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

from sphinx.application import Sphinx

_SCRIPT, _STYLES = "_static/scripts/fontawesome.js", "_static/icons.css"
_LOADS = re.compile(
    r'<script [^>]*src="([^"]*)_static/scripts/fontawesome\.js[^"]*"[^>]*></script>\s*'
    r"|<link [^>]*vendor/fontawesome/[^>]*/?>\s*|<link [^>]*scripts/fontawesome\.js[^>]*/?>\s*"
)
_NAMED = re.compile(r'class="[^"]*\bfa[sbr]?(?:-solid|-brands|-regular)?\b[^"]*"')
_MODIFIERS = {"solid", "brands", "regular", "lg", "sm", "xs", "fw", "spin", "stack"}
_NOTICE = "/* Icons of Font Awesome Free, https://fontawesome.com, CC BY 4.0. */\n"
_BASE = """:is(.fa-solid, .fa-brands, .fa-regular, .fas, .fab, .far)::before {
  content: ""; display: inline-block; width: 1em; height: 1em; vertical-align: -.125em;
  background: currentColor; mask: var(--icon) center / contain no-repeat;
}
.fa-lg { font-size: 1.25em; }
@media (forced-colors: active) { [class*="fa-"]::before { background: ButtonText; } }
"""


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension."""
    app.connect("build-finished", _replace)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _replace(app: Sphinx, exception: Exception | None) -> None:
    script = Path(app.outdir) / _SCRIPT
    if exception is not None or app.builder.format != "html" or not script.exists():
        return
    source = script.read_text(encoding="utf-8")
    used: set[str] = set()
    for path in Path(app.outdir).rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        for classes in _NAMED.findall(text):
            used |= set(re.findall(r"\bfa-([a-z0-9-]+)", classes)) - _MODIFIERS
        mended = _LOADS.sub(_style, text)
        if mended != text:
            path.write_text(mended, encoding="utf-8")
    rules = "".join(_rule(name, source) for name in sorted(used))
    (Path(app.outdir) / _STYLES).write_text(_NOTICE + _BASE + rules, encoding="utf-8")
    script.unlink()


def _style(found: re.Match[str]) -> str:
    """Load the style sheet where the script was loaded, and nothing for its preloads."""
    if found[1] is None:
        return ""
    return f'<link rel="stylesheet" type="text/css" href="{found[1]}{_STYLES}" />\n'


def _rule(name: str, source: str) -> str:
    """Return the style of one icon; solid ones stand last in the theme's script."""
    shapes = re.findall(
        rf'[{{,]"?{re.escape(name)}"?:\[(\d+),(\d+),\[[^\]]*\],"[0-9a-f]+","([^"]+)"\]', source
    )
    if not shapes:
        msg = f"the theme has no icon {name!r}"
        raise ValueError(msg)
    width, height, path = shapes[-1]
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">'
    image = quote(f'{svg}<path d="{path}"/></svg>', safe=" =:/'(),")
    return f'.fa-{name} {{ --icon: url("data:image/svg+xml,{image}"); }}\n'
