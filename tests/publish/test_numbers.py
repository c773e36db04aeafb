"""What a page quotes is compared as it is printed."""

import json

import pytest

from cpl.publish.numbers import compare, quoted


def notebook(**glued):
    outputs = [
        {
            "output_type": "display_data",
            "data": {"application/papermill.record/text/plain": repr(text)},
            "metadata": {"scrapbook": {"name": name}},
        }
        for name, text in glued.items()
    ]
    return json.dumps({"cells": [{"cell_type": "markdown"}, {"outputs": outputs}]})


def test_quoted_numbers_are_found_as_the_text_shows_them():
    assert quoted(notebook(bound="0.350", who="it's")) == {"bound": "0.350", "who": "it's"}


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"cells": [1]}', '{"cells": 3}'])
def test_what_is_no_notebook_is_refused(text):
    with pytest.raises(ValueError, match="notebook must be"):
        quoted(text)


def test_a_quoted_text_is_never_evaluated():
    bad = json.loads(notebook(a="1"))
    out = bad["cells"][1]["outputs"][0]
    out["data"]["application/papermill.record/text/plain"] = "__import__('os').getcwd()"
    with pytest.raises(ValueError, match="notebook must be"):
        quoted(json.dumps(bad))


@pytest.mark.parametrize(
    ("before", "after", "beyond"),
    [
        ("0.350", "0.351", False),  # rounding may have done it
        ("0.350", "0.352", True),
        ("0.1", "0.05", True),
        ("12", "13", True),  # a count is exact
        ("12,000", "12,001", True),
        ("90.3 %", "90.4 %", False),
        ("90.3 %", "90.9 %", True),
        ("1.2e-05", "1.3e-05", False),
        ("1.2e-05", "2.3e-05", True),
        ("\u22120.50", "0.50", True),
        ("0.10 to 0.20", "0.10 to 0.25", True),
        ("holds", "does not hold", True),
        ("0.10 m", "0.10 s", True),
        ("", "0.10", True),
    ],
)
def test_what_counts_as_moved(before, after, beyond):
    (moved,) = compare({"n": before} if before else {}, {"n": after})
    assert moved.beyond is beyond
    (back,) = compare({"n": after}, {"n": before} if before else {})
    assert back.beyond is beyond


def test_a_relative_tolerance_is_added_on_top():
    assert not compare({"n": "100.0"}, {"n": "109.0"}, rtol=0.1)[0].beyond
    assert compare({"n": "100.0"}, {"n": "109.0"}, rtol=0.01)[0].beyond
    with pytest.raises(ValueError, match="rtol"):
        compare({}, {}, rtol=float("nan"))


def test_what_is_equal_is_not_listed():
    assert compare({"a": "1", "b": "x"}, {"a": "1", "b": "x"}) == []
