import json
from dataclasses import asdict, fields, replace

import numpy as np
import pytest

from cpl.claims import _ledger, accept, changes, committed, edition, ledger, own, table
from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.claims.edition import came_first, digest_of, first_edition, fix, loose
from cpl.claims.row import Row
from cpl.claims.verdict import Verdict
from cpl.store import DamagedResultError, data_path, import_closure, publish, read_published

FIELDS = [
    "row", "claim", "paper_value", "value", "low", "high", "n", "n_seeds", "rule", "verdict",
    "flags", "chapter", "computed_from", "where", "formula", "unit", "margin", "conditions",
    "beside", "would_change", "seeds_needed", "order", "before", "revised", "in_the_twin",
    "on_other_machines",
]  # fmt: skip
PAPERS = {row: claim for row, claim in claims().items() if not claim.ours}
# What was committed to: `cpl claims --accept` is how a verdict is changed on purpose.
VERDICTS = {
    row: verdict
    for row, verdict in committed().items()
    if claims()[row].decide and verdict != Verdict.PENDING
}


@pytest.fixture(scope="module")
def rows():
    return {row.row: row for row in [*ledger(), *own()]}


def test_rows_are_numbered_without_gaps_the_papers_first(rows):
    assert list(rows) == list(claims()) == list(range(1, len(rows) + 1))
    assert list(PAPERS) == list(range(1, len(PAPERS) + 1))
    assert [field.name for field in fields(Row)] == FIELDS


def test_a_claim_s_file_begins_with_its_row():
    folder = data_path().parent / "cpl" / "claims" / "rows"
    for path in folder.glob("c*.py"):
        assert f"    row={int(path.name[1:3])},\n" in path.read_text()
    assert len(list(folder.glob("c*.py"))) == len(claims())


def test_every_verdict_is_of_the_vocabulary(rows):
    assert {row.verdict for row in rows.values()} <= set(Verdict)
    without = {n for n, row in rows.items() if row.verdict == "needs hardware"}
    assert without == {n for n, claim in claims().items() if claim.decide is None}
    assert without == set(range(42, 50))


def test_the_paper_disagrees_with_itself_where_the_list_says(rows):
    flagged = {n for n, row in rows.items() if "paper inconsistent" in row.flags}
    assert flagged == {4, 5, 6, 15, 31, 32, 38}


def test_computed_rows_say_what_they_rest_on(rows):
    for number in VERDICTS:
        row = rows[number]
        assert row.computed_from
        assert row.n > 0
        assert row.low is None or row.low <= row.value <= row.high
        for source in row.computed_from:
            name, _, content = source.partition("/paper@")
            assert read_published(name, "paper")[1].content.startswith(content)


def test_computed_rows_are_shown_in_a_chapter_that_exists(rows):
    for number in VERDICTS:
        assert (data_path().parent / "book" / f"{rows[number].chapter}.md").is_file()


def test_the_verdicts_are_the_committed_ones(rows):
    """What the book says today; a deliberate change is committed by `cpl claims --accept`."""
    assert {n: row.verdict for n, row in rows.items()} == committed()
    assert changes() == {}


def test_numbers_reach_what_the_rules_ask_for(rows):
    assert rows[1].n >= 100_000
    assert rows[2].n >= 10_000
    assert rows[4].n >= 1_000_000
    assert rows[8].n >= 1_000_000


def test_claims_never_start_an_experiment():
    closure = import_closure("cpl.claims")
    assert "cpl.claims.rows.c01_split_conformal" in closure
    assert not [m for m in closure if m.startswith(("cpl.experiments", "cpl.sweep"))]


# One line a mutation: row, experiment, what is done to its table.
MUTATIONS = [
    (1, "split_conformal", lambda t: t.assign(covered=t.draws - t.covered)),
    (1, "split_conformal", lambda t: t.assign(covered=t.covered - t.draws // 50)),
    (1, "split_conformal", lambda t: t.assign(coverage_sum=t.draws - t.coverage_sum)),
    (1, "split_conformal", lambda t: t.assign(coverage_sumsq=t.coverage_sumsq * 1.001)),
    (1, "split_conformal", lambda t: t.assign(pit_03=t.pit_03 + 400, pit_04=t.pit_04 - 400)),
    (1, "split_conformal", lambda t: t[t.kind != "urn"]),
    (2, "pathwise", lambda t: t.assign(above=t.above + (t.index == 7))),
    (2, "pathwise", lambda t: t.assign(largest=t.largest * 10)),
    (2, "pathwise", lambda t: t.assign(mean_error=1 - t.mean_error)),
    (2, "pathwise", lambda t: t.assign(sequences=1)),
    (3, "miscoverage", lambda t: t.assign(wrong_report=t.points - t.wrong_report)),
    (3, "miscoverage", lambda t: t.assign(wrong_set=t.wrong_set + (t.index == 2))),
    (3, "miscoverage", lambda t: t.assign(ties=0)),
    (4, "windows", lambda t: t.assign(corrected=t.corrected + (t.index == 9))),
    (4, "windows", lambda t: t.assign(beyond_exact=t.beyond_exact + (t.index == 9))),
    (4, "windows", lambda t: t.assign(printed=0)),
    (4, "windows", lambda t: t.assign(windows=1000)),
    (4, "certificates", lambda t: t.assign(verdict="unknown")),
    (5, "quantile_range", lambda t: t.assign(leaves=~t.leaves)),
    (5, "quantile_range", lambda t: t.assign(q_max=t.q_max + 10)),
    (5, "quantile_range", lambda t: t.assign(leaves_printed_high=False)),
    (5, "certificates", lambda t: t.assign(verdict="refuted")),
    (6, "update_rule", lambda t: t.assign(errors=t["T"] - t.errors)),
    (6, "update_rule", lambda t: t.assign(rule=t.rule.map(SWAP))),
    (6, "certificates", lambda t: t.assign(verdict="unknown")),
    (7, "adaptive_step", lambda t: t.assign(violations=t.violations + 1)),
    (7, "adaptive_step", lambda t: t.assign(violations=0)),
    (7, "adaptive_step", lambda t: t.assign(error_rate=1 - t.error_rate)),
    (7, "adaptive_step", lambda t: t.assign(ratio=t.ratio + 1)),
    (8, "windows", lambda t: t.assign(lower=t.lower + (t.index == 3))),
    (8, "pathwise", lambda t: t.assign(below=t.below + (t.index == 3))),
    (8, "certificates", lambda t: t.assign(verdict="unknown")),
    (9, "eventually_safe", lambda t: t.assign(violations=t.safe - t.violations)),
    (9, "eventually_safe", lambda t: t.assign(ratio=1.0)),
    (9, "eventually_safe", lambda t: t.assign(unsafe_broken=0)),
    (9, "certificates", lambda t: t.assign(verdict="unknown")),
    (15, "speed_cap", lambda t: t.assign(speed_mps=t.top_mps)),
    (15, "speed_cap", lambda t: t.assign(speed_mps=-t.speed_mps)),
    (15, "speed_cap", lambda t: t.assign(lanes_count=3)),
    (23, "forecast_cost", lambda t: t.assign(seconds=t.seconds.max())),
    (24, "forecast_cost", lambda t: t.assign(seconds=t.seconds.max())),
    (25, "forecast_cost", lambda t: t.assign(weights_changed=1)),
    (16, "proximity", lambda t: t.assign(l_tilde=-t.l_tilde)),
    (16, "proximity", lambda t: t.assign(l_tilde=1 - t.l_tilde)),
    (16, "proximity", lambda t: t.assign(l_tilde=t.l_tilde * (t.index != 700))),
    (50, "robot_loop", lambda t: t.assign(loop_p99_s=t.loop_p99_s + 0.1 * (t.index == 3))),
    (50, "robot_loop", lambda t: t.assign(loop_p99_s=-t.loop_p99_s)),
    (50, "robot_loop", lambda t: t.assign(gain_wrong=t.gain_wrong + (t.index == 2))),
    (50, "robot_loop", lambda t: t.assign(stop_wrong=t.stop_wrong + (t.index == 5))),
    (50, "robot_loop", lambda t: t.assign(quiet=t.steps)),
    (50, "robot_loop", lambda t: t[:1]),
]
SWAP = {"printed": "corrected", "corrected": "printed"}


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


# Rules about effects are tried both ways, and open, in test_both_ways.py and the files it names.
ELSEWHERE = {10, 11, 12, 13, 14, *range(17, 23), *range(26, 29), *range(29, 42), *range(51, 59)}


def test_every_computed_row_has_mutations():
    assert {row for row, _, _ in MUTATIONS} | ELSEWHERE >= set(VERDICTS)


@pytest.mark.parametrize(("row", "experiment", "change"), MUTATIONS)
def test_a_changed_result_flips_the_verdict(stored, row, experiment, change):
    as_stored = claims()[row].decide(reader(stored)).verdict
    assert as_stored == VERDICTS[row]
    assert claims()[row].decide(reader(stored, experiment, change)).verdict != as_stored


@pytest.fixture
def copy(tmp_path, stored):
    """All published theory results in a layer of the test's own."""
    for content, manifest in stored.values():
        publish(content, manifest, root=tmp_path)
    accept(root=tmp_path)
    return tmp_path


def test_a_change_in_the_stored_files_is_reported(copy, stored):
    assert changes(root=copy) == {}
    content, manifest = stored["proximity"]
    publish(content.assign(l_tilde=-content["l_tilde"]), manifest, root=copy)
    assert changes(root=copy) == {16: ("holds", "does not hold")}
    assert {r.row: r for r in ledger(root=copy)}[16].verdict == "does not hold"


def test_a_missing_result_makes_its_rows_pending(copy):
    (copy / "certificates" / "paper.json").unlink()
    changed = changes(root=copy)
    assert set(changed) == {4, 5, 6, 7, 8, 9}
    assert {now for _, now in changed.values()} == {"pending"}


def test_a_verdict_typed_by_hand_is_noticed(copy):
    path = copy / "verdicts.json"
    verdicts = json.loads(path.read_text())
    path.write_text(json.dumps({**verdicts, "7": "holds"}))
    assert changes(root=copy) == {7: ("holds", "holds in part")}


def test_no_verdict_is_typed_beside_a_claim():
    assert "verdict" not in {field.name for field in fields(claims()[1])}


def test_a_row_is_decided_once_for_the_same_results(copy, monkeypatch):
    asked = []
    monkeypatch.setattr(_ledger, "_KEPT", {})
    for row, claim in claims().items():
        rule = claim.decide and (lambda read, c=claim: asked.append(c.row) or c.decide(read))
        monkeypatch.setitem(claims(), row, replace(claim, decide=rule))
    first = ledger(root=copy)
    once = [*asked]
    assert ledger(root=copy) == first
    # What is not published is asked for again: it may be there by now.
    again = asked[len(once) :]
    assert again == [row.row for row in first if row.verdict == "pending"]


def test_a_result_that_is_damaged_later_is_noticed(copy):
    ledger(root=copy)
    path = copy / "windows" / "paper.parquet"
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(DamagedResultError, match="windows"):
        ledger(root=copy)


def test_the_table_for_a_page():
    shown = str(table(1, 4, 42))
    assert len(shown.splitlines()) == 5
    assert "false as printed, true as corrected (paper inconsistent)" in shown
    assert shown == table(1, 4, 42)._repr_markdown_()
    assert len(str(table()).splitlines()) == 2 + len(PAPERS)
    with pytest.raises(ValueError, match="got 0"):
        table(0)


def test_values_are_plain_numbers(rows):
    for row in rows.values():
        assert not isinstance(row.value, np.generic)
        json.dumps(asdict(row), allow_nan=False)


def test_every_row_says_what_one_needs_to_judge_it(rows):
    for row in rows.values():
        assert row.formula
        assert row.unit
        assert row.margin
        assert row.where
        if row.verdict in ("pending", "needs hardware"):
            continue
        assert row.order, row.row
        if row.verdict == "undecided" and row.row in PAPERS:
            assert row.seeds_needed > 0
        if row.conditions:
            assert row.would_change


def test_few_of_the_papers_rows_are_undecided(rows):
    open_ = [row for row in rows.values() if row.verdict == "undecided" and row.row in PAPERS]
    assert len(open_) <= 3


def test_the_first_edition_stays_visible_and_every_other_verdict_has_its_reason(rows):
    first = first_edition()
    assert set(first) <= set(rows)
    for number, before in first.items():
        assert rows[number].before == before.verdict
        if before.verdict not in (None, rows[number].verdict):
            assert rows[number].revised


def test_the_rules_are_the_fixed_ones():
    """`cpl claims --fix` after a change, before the data that it is to decide on."""
    assert loose(claims()) == []


def test_a_rule_is_fixed_once_and_a_changed_one_anew(tmp_path, monkeypatch):
    path = fix(claims(), tmp_path)
    once = path.read_text()
    monkeypatch.setattr(edition, "source_commit", lambda: "later")
    assert fix(claims(), tmp_path).read_text() == once
    real = edition.digest_of
    monkeypatch.setattr(edition, "digest_of", lambda c: "new" if c.row == 20 else real(c))
    assert loose(claims(), tmp_path) == [20]
    told = json.loads(fix(claims(), tmp_path).read_text())["rows"]
    assert told["20"]["commit"] == "later"
    assert told["21"]["commit"] == json.loads(once)["rows"]["21"]["commit"]


def test_data_that_name_a_rule_came_after_it():
    claim = claims()[20]
    manifest = read_published("pareto", "paper")[1]
    assert came_first(claim, [manifest]).startswith("data first")
    newer = replace(manifest, rules={"20": digest_of(claim)})
    assert came_first(claim, [newer]).startswith("rule first")
    assert came_first(claim, [newer, manifest]).startswith("data first")
    other = replace(manifest, rules={"20": "another rule"})
    assert came_first(claim, [other]).startswith("data first")


def test_a_rule_that_was_left_alone_keeps_the_order_of_the_first_edition():
    manifest = read_published("forecasts", "paper")[1]
    assert came_first(claims()[18], [manifest]) == "rule first"


def test_the_rules_of_the_family_came_before_its_data(rows):
    """Their commit is the one that the data name as their source."""
    source = read_published("gate_family", "paper")[1].commit
    for number in range(54, 58):
        assert rows[number].order.startswith(f"rule first: committed in {source[:7]}")
        assert rows[number].before is None
        assert first_edition()[number].rule == claims()[number].rule
