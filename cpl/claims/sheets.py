"""The ledger as a page on which each row can be judged alone, and as files for other programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from typing import Any

from cpl.claims.row import ClaimsTable, Effect, Row
from cpl.claims.verdict import SIGNS, Verdict

__all__ = ["Sheet", "claim_graph", "claims_file"]

_SHOWN = 12  # conditions of a row that are listed; a row of 480 says how many there are


@dataclass(frozen=True)
class Sheet:
    """Rows of the ledger: a line each, with everything that one needs to judge it behind it."""

    rows: tuple[Row, ...]

    def _repr_html_(self) -> str:
        """Draw the rows; a script of the site lets them be filtered and sorted."""
        return f'<div class="claims">{_controls(self.rows)}{"".join(map(_row, self.rows))}</div>'

    def _repr_markdown_(self) -> str:
        """Show the short table where no HTML is shown."""
        return str(ClaimsTable(self.rows))


def claims_file(rows: Sequence[Row]) -> str:
    """Return all rows with all that is known of them, as JSON."""
    return json.dumps([asdict(row) for row in rows], indent=1, allow_nan=False) + "\n"


def claim_graph(rows: Sequence[Row]) -> str:
    """Return claims, experiments, evidence and verdicts as nodes and edges, as JSON.

    A claim is *decided from* evidence, a published table; evidence *comes from* an experiment; a
    claim *has* a verdict, and is *shown in* a chapter.
    """
    nodes: dict[str, dict[str, str]] = {}
    edges: list[dict[str, str]] = []

    def node(kind: str, name: str, label: str) -> str:
        key = f"{kind}:{name}"
        nodes[key] = {"id": key, "kind": kind, "label": label}
        return key

    def edge(start: str, end: str, kind: str) -> None:
        entry = {"from": start, "to": end, "kind": kind}
        if entry not in edges:
            edges.append(entry)

    for row in rows:
        claim = node("claim", str(row.row), row.claim)
        edge(claim, node("verdict", row.verdict, row.verdict), "has")
        edge(claim, node("chapter", row.chapter, row.chapter), "shown in")
        for source in row.computed_from:
            evidence = node("evidence", source, source)
            edge(claim, evidence, "decided from")
            name = source.partition("/")[0]
            edge(evidence, node("experiment", name, name), "comes from")
    return json.dumps({"nodes": list(nodes.values()), "edges": edges}, indent=1) + "\n"


def _controls(rows: Sequence[Row]) -> str:
    """Draw what filters and sorts; without a script it is hidden and all rows are shown."""
    there = {row.verdict for row in rows}
    verdicts = "".join(
        f"<option>{escape(verdict)}</option>" for verdict in map(str, Verdict) if verdict in there
    )
    return (
        '<form class="claims-controls" hidden>'
        f'<label>verdict <select name="verdict"><option value="">all</option>{verdicts}</select>'
        "</label>"
        '<label>came first <select name="order"><option value="">either</option>'
        '<option value="rule">the rule</option><option value="data">the data</option></select>'
        "</label>"
        '<label><input type="checkbox" name="changed"> verdict changed</label>'
        '<label>sort by <select name="sort"><option value="row">number</option>'
        '<option value="verdict">verdict</option><option value="seeds">seeds</option></select>'
        "</label>"
        '<label>words <input type="search" name="words" size="12"></label>'
        '<button type="button" name="open">open all</button>'
        '<output name="shown"></output></form>'
    )


def _row(row: Row) -> str:
    kind = list(SIGNS).index(Verdict(row.verdict))
    changed = row.before is not None and row.before != row.verdict
    data = (
        f'data-row="{row.row}" data-verdict="{escape(row.verdict)}" data-kind="{kind}" '
        f'data-order="{escape(row.order.split(" ")[0])}" data-changed="{int(changed)}" '
        f'data-seeds="{row.n_seeds or 0}"'
    )
    sign = f'<span aria-hidden="true">{SIGNS[Verdict(row.verdict)]}</span>'
    return (
        f'<details class="claim" id="claim-{row.row}" {data}><summary>'
        f'<span class="claim-number">no. {row.row}</span> '
        f'<span class="claim-text">{escape(row.claim)}</span> '
        f'<span class="verdict verdict-{kind}">{sign} {escape(row.verdict)}</span> '
        f'<span class="claim-value">{_number(row)}</span></summary>'
        '<p class="claim-formula"><span class="math notranslate nohighlight">'
        f"\\({escape(row.formula)}\\)</span></p>"
        f"<dl>{_facts(row)}</dl>{_effects('What decides', row.conditions)}"
        f"{_effects('Beside it, deciding nothing', row.beside)}</details>"
    )


def _number(row: Row) -> str:
    if row.value is None:
        return ""
    unit = "" if row.unit == "1" else f" {escape(row.unit)}"
    interval = "" if row.low is None or row.high is None else f" ({row.low:.3g} to {row.high:.3g})"
    return f"{row.value:.3g}{unit}{interval}"


def _facts(row: Row) -> str:
    seeds = f"{row.n:,} units, {row.n_seeds} seeds" if row.n and row.n_seeds is not None else ""
    first = ""
    if row.before is not None:
        same = "the same verdict" if row.before == row.verdict else "another verdict"
        first = f"{row.before} ({same}). {row.revised}"
    told = {
        "Where": row.where,
        "The paper's number": row.paper_value or "",
        "Rule": row.rule,
        "Number": _number(row) + (", with its 95 % interval" if row.low is not None else ""),
        "Margin": row.margin,
        "Counted": seeds,
        "Which came first": row.order,
        "First edition": first or row.revised,
        "What would change it": row.would_change,
        "Seeds that would decide it": str(row.seeds_needed or ""),
        "To be known": "; ".join(row.flags),
        "In the twin": row.in_the_twin or "",
        "On other machines": row.on_other_machines or "",
        "Computed from": ", ".join(row.computed_from),
        "Shown in": f"{row.chapter}",
    }
    return "".join(
        f"<dt>{escape(name)}</dt><dd>{_linked(name, text)}</dd>"
        for name, text in told.items()
        if text
    )


def _linked(name: str, text: str) -> str:
    return (
        f'<a href="{escape(text)}.html">{escape(text)}</a>' if name == "Shown in" else escape(text)
    )


def _effects(title: str, effects: Sequence[Effect]) -> str:
    if not effects:
        return ""
    lines = "".join(
        f"<tr><td>{escape(one.name)}</td><td>{one.value:+.3g}</td>"
        f"<td>{one.low:+.3g} to {one.high:+.3g}</td><td>{one.needed:.3g}</td>"
        f"<td>{escape(one.verdict)}</td></tr>"
        for one in effects[:_SHOWN]
    )
    rest = len(effects) - _SHOWN
    more = (
        f"<p>and {rest} more, in the file beside this page: {_counts(effects)}</p>"
        if rest > 0
        else ""
    )
    return (
        f'<div class="claim-effects"><table><caption>{escape(title)}</caption><thead><tr>'
        "<th>condition</th><th>effect</th><th>95 % interval</th><th>needed</th><th>alone</th>"
        f"</tr></thead><tbody>{lines}</tbody></table>{more}</div>"
    )


def _counts(effects: Sequence[Effect]) -> str:
    counts: dict[str, Any] = {}
    for one in effects:
        counts[one.verdict] = counts.get(one.verdict, 0) + 1
    return ", ".join(f"{verdict} in {count}" for verdict, count in counts.items())
