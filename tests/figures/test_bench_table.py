"""The bench's rows as a table."""

import pytest

from cpl.figures.table import bench_table

ROW = {"bench": "road: 50 cars", "subject": "ours", "value": 19900.2, "unit": "steps/s"}


def test_two_peers_of_one_subject_share_a_line():
    text = bench_table(
        [{**ROW, "peer": "a", "ratio": 8.958}, {**ROW, "peer": "b", "ratio": 4936.5}]
    ).markdown.splitlines()
    assert text[0] == "| what | who | measured | times a | times b |"
    assert text[2:] == ["| 50 cars | ours | 19,900 steps/s | 8.96 | 4,940 |"]


def test_a_number_that_stands_alone_leaves_the_peers_blank():
    alone = {**ROW, "subject": "memory", "value": 7.5556, "unit": "KB", "peer": "", "ratio": None}
    text = bench_table([{**ROW, "peer": "a", "ratio": 2.0}, alone]).markdown.splitlines()
    assert text[3] == "| 50 cars | memory | 7.56 KB |  |"


def test_refuses_no_rows():
    with pytest.raises(ValueError, match="at least one row"):
        bench_table([])
