"""The counts' page says what was counted, and what was not."""

import json

import pytest

from cpl.figures import faults
from cpl.store import data_path, encode_table, read_published

ROW = {"place": "shard", "fault": "cut", "tried": 3, "refused": 2}
ROW |= {"recovered": 0, "harmless": 1, "silent": 0}
TOLD = {
    "made": "2026-01-02", "commit": "0123456789", "versions": {"python": "3.11.7"},
    "machine": {"processor": "AMD EPYC", "system": "Linux x86_64"}, "rows": [ROW, ROW],
}  # fmt: skip


@pytest.fixture
def counts(tmp_path):
    path = tmp_path / "faults.json"
    path.write_text(json.dumps({"formats": TOLD}))
    return faults.read(path)


def test_totals_and_tables_come_from_the_file(counts):
    assert [counts.total(name) for name in ("tried", "refused", "silent")] == [6, 4, 0]
    assert str(counts.summary()).splitlines()[2].endswith("| 6 | 4 | 0 | 2 | 0 |")
    assert len(str(counts.rows("formats")).splitlines()) == 4
    assert counts.where().startswith("Counted 2026-01-02 at 01234567 on AMD EPYC")
    assert counts.verdict() == "6 faults; 0 wrong and silent."
    assert "Not counted: logs whose bytes" in counts.where()


def test_what_was_not_counted_says_so(counts, tmp_path):
    assert "not counted" in str(counts.rows("kills"))
    none = faults.read(tmp_path / "none.json")
    assert "Not counted" in none.where()
    assert "Not counted" in str(none.summary())
    assert none.total() == 0
    assert "nothing is claimed" in none.verdict()
    with pytest.raises(ValueError, match="topic must be one of formats, logs"):
        counts.rows("format")


def test_a_table_without_a_digest_hides_a_flipped_bit():
    whole = encode_table(read_published("proximity", "paper")[0])
    assert faults.read_alone(whole, whole) == "harmless"
    assert faults.read_alone(whole[:-9], whole) == "refused"
    ends = set()
    for place in range(4000, 4000 + 8 * 40, 8):
        copy = bytearray(whole)
        copy[place] ^= 1
        ends.add(faults.read_alone(bytes(copy), whole))
    assert "silent" in ends


def test_the_stored_counts_are_the_full_ones_and_none_is_silent():
    counts = faults.read(data_path("faults", "faults.json"))
    assert counts.total("silent") == 0
    for name, told in counts.topics.items():
        assert name in faults.TOPICS
        assert sum(row["tried"] for row in told["rows"]) >= 50
