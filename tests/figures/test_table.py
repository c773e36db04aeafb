"""Tables: what is shown, how it is written, and what is refused."""

import pandas as pd
import pytest

from cpl.figures.table import table


def test_a_frame_and_its_records_give_the_same_table():
    frame = pd.DataFrame({"W": [5, 40], "share": [1.0, 0.35]})
    assert table(frame) == table(frame.to_dict("records"))
    assert str(table(frame)).splitlines()[2] == "| 5 | 1.0 |"


def test_columns_choose_order_and_heading():
    made = table([{"a": 1, "b": 2, "c": 3}], columns={"c": "third", "a": "first"})
    assert made.markdown.splitlines() == ["| third | first |", "|---:|---:|", "| 3 | 1 |"]


def test_bars_and_line_breaks_do_not_break_a_row():
    made = table([{"text": "a|b\nc"}])
    assert made.markdown.splitlines()[-1] == r"| a\|b c |"


def test_a_notebook_gets_markdown():
    made = table([{"a": 1}])
    assert made._repr_markdown_() == made.markdown


def test_no_row_and_no_such_column_are_refused():
    with pytest.raises(ValueError, match="rows must hold"):
        table([])
    with pytest.raises(ValueError, match="'speed'"):
        table([{"a": 1}], columns={"speed": "speed"})


def test_numbers_stand_to_the_right_texts_to_the_left():
    frame = pd.DataFrame({"rule": ["fixed"], "T": [5], "share": [0.5], "holds": [True]})
    assert table(frame).markdown.splitlines()[1] == "|:---|---:|---:|---:|"
