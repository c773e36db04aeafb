"""Scores in; threshold, coverage and a bound that really bounds out."""

import gymnasium
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from cpl.cli import main
from cpl.conformal import Fixed, RunningMax, TrailingMax, track
from cpl.conformal.bounds import max_errors_from_start
from cpl.forecast.audit import audit, environment_scores


@given(
    st.lists(st.floats(0, 1), min_size=1, max_size=60),
    st.sampled_from([Fixed(eta=0.1), Fixed(eta=0.7), RunningMax(c=0.1), RunningMax(c=1.0)]),
    st.sampled_from([0.1, 0.2, 0.5]),
    st.sampled_from([1, 3]),
)
def test_no_sequence_breaks_the_bound(scores, rule, alpha, delay):
    assume(delay <= len(scores))
    found = audit(scores, rule, alpha=alpha, delay=delay)
    assert (
        found.table["q"].tolist()
        == track(np.array(scores), rule, alpha=alpha, delay=delay).q.tolist()
    )
    assert found.bound is None or found.errors <= found.bound <= len(scores)


def test_the_bound_is_attained():
    """Scores that stay at their largest are missed as often as the bound allows.

    In exact numbers the 31st would meet its threshold and 13 be the most; in floats it misses.
    """
    found = audit([1.0] * 31, Fixed(eta=0.1), alpha=0.1)
    assert found.errors == found.bound == max_errors_from_start(0.1, 0.1, 1, 31) + 1
    found = audit([1.0] * 32, Fixed(eta=0.1), alpha=0.1)
    assert found.errors == found.bound == max_errors_from_start(0.1, 0.1, 1, 32)


@pytest.mark.parametrize(
    ("scores", "rule", "delay", "why"),
    [
        ([0.5, -0.1], Fixed(eta=0.1), 1, "a score is negative (-0.1)"),
        ([0.0, 0.0], Fixed(eta=0.1), 1, "every score is 0"),
        ([0.5, 0.5], TrailingMax(c=0.1, window=5), 1, "it can freeze"),
        ([0.5, 0.5, 0.5], RunningMax(c=0.1), 3, "with a delay of 3"),
        ([0.0, 0.5], RunningMax(c=0.1), 1, "the first score is 0"),
    ],
)
def test_what_has_no_guarantee_says_so_and_why(scores, rule, delay, why):
    found = audit(scores, rule, alpha=0.1, delay=delay)
    assert found.bound is None
    assert why in found.unbounded


def test_a_delay_beyond_the_scores_is_refused():
    with pytest.raises(ValueError, match="delay must be at most the number of scores, got 9 and 2"):
        audit([0.1, 0.2], Fixed(eta=0.1), alpha=0.1, delay=9)


def test_windows_are_counted():
    found = audit([0.0, 1.0, 1.0, 0.0], Fixed(eta=0.5), alpha=0.5)
    missed = found.table["err"].to_numpy()
    assert found.windows(2).tolist() == [1 - missed[i : i + 2].mean() for i in range(3)]
    with pytest.raises(ValueError, match=r"W must lie in \[1, 4\], got 5"):
        found.windows(5)


@pytest.mark.parametrize(
    ("scores", "message"),
    [
        ([], "at least 1"),
        ([[1.0]], "one sequence"),
        ([0.1, np.nan], "got nan at step 2"),
        ([np.inf], "got inf at step 1"),
    ],
)
def test_bad_scores_are_named(scores, message):
    with pytest.raises(ValueError, match=message):
        audit(scores, Fixed(eta=0.1), alpha=0.1)


def test_an_environment_gives_scores_of_persistence():
    env = gymnasium.make("MountainCar-v0")
    seen: list[list[float]] = []

    def target(obs):
        return float(obs[0])

    scores = environment_scores(env, target, policy=lambda _: 2, horizon=3, steps=50, seed=0)
    assert scores.shape == (50,)
    obs, _ = env.reset(seed=0)
    line = [float(obs[0])]
    while len(line) < 54:
        line.append(float(env.step(2)[0][0]))
    seen.append(line)
    np.testing.assert_allclose(scores, np.abs(np.array(line[3:53]) - np.array(line[:50])))


def test_random_actions_are_seeded():
    env = gymnasium.make("CartPole-v1")
    words = {"horizon": 2, "steps": 40, "seed": 3}
    first = environment_scores(env, lambda o: o[2], **words)
    assert first.tolist() == environment_scores(env, lambda o: o[2], **words).tolist()


def test_an_environment_that_gives_none_is_named():
    env = gymnasium.make("CartPole-v1")
    with pytest.raises(ValueError, match="horizon must be shorter than some episode, got 900"):
        environment_scores(env, lambda o: o[0], policy=lambda _: 0, horizon=900, steps=5, seed=0)
    with pytest.raises(ValueError, match="target and forecast must be finite"):
        environment_scores(env, lambda _: np.nan, horizon=1, steps=5, seed=0)
    with pytest.raises(ValueError, match="at least 1, got 0 and 5"):
        environment_scores(env, lambda o: o[0], horizon=0, steps=5, seed=0)


def test_the_command_tracks_a_file(tmp_path, capsys):
    path, out = tmp_path / "s.csv", tmp_path / "q.csv"
    path.write_text("0.1\n" * 90)
    words = ["track", str(path), "--rule", "fixed", "--eta", "0.05", "--out", str(out)]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "coverage         0.8" in said
    assert "bound            at most" in said
    assert out.read_text().splitlines()[0] == "t,score,q,err"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.csv"], "none.csv"),
        (["{good}", "--rule", "fixed"], "needs --eta"),
        (["{good}", "--eta", "0.1"], "goes with --rule fixed"),
        (["{good}", "--alpha", "2"], "alpha must"),
        (["{good}", "--delay", "0"], "delay must"),
        (["{good}", "--column", "x"], "no column 'x'"),
    ],
)
def test_the_command_refuses_by_name(tmp_path, capsys, words, message):
    good = tmp_path / "s.csv"
    good.write_text("0.1\n0.2\n")
    assert main(["track", *(word.format(good=good) for word in words)]) == 2
    assert message in capsys.readouterr().err


def test_the_command_takes_a_member_of_the_family(tmp_path, capsys):
    path = tmp_path / "scores.csv"
    path.write_text("\n".join(str(k % 7) for k in range(400)), encoding="utf-8")
    assert main(["track", str(path), "--method", "aci"]) == 0
    assert "at most 86 misses in 400 steps" in capsys.readouterr().out
    assert main(["track", str(path), "--method", "kt", "--scale", "5"]) == 0
    assert "promises no count of errors" in capsys.readouterr().out
    for words, message in ((["--method", "magic"], "must be one of"), (["--scale", "0"], "> 0")):
        assert main(["track", str(path), "--method", "kt", *words]) == 2
        assert message in capsys.readouterr().err
