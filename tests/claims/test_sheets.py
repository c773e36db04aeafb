"""The page on which a row can be judged alone, and the files beside it."""

import json
import re

import pytest

from cpl.claims import readings, sheet
from cpl.claims.row import Effect, EffectsTable, Row
from cpl.claims.sheets import Sheet, claim_graph, claims_file
from cpl.claims.verdict import SIGNS, Verdict

ROW = Row(
    row=7, claim="a < b & c", paper_value="3 s", value=1.5, low=1.0, high=2.0, n=1000, n_seeds=10,
    rule="the rule", verdict="holds in part", flags=("a flag",), chapter="switch",
    computed_from=("pareto/paper@abc",), where="Section I", formula=r"a<b", unit="s",
    margin="2 s: why", would_change="one more", order="data first: old data",
    before="undecided", revised="It has a margin.",
    conditions=tuple(
        Effect(name=f"level {k}", value=k, low=k - 1, high=k + 1, needed=2.0, verdict="holds")
        for k in range(20)
    ),
)  # fmt: skip


def test_a_row_shows_what_one_needs_to_judge_it():
    shown = Sheet((ROW,))._repr_html_()
    for text in (
        "no. 7", "a &lt; b &amp; c", r"\(a&lt;b\)", "the rule", "1.5 s (1 to 2)", "2 s: why",
        "1,000 units, 10 seeds", "data first: old data", "undecided (another verdict)",
        "It has a margin.", "one more", "a flag", "pareto/paper@abc", "switch.html",
    ):  # fmt: skip
        assert text in shown
    assert 'id="claim-7"' in shown
    assert 'data-changed="1"' in shown
    assert shown.count("<tr><td>level") == 12
    assert "and 8 more, in the file beside this page: holds in 20" in shown


def test_without_html_there_is_the_short_table():
    assert Sheet((ROW,))._repr_markdown_().startswith("| # | claim |")


def test_every_verdict_has_a_sign():
    assert set(SIGNS) == set(Verdict)
    assert len(set(SIGNS.values())) == len(SIGNS)


def test_the_files_say_the_same_and_the_graph_has_no_loose_end():
    told = json.loads(claims_file([ROW]))
    assert told[0]["conditions"][3]["name"] == "level 3"
    graph = json.loads(claim_graph([ROW, ROW]))
    known = {node["id"] for node in graph["nodes"]}
    assert known == {
        "claim:7", "verdict:holds in part", "chapter:switch", "evidence:pareto/paper@abc",
        "experiment:pareto",
    }  # fmt: skip
    assert len(graph["edges"]) == 4
    assert {edge[end] for edge in graph["edges"] for end in ("from", "to")} == known


def test_the_page_has_the_rows_that_it_is_asked_for():
    assert re.findall(r'id="claim-(\d+)"', sheet(1, 42)._repr_html_()) == ["1", "42"]
    with pytest.raises(ValueError, match="got 0"):
        sheet(0)


def test_readings_stand_side_by_side():
    effects = tuple(
        Effect(name=f"over {who}: {how}", value=1.0, low=0.5, high=1.5, needed=0.7, verdict="holds")
        for who, how in (("a", "per km"), ("b", "per km"), ("a", "per episode"))
    )
    assert str(EffectsTable(effects, "reading")).splitlines() == [
        "| reading | over a | over b |",
        "|:---|---:|---:|",
        "| per km | +1.00 (+0.50 to +1.50) | +1.00 (+0.50 to +1.50) |",
        "| per episode | +1.00 (+0.50 to +1.50) |  |",
    ]


def test_a_row_without_readings_has_no_such_table():
    with pytest.raises(ValueError, match="got 42"):
        readings(42)
