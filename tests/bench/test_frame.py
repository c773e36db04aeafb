"""The bench's frame: rows of one topic replace that topic's and no others, ratios and table."""

import itertools
import json

import pytest

from tests.bench import frame


def _row(topic, subject, value):
    return {"topic": topic, "bench": f"{topic}: work", "subject": subject, "peer": "",
            "value": value, "unit": "ns", "ratio": None, "limit": None}  # fmt: skip


def test_merge_replaces_only_the_topics_that_ran():
    old = [_row("a", "x", 1.0), _row("b", "y", 2.0), _row("b", "z", 3.0)]
    merged = frame.merge(old, [_row("b", "y", 9.0)], ["b"])
    assert [(row["topic"], row["subject"], row["value"]) for row in merged] == [
        ("a", "x", 1.0),
        ("b", "y", 9.0),
    ]


def test_write_then_read_gives_the_rows_back(tmp_path):
    path = tmp_path / "build" / "bench.json"
    assert frame.read(path) == []
    frame.write(path, [_row("a", "x", 1.5)])
    assert frame.read(path) == json.loads(path.read_text()) == [_row("a", "x", 1.5)]


def test_compare_divides_by_the_work_and_by_the_peer():
    rows = frame.compare("b", {"ours": 2e-3, "loop": 8e-3}, per={"ours": 1000, "loop": 500},
                         unit="us/step", scale=1e6, peer="loop", limits={"ours": 5.0})  # fmt: skip
    assert [(r.subject, r.value, r.peer, r.limit) for r in rows] == [
        ("ours", pytest.approx(2.0), "loop", 5.0),
        ("loop", pytest.approx(16.0), "", None),
    ]
    assert [r.ratio for r in rows] == [pytest.approx(8.0), None]


def test_fastest_takes_turns_after_one_untimed_call_and_keeps_the_minimum():
    calls, ticks = [], itertools.chain([0, 5, 5, 6, 6, 8, 8, 12])
    best = frame.fastest({"x": lambda: calls.append("x"), "y": lambda: calls.append("y")},
                         rounds=2, clock=lambda: next(ticks))  # fmt: skip
    assert calls == ["x", "y", "x", "y", "x", "y"]
    assert best == {"x": 2, "y": 1}


def test_table_names_each_bench_once_and_shows_the_aim():
    rows = [_row("a", "x", 1.0) | {"limit": 5.0}, _row("a", "y", 2.0), _row("b", "z", 3.0)]
    lines = frame.table(rows).splitlines()
    assert [line for line in lines if not line.startswith(" ")] == ["a: work", "b: work"]
    assert len(lines) == 6
    assert "<= 5" in lines[2]


def test_versions_say_when_a_package_is_absent():
    assert "no-such-package absent" in frame.versions(["no-such-package"])
    assert "numpy 2" in frame.versions(["numpy"])
