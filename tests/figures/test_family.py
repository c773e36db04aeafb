"""The family's numbers on a page are those of the ledger."""

import numpy as np
import pytest

from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.conformal.family import MEMBERS
from cpl.figures import family, tables
from cpl.store import read_published


@pytest.fixture(scope="module")
def result():
    return read_published("gate_family", "paper")


@pytest.fixture(scope="module")
def parts(result):
    return [result[0][result[0]["setting"] == name] for name in ("gate", "switch")]


@pytest.mark.parametrize(
    ("row", "part", "name", "than"),
    [(54, 0, "kt", None), (55, 0, "EWMA tuned", "quantile"), (57, 1, "cost_aware", None)],
)
def test_an_excess_is_the_number_of_its_row(result, parts, row, part, name, than):
    table, manifest = result
    source = Source(table=table, parameters=manifest.parameters)
    decide = claims()[row].decide
    assert decide
    found = decide(lambda experiment: source)
    own = family.excess(parts[part], name, than=than)[name]
    assert (own.value, own.low, own.high) == pytest.approx((found.value, found.low, found.high))


def test_the_words_say_what_was_counted(parts):
    said = family.in_words(*parts)
    gate = parts[0][parts[0]["method"] == "near misses"]
    assert said["near_crashes"] == f"{gate['crashes'].sum() / gate['episodes'].sum():.0%}"
    assert said["below"] == said["members"] == str(len(MEMBERS))
    # Every member drives where no constant does.
    places = [float(said[n]) for n in ("wide_speed", "slowest", "fastest", "narrow_speed")]
    assert places == sorted(places)


def test_the_table_has_everybody_and_no_excess_for_constants(parts):
    gate, _ = parts
    lines = str(tables.loop(gate)).splitlines()[2:]
    settings = gate.groupby(["method", "value"], observed=True).ngroups
    assert len(lines) == settings
    constants = [line for line in lines if line.startswith("| constant |")]
    assert len(constants) == 9
    assert not any(" to " in line for line in constants)
    assert sum(" to " in line for line in lines) == settings - 9


def test_the_figure_shows_constants_members_and_rivals(parts):
    (axes,) = family.at_equal_speed(parts[0]).axes
    curve, members, rivals = axes.lines
    assert np.size(curve.get_xdata()) == 9
    assert np.size(members.get_xdata()) == len(MEMBERS)
    assert np.size(rivals.get_xdata()) == 8
