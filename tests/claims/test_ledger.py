import json
from dataclasses import fields, replace

import numpy as np
import pytest

from cpl.claims import _ledger, accept, changes, committed, ledger, own, table
from cpl.claims._ledger import claims
from cpl.claims.claim import Source
from cpl.claims.row import Row
from cpl.claims.verdict import Verdict
from cpl.store import DamagedResultError, data_path, import_closure, publish, read_published

FIELDS = [
    "row", "claim", "paper_value", "value", "low", "high", "n", "n_seeds", "rule", "verdict",
    "flags", "chapter", "computed_from", "in_the_twin",
]  # fmt: skip
PAPERS = {row: claim for row, claim in claims().items() if not claim.ours}
# What was committed to: `cpl claims --accept` is how a verdict is changed on purpose.
VERDICTS = {row: verdict for row, verdict in committed().items() if claims()[row].decide}


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
    undecided = {n for n, row in rows.items() if row.verdict in ("needs hardware", "pending")}
    assert undecided == {n for n, claim in claims().items() if claim.decide is None}
    assert {n for n in undecided if rows[n].verdict == "needs hardware"} == set(range(42, 50))


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
    assert not [
        m for m in closure if m.startswith(("cpl.experiments", "cpl.sweep", "cpl.conformal"))
    ]


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
    (
        17,
        "base_policies",
        lambda t: t.assign(episode_return=t.episode_return * (t.kind == "speed")),
    ),
    (10, "switch_choice", lambda t: t.assign(floor_missed=0)),
    (10, "switch_choice", lambda t: t.assign(floor_missed=t.floor_scored)),
    (11, "exit_time", lambda t: t.assign(exit=t.exit + 100)),
    (11, "exit_time", lambda t: t[:50]),
    (12, "coverage_episodes", lambda t: scaled(t, -1, quantity="paired q")),
    (13, "forecasts", lambda t: scaled(t, 1.5, quantity="coverage_raw")),
    (14, "switch_ablation", lambda t: t.assign(alpha=1 - t.alpha)),
    (14, "switch_ablation", lambda t: t[t.variant != "alpha 0.4"]),
    (18, "forecasts", lambda t: scaled(t, 2, quantity="parameters")),
    (19, "coverage_episodes", lambda t: scaled(t, 0.05, quantity="too fast", driver="switch")),
    (20, "pareto", lambda t: faster(t, 3.0)),
    (20, "pareto", lambda t: faster(t, -3.0)),
    (21, "pareto", lambda t: faster(t, 3.0)),
    (21, "pareto", lambda t: faster(t, -3.0)),
    (22, "pareto", lambda t: faster(t, 2.0 - 1.5 * t.value)),
    (22, "pareto", lambda t: faster(t, 1.5 * t.value)),
    (23, "forecast_cost", lambda t: t.assign(seconds=t.seconds.max())),
    (24, "forecast_cost", lambda t: t.assign(seconds=t.seconds.max())),
    (25, "forecast_cost", lambda t: t.assign(weights_changed=1)),
    (27, "coverage_episodes", lambda t: scaled(t, 2, quantity="miss")),
    (28, "coverage_episodes", lambda t: scaled(t, 3, quantity="window")),
    (26, "pareto", lambda t: t.assign(method=t.method.replace(EXCHANGE))),
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
EXCHANGE = {"safe": "speed", "speed": "safe"}


def scaled(table, by, **where):
    """Multiply the value of some quantity."""
    fits = np.logical_and.reduce([table[name] == value for name, value in where.items()])
    return table.assign(value=np.where(fits, by * table["value"], table["value"]))


def faster(table, by):
    """Make the conformal switch faster by so many metres a second, everything else equal."""
    by = np.where(table["method"] == "conformal", by, 0.0)
    return table.assign(
        speed_sum=table["speed_sum"] + by * table["steps"],
        episode_speed_sum=table["episode_speed_sum"] + by * table["episodes"],
    )


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


# Rules about agents are spoilt in test_rules_table1.py and test_rules_listening.py, the book's own
# in test_own.py.
ELSEWHERE = {*range(29, 42), *range(51, 54)}


def test_every_computed_row_has_mutations():
    assert {row for row, _, _ in MUTATIONS} | ELSEWHERE == set(VERDICTS)


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
    path.write_text(json.dumps({**verdicts, "10": "holds"}))
    assert changes(root=copy) == {10: ("holds", "holds in part")}


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
        json.dumps(row.__dict__, allow_nan=False)
