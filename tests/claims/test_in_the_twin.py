"""What the twin shows of the claims about the robot: computed, never a verdict, never typed."""

import pandas as pd
import pytest

from cpl.claims import ledger, twin_table
from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.claims.rows._twin import AS, NOT, OPEN, PART, combined
from cpl.claims.verdict import Verdict
from cpl.store import read_published

IN_THE_TWIN = {row: claim.in_the_twin for row, claim in claims().items() if claim.in_the_twin}
NEEDED = ("quadruped_logs", "quadruped_collect", "quadruped_predictor")


@pytest.fixture(scope="module")
def stored():
    return {name: read_published(name, "paper") for name in NEEDED}


def reader(stored, change=lambda t: t, **parameters):
    def read(experiment):
        table, manifest = stored[experiment]
        if experiment == "quadruped_logs":
            table = change(table.copy()).reset_index(drop=True)
        told = {k: v for k, v in parameters.items() if k in manifest.parameters}
        return Source(table=table, parameters=manifest.parameters | told)

    return read


def shifted(row, number, by, **cell):
    """Return a change of a table that moves a number with its interval."""

    def change(table):
        chosen = (table["row"] == row) & (table["number"] == number)
        for name, value in cell.items():
            chosen &= table[name] == value
        assert chosen.any()
        table.loc[chosen, ["value", "low", "high"]] += by
        return table

    return change


def both(*changes):
    def change(table):
        for each in changes:
            table = each(table)
        return table

    return change


def test_the_rows_that_need_the_robot_have_a_text_and_keep_their_verdict():
    rows = {row.row: row for row in ledger()}
    assert set(IN_THE_TWIN) == set(range(42, 50))
    for number, row in rows.items():
        if number not in IN_THE_TWIN:
            assert row.in_the_twin is None
            continue
        assert row.verdict == "needs hardware"
        leans, _, text = row.in_the_twin.partition(": ")
        assert leans in {AS, PART, NOT, OPEN}
        assert any(each.isdigit() for each in text)
        assert row.computed_from[0].startswith("quadruped_")


def test_no_word_of_the_twin_is_a_verdict():
    assert not {AS, PART, NOT} & set(Verdict)
    shown = str(twin_table())
    assert "holds" not in shown
    assert len(shown.splitlines()) == 2 + 8


# One line a mutation: row, what is done to the table, how it then leans. A large shift down makes
# every difference one in favour of the switch, a large shift up one against it.
MUTATIONS = [
    (42, shifted(42, "start_end_m", -100, shape="all", folder="quadruped"), AS),
    (42, shifted(42, "start_end_m", +100, shape="all", folder="quadruped"), NOT),
    (43, shifted(43, "start_end_m", +100, part="out - in"), NOT),
    (43, shifted(43, "start_end_m", -100, part="out - in"), {AS, PART}),
    (44, shifted(44, "start_end_m", -100), AS),
    (44, shifted(44, "start_end_m", +100), NOT),
    (
        45,
        both(
            shifted(45, "start_end_m", -100, part="in"),
            shifted(45, "auc", -1, shape="rectangle"),
        ),
        AS,
    ),
    (
        45,
        both(
            shifted(45, "start_end_m", +100, part="in"),
            shifted(45, "auc", +1, shape="rectangle"),
        ),
        NOT,
    ),
    (
        46,
        both(
            shifted(46, "duration_s", +100, shape="triangle"),
            shifted(46, "duration_s", +100, shape="rectangle"),
            shifted(46, "duration_s", -100, shape="hexagon"),
        ),
        AS,
    ),
    (46, shifted(46, "duration_s", +100), PART),
    (47, shifted(47, "windows_reached", +1), AS),
    (47, shifted(47, "windows_reached", -1), NOT),
    (48, shifted(48, "0.1 m/s faster", +100), {AS, PART}),
    (48, lambda t: t.assign(**{c: t[c].where(t["row"] != 48, 0.5) for c in ("low", "high")}), PART),
    (49, shifted(49, "excess", -2), AS),
    (49, shifted(49, "excess", +2), NOT),
]


@pytest.mark.parametrize(("row", "change", "leans"), MUTATIONS)
def test_a_changed_table_leans_another_way(stored, row, change, leans):
    said = IN_THE_TWIN[row](reader(stored, change))
    assert said.leans in ({leans} if isinstance(leans, str) else leans)
    assert str(said) != str(IN_THE_TWIN[row](reader(stored)))


def test_every_row_leans_both_ways():
    """No rule can only come out one way."""
    for row in IN_THE_TWIN:
        assert len({str(leans) for number, _, leans in MUTATIONS if number == row}) >= 2


@pytest.mark.parametrize("setting", [{"trajectories": 42}, {"kp": 2.0}, {"positive_weight": 1.0}])
def test_other_training_data_than_the_papers_decide_nothing(stored, setting):
    said = IN_THE_TWIN[49](reader(stored, **setting))
    assert said.leans == OPEN


def test_a_number_that_is_missing_or_there_twice_is_an_error(stored):
    with pytest.raises(ValueError, match=r"one row for .* got 0"):
        IN_THE_TWIN[44](reader(stored, lambda t: t[t["row"] != 44]))
    with pytest.raises(ValueError, match=r"one row for .* got 2"):
        IN_THE_TWIN[44](reader(stored, lambda t: pd.concat([t, t])))


def test_without_results_there_is_no_text(tmp_path):
    row = {row.row: row for row in ledger(root=tmp_path)}[42]
    assert (row.in_the_twin, row.computed_from) == (None, ())


def test_parts_are_put_together():
    assert combined([AS, AS]) == AS
    assert combined([AS, NOT]) == PART
    assert combined([OPEN, NOT]) == NOT
    assert combined([OPEN]) == OPEN
    with pytest.raises(ValueError, match="must not be empty"):
        combined([])
