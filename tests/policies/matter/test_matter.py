"""`cpl matter`: right answers where one can see what is right, and refusals that say why."""

import numpy as np
import pandas as pd
import pytest

from cpl.cli import main
from cpl.conformal import Fixed
from cpl.policies.matter import Playable, ask_log, ask_system, ask_walks, judge, play, read_log
from tests.policies.matter import lanes, steady

RULE = Fixed(eta=0.5)


def played(module, rule=RULE, **how):
    return judge(play(Playable.of(module), rule, alpha=0.1, **({"episodes": 40} | how)))


def test_where_fog_comes_and_goes_a_tracked_distance_matters():
    answer = played(lanes)
    assert answer.verdict == "matters"
    assert answer.gain.low > 0
    assert answer.controls["shuffled"].low > 0
    assert str(answer).startswith("the quantile matters\n")


def test_where_nothing_changes_it_does_not():
    answer = played(steady)
    assert answer.verdict == "does not matter"
    assert "worse than a constant" in str(answer)


def test_with_few_streams_nothing_can_be_told():
    assert played(lanes, streams=4, episodes=10).verdict == "cannot be told"


def log(scores, **columns):
    episode = np.arange(len(scores)) // 25
    return pd.DataFrame({"score": scores, "episode": episode, **columns})


def test_a_log_that_stays_as_it_was_has_nothing_to_adapt_to():
    scores = np.random.default_rng(0).random(2000)
    answer = ask_log(log(scores), Fixed(eta=0.05), alpha=0.1)
    assert answer.verdict == "does not matter"
    assert answer.errors.first["ville"] is None
    assert np.abs(answer.tracked - 0.9).max() < 0.05


def test_a_log_whose_scores_grow_could_matter():
    scores = np.random.default_rng(0).random(2000) * np.repeat([1.0, 1.6], 1000)
    answer = ask_log(log(scores), Fixed(eta=0.05), alpha=0.1)
    assert answer.verdict == "could matter"
    assert answer.frozen.below.any()
    assert 500 < answer.errors.first["ville"] < 700
    assert answer.ranks.first["shiryaev_roberts"] >= 40


def test_if_no_decision_changes_it_does_not_matter_however_the_scores_grow():
    """The trap of this book's switch: forecasts so far from the limit that no threshold tells."""
    scores = np.random.default_rng(0).random(2000) * np.repeat([1.0, 1.6], 1000)
    far = np.tile([-50.0, 50.0], 1000)
    answer = ask_log(log(scores, forecast=far, limit=0.0), Fixed(eta=0.05), alpha=0.1)
    assert answer.verdict == "does not matter"
    assert answer.changed.value == 0.0
    near = ask_log(log(scores, forecast=0.0, limit=1.2), Fixed(eta=0.05), alpha=0.1)
    assert near.verdict == "could matter"
    assert near.changed.low > 0.01


@pytest.mark.parametrize(
    ("name", "verdict"),
    [("gate", "matters"), ("gate-noise", "matters"), ("gate-in-turn", "matters")],
)
def test_the_books_gate_matters_under_noise_and_over_the_stream(name, verdict):
    assert ask_system(name).verdict == verdict


def test_the_papers_switch_does_not_matter():
    answer = ask_system("switch")
    assert answer.verdict == "does not matter"
    assert answer.gain.low < 0 < answer.gain.high < 0.03


def test_the_walks_change_where_the_gains_do():
    assert ask_walks("walks-usual").verdict == "does not matter"
    assert ask_walks("walks-larger").verdict == "could matter"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "must be a table"),
        ("a,b\n1,2\n", "must have a column 'score'"),
        ("score\n1\nx\n", "line 3: score must be a finite number"),
        ("score\n1\ninf\n", "line 3: score must be a finite number"),
    ],
)
def test_a_file_that_is_no_log_is_refused(tmp_path, content, message):
    path = tmp_path / "log.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        read_log(path)


def test_the_command_answers_and_refuses(tmp_path, capsys):
    path = tmp_path / "log.csv"
    log(np.random.default_rng(0).random(800)).to_csv(path, index=False)
    assert main(["matter", str(path), "--method", "fixed"]) == 0
    assert capsys.readouterr().out.startswith("the quantile does not matter\n")
    for words, message in (
        (["matter", "nonsense_module"], "neither a log"),
        (["matter", str(path), "--method", "magic"], "--method must be one of"),
        (["matter", str(path), "--scale", "-1"], "--scale must be > 0"),
        (["matter", str(tmp_path / "no.csv")], "No such file"),
        (["matter", str(tmp_path / "no.py")], "no such file"),
        (["matter", "json"], "must define functions make"),
    ):
        assert main(words) == 2
        assert message in capsys.readouterr().err


def test_what_is_judged_must_be_whole():
    whole = play(Playable.of(steady), RULE, alpha=0.1, streams=2, episodes=1)
    with pytest.raises(ValueError, match="must have columns"):
        judge(whole.drop(columns="pace"))
    with pytest.raises(ValueError, match="at least two values"):
        judge(whole[whole["method"] != "constant"])
    with pytest.raises(ValueError, match="streams and constants must be >= 2"):
        play(Playable.of(steady), RULE, alpha=0.1, streams=1)
