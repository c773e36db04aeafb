"""The fault table on a smaller scale: everything is tried, and nothing is wrong and silent."""

import importlib
import json
import logging

import pytest

from tests.faults import frame
from tests.faults.__main__ import main, topics


def test_the_frame_counts_and_refuses_words_it_does_not_know():
    row = frame.tally("shard", "cut", ["refused", "harmless", "refused"])
    assert (row.tried, row.refused, row.harmless, row.silent) == (3, 2, 1, 0)
    with pytest.raises(ValueError, match="outcomes must be of"):
        frame.tally("shard", "cut", ["fine"])


@pytest.mark.parametrize("how", ["cut", "flip"])
def test_damage_is_damage_and_the_same_every_time(how):
    content = bytes(range(200))
    copies = list(frame.damaged(content, how, 50))
    assert content not in copies
    assert copies == list(frame.damaged(content, how, 50))


def test_a_topic_that_is_not_run_keeps_its_rows(tmp_path):
    row = frame.tally("shard", "cut", ["refused"])
    for topic in ("one", "two", "one"):
        path = frame.write(tmp_path / "faults.json", topic, [row], {"made": topic})
    told = json.loads(path.read_text())
    assert {name: part["made"] for name, part in told.items()} == {"one": "one", "two": "two"}
    assert told["two"]["rows"][0]["refused"] == 1


def test_hostile_input_is_refused_or_shown_as_text(tmp_path, capsys):
    assert main(["--only", "hostile", "--out", str(tmp_path / "faults.json")]) == 0
    logging.disable(logging.NOTSET)
    told = json.loads((tmp_path / "faults.json").read_text())["hostile"]
    assert sum(row["tried"] for row in told["rows"]) > 200
    assert told["processor_s"] > 0
    assert "0 wrong and silent" in capsys.readouterr().out


@pytest.mark.faults
@pytest.mark.parametrize("topic", sorted(set(topics()) - {"hostile"}))
def test_nothing_is_wrong_and_silent(topic, caplog):
    caplog.set_level(logging.CRITICAL)
    module = importlib.import_module(f"tests.faults.provoke_{topic}")
    rows = list(module.provoke(8 if topic == "kills" else 25))
    assert rows
    assert [row for row in rows if row.silent] == []
