"""A Sphinx extension: `{live}` places a figure that readers operate, with a picture for all others.

    ```{live} tracker
    :name: live-tracker
    :alt: What the picture shows, for readers who do not see it.
    :caption: What the figure is about.
    :scene: anything that this figure wants to know

    What the figure shows, for print and for browsers without scripts.
    ```

The picture is `_static/live/<name>.svg`. Only pages with live figures load their scripts: classic
ones, without modules or requests, which also run when a page is opened from disk.
"""

from __future__ import annotations

from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

SCRIPTS = {
    "tracker": ("live/family.js", "live/tracker.js", "live/kit.js", "live/playground.js"),
    "road": ("live/kit.js", "live/data/rides.js", "live/road.js"),
    "pareto": ("live/kit.js", "live/data/pareto.js", "live/pareto.js"),
    "wheel": ("live/kit.js", "live/host.js", "live/wheel.js"),
    "trial": ("live/kit.js", "live/host.js", "live/trial.js"),
}
_TITLES = {
    "tracker": "Tracker playground",
    "road": "Replay of recorded rides",
    "pareto": "Explorer of the switch's limit",
    "wheel": "The road, to drive",
    "trial": "The road, to experiment with",
}


class LiveFigure(nodes.General, nodes.Element):
    """A live figure with its fallback as children; the last child may be a caption."""


class LiveCaption(nodes.Part, nodes.TextElement):
    """What a live figure is about."""


class Live(SphinxDirective):
    """The directive."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {
        "name": directives.unchanged,
        "alt": directives.unchanged_required,
        "caption": directives.unchanged,
        "scene": directives.unchanged,
    }

    def run(self) -> list[nodes.Node]:
        """Build the figure."""
        kind = self.arguments[0]
        if kind not in SCRIPTS:
            raise self.error(f"no live figure is called {kind!r}; there are {', '.join(SCRIPTS)}")
        if "alt" not in self.options:
            raise self.error(
                f"the live figure {kind!r} needs :alt:, which says what its picture shows"
            )
        figure = LiveFigure(kind=kind, scene=self.options.get("scene", ""))
        uri = f"_static/live/{kind}.svg"
        figure += nodes.image(uri=uri, alt=self.options["alt"], candidates={"?": ""})
        self.state.nested_parse(self.content, self.content_offset, figure)
        if "caption" in self.options:
            words, messages = self.state.inline_text(self.options["caption"], self.lineno)
            figure += LiveCaption("", "", *words)
            figure += messages
        self.add_name(figure)
        return [figure]


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension."""
    app.add_node(LiveFigure, html=(_open_figure, _close_figure))
    app.add_node(LiveCaption, html=(_open_caption, _close_caption))
    app.add_directive("live", Live)
    app.connect("html-page-context", _load_scripts)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _open_figure(self: Any, node: LiveFigure) -> None:
    kind = node["kind"]
    self.body.append(
        self.starttag(
            node, "figure", CLASS="live", **{"data-live": kind, "data-scene": node["scene"]}
        )
    )
    title = _TITLES[kind]
    self.body.append(f'<div class="live-stage" role="group" aria-label="{title}" hidden></div>\n')
    self.body.append('<div class="live-fallback">\n')


def _close_figure(self: Any, node: LiveFigure) -> None:
    captioned = bool(node.children) and isinstance(node.children[-1], LiveCaption)
    self.body.append("</figure>\n" if captioned else "</div>\n</figure>\n")


def _open_caption(self: Any, _node: LiveCaption) -> None:
    self.body.append('</div>\n<figcaption><span class="caption-text">')


def _close_caption(self: Any, _node: LiveCaption) -> None:
    self.body.append("</span></figcaption>\n")


def _load_scripts(
    app: Sphinx,
    _page: str,
    _template: str,
    _context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    kinds = {node["kind"] for node in doctree.findall(LiveFigure)} if doctree else set()
    if not kinds:
        return
    app.add_css_file("live/live.css")
    for script in dict.fromkeys(name for kind in sorted(kinds) for name in SCRIPTS[kind]):
        app.add_js_file(script, loading_method="defer")
