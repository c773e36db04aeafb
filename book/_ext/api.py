"""A Sphinx extension: `{api} cpl.conformal` lists a room's public names with what they do.

    ```{api} cpl.conformal
    ```

One entry a name of the module's `__all__`: how it is called, and its docstring as it stands in the
source. The docstrings are written to be read in a terminal, so they are shown as they are.
"""

from __future__ import annotations

import inspect
from importlib import import_module
from types import ModuleType
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Api(SphinxDirective):
    """The directive."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """List the public names."""
        module = import_module(self.arguments[0])
        summary = _first(inspect.getdoc(module) or "")
        found: list[nodes.Node] = [nodes.paragraph("", *_inline(summary))]
        for name in sorted(module.__all__, key=str.lower):
            found += self._entry(module, name)
        return found

    def _entry(self, module: ModuleType, name: str) -> list[nodes.Node]:
        thing = getattr(module, name)
        text = inspect.getdoc(thing) if callable(thing) else None
        head = nodes.paragraph(classes=["api-name"])
        target = nodes.make_id(f"api-{module.__name__}-{name}")
        head["ids"].append(target)
        head += nodes.literal("", f"{module.__name__}.{name}{_signature(thing)}")
        if not text:
            return [head]
        first, _, rest = text.partition("\n\n")
        body = nodes.paragraph("", *_inline(" ".join(first.split())))
        if not rest.strip():
            return [head, body]
        block = nodes.literal_block(rest, rest, language="none", classes=["api-docstring"])
        return [head, body, block]


def _signature(thing: object) -> str:
    """Return how it is called, as far as Python can tell."""
    if not callable(thing):
        return ""
    try:
        signature = inspect.signature(thing)
    except (TypeError, ValueError):
        return "(...)"
    plain = [p.replace(annotation=inspect.Parameter.empty) for p in signature.parameters.values()]
    return str(signature.replace(parameters=plain, return_annotation=inspect.Signature.empty))


def _first(text: str) -> str:
    return " ".join(text.partition("\n\n")[0].split())


def _inline(text: str) -> list[nodes.Node]:
    """Set what stands between backticks as code; everything else is plain text."""
    parts = text.replace("``", "`").split("`")
    return [
        nodes.literal("", part) if place % 2 else nodes.Text(part)
        for place, part in enumerate(parts)
        if part
    ]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("api", Api)
    return {"version": "1", "parallel_read_safe": True}
