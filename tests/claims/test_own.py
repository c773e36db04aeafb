"""The book's own claims: what is said today, and that a changed table says something else."""

import numpy as np
import pandas as pd
import pytest

from cpl.claims import committed, own
from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.claims.verdict import Verdict
from cpl.conformal.family import MEMBERS
from cpl.store import project_root, read_published

OURS = {row: claim for row, claim in claims().items() if claim.ours}


def swapped(table, a, b):
    """Exchange the names of two methods."""
    return table.assign(method=table["method"].replace({a: b, b: a}))


def among(table, method, **columns):
    """Change some columns of one method's rows."""
    mine = table["method"] == method
    changed = {name: np.where(mine, change(table), table[name]) for name, change in columns.items()}
    return table.assign(**changed)


def in_order(table):
    """Let members miss the more, the more often their gate crashes."""
    place = {name: (k + 1) / 100 for k, name in enumerate(MEMBERS)}
    share = table["method"].astype(str).map(place)
    return table.assign(
        crashes=np.where(share.isna(), table["crashes"], share * table["episodes"]),
        missed=np.where(share.isna(), table["missed"], (0.05 + share) * table["scored"]),
    )


def doing_as(table, other, *methods):
    """Let methods do what another does, setting by setting."""
    rest, own = table[~table["method"].isin(methods)], table[table["method"] == other]
    return pd.concat([rest, *(own.assign(method=name) for name in methods)])


# One line a mutation: row, experiment, what is done to its table.
MUTATIONS = [
    (51, "gate_controls", lambda t: among(t, "constant", crashes=lambda t: t["episodes"])),
    (51, "gate_controls", lambda t: t.assign(crashes=t["crashes"] * (t["method"] == "constant"))),
    (51, "gate_controls", lambda t: t.assign(crashes=t["episodes"] - t["crashes"])),
    (52, "gate_stream", lambda t: among(t, "quantile", crashes=lambda t: 2 * t["crashes"])),
    (52, "gate_stream", lambda t: among(t, "quantile", crashes=lambda t: 0 * t["crashes"])),
    (52, "gate_stream", lambda t: t.assign(crashes=t["episodes"] - t["crashes"])),
    (53, "gate_stream", lambda t: swapped(t, "quantile", "frozen")),
    (53, "gate_diagnostic", lambda t: t.assign(coverage=2 * t["nominal"] - t["coverage"])),
    (53, "gate_diagnostic", lambda t: t.assign(coverage=0.9)),
    (54, "gate_family", lambda t: among(t, "kt", crashes=lambda t: 2 * t["crashes"])),
    (54, "gate_family", lambda t: among(t, "constant", crashes=lambda t: 0 * t["crashes"])),
    (54, "gate_family", lambda t: t.assign(crashes=t["episodes"] - t["crashes"])),
    (55, "gate_family", lambda t: doing_as(t, "quantile", "EWMA tuned", "ewma", "rolling")),
    (55, "gate_family", lambda t: among(t, "rolling", crashes=lambda t: t["episodes"])),
    (56, "gate_family", in_order),
    (56, "gate_family", lambda t: t.assign(missed=0)),
    (57, "gate_family", lambda t: among(t, "constant", crashes=lambda t: t["episodes"])),
    (57, "gate_family", lambda t: doing_as(t, "saocp", *MEMBERS)),
]


@pytest.fixture(scope="module")
def stored():
    names = sorted({name for _, name, _ in MUTATIONS})
    return {name: read_published(name, "paper") for name in names}


def reader(stored, changed=None, change=None):
    def read(experiment):
        content, manifest = stored[experiment]
        content = change(content).reset_index(drop=True) if experiment == changed else content
        return Source(table=content, parameters=manifest.parameters)

    return read


def test_the_rows_are_numbered_after_the_papers():
    rows = own()
    assert [row.row for row in rows] == list(OURS)
    assert min(OURS) == len(claims()) - len(OURS) + 1
    for row in rows:
        if row.verdict == Verdict.PENDING:  # its rule is committed before its data
            continue
        assert row.n > 0
        assert row.n_seeds >= 3
        assert row.low <= row.value <= row.high
        assert row.computed_from
        assert (project_root() / "book" / f"{row.chapter}.md").is_file()


def test_every_row_has_mutations():
    decided = {row.row for row in own() if row.verdict != Verdict.PENDING}
    assert {row for row, _, _ in MUTATIONS} | {58} == decided  # test_both_ways.py


@pytest.mark.parametrize(("row", "experiment", "change"), MUTATIONS)
def test_a_changed_result_flips_the_verdict(stored, row, experiment, change):
    assert OURS[row].decide(reader(stored)).verdict == committed()[row]
    assert OURS[row].decide(reader(stored, experiment, change)).verdict != committed()[row]


def test_what_stands_beside_row_52_decides_nothing(stored):
    """Every world, a moving average and the best single constant are told beside it."""
    found = OURS[52].decide(reader(stored))
    names = [one.name for one in found.beside]
    assert any("moving average" in name for name in names)
    assert sum(", in " in name for name in names) == 8
    assert {one.name for one in found.conditions}.isdisjoint(names)


def test_an_interval_over_worlds_is_the_wider_one(stored):
    beside = {one.name: one.effect for one in OURS[52].decide(reader(stored)).beside}
    (over,) = (each for name, each in beside.items() if "over worlds" in name)
    plain = OURS[52].decide(reader(stored)).conditions[0].effect
    assert over.value == pytest.approx(plain.value)
    assert over.high - over.low > plain.high - plain.low


def test_row_57_is_blunt_with_five_pairs(stored):
    """What the page says of it: one member that never crashes does not decide it."""

    def unharmed(table):
        return among(table, "split", crashes=lambda t: 0 * t["crashes"])

    found = OURS[57].decide(reader(stored, "gate_family", unharmed))
    assert found.verdict == Verdict.UNDECIDED
    assert found.high < -0.03
