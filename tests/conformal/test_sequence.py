"""Whole sequences: hand tables, the authors' numbers, shapes and types, episodes, refusals."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cpl.conformal import (
    PI,
    Fixed,
    RunningMax,
    TrailingRange,
    fed_back,
    step_sizes,
    track,
    track_episodes,
    track_many,
)

GOLDEN = json.loads((Path(__file__).parent / "pid_golden.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("delay", "q", "err"),
    [
        (1, [0.0, 0.75, 1.5, 1.25, 1.0], [1, 1, 0, 0, 1]),
        (2, [0.0, 0.0, 0.75, 1.5, 2.25], [1, 1, 1, 0, 0]),
        (3, [0.0, 0.0, 0.0, 0.75, 1.5], [1, 1, 1, 1, 0]),
        (9, [0.0] * 5, [1, 1, 1, 1, 1]),
        (10**30, [0.0] * 5, [1, 1, 1, 1, 1]),
    ],
)
def test_by_hand(delay, q, err):
    done = track([2.0, 2.0, 1.5, 1.0, 1.1], Fixed(eta=1.0), alpha=0.25, delay=delay)
    assert done.q.tolist() == q
    assert done.err.tolist() == [bool(e) for e in err]


@pytest.mark.parametrize("case", GOLDEN["cases"], ids=lambda c: f"{c['scores']}-{c['K_I']}")
def test_the_authors_public_code_gives_the_same_numbers(case):
    """Their thresholds, frozen in pid_golden.json (its ``provenance`` says how)."""
    scores = np.array(GOLDEN["scores"][case["scores"]])
    expected = np.array([float(value) for value in case["q"]])
    base = (
        TrailingRange(lr=case["lr"], window=case["window"])
        if case["proportional"]
        else Fixed(eta=case["lr"])
    )
    rule = PI(base, K_I=case["K_I"], C_sat=case["C_sat"])
    q, err = track(scores, rule, alpha=case["alpha"], delay=case["ahead"])
    # Their logarithm and tangent are numpy's, ours the C library's: one unit in the last place.
    np.testing.assert_allclose(q, expected, rtol=1e-13, atol=1e-15)
    np.testing.assert_array_equal(err, scores > expected)
    if case["K_I"] == 0:
        np.testing.assert_array_equal(q, expected)
        np.testing.assert_array_equal(track(scores, base, alpha=case["alpha"]).q, expected)


def test_the_golden_numbers_have_infinite_ones_among_them():
    assert any("inf" in case["q"] for case in GOLDEN["cases"])


@pytest.mark.parametrize("dtype", ["f2", "f4", ">f8", "i1", "u2", "i8"])
def test_narrow_and_foreign_numbers_are_converted(dtype):
    scores = np.array([2, 0, 1, 3]).astype(dtype)
    q, _ = track(scores, Fixed(eta=1.0), alpha=0.25)
    assert q.dtype == np.float64
    assert q.tolist() == track([2.0, 0.0, 1.0, 3.0], Fixed(eta=1.0), alpha=0.25).q.tolist()


def test_strided_and_read_only_scores_are_read_and_never_written():
    scores = np.arange(20.0)
    scores.setflags(write=False)
    kept = scores.copy()
    q, _ = track(scores[::2], Fixed(eta=1.0), alpha=0.25)
    assert q.tolist() == track(scores[::2].tolist(), Fixed(eta=1.0), alpha=0.25).q.tolist()
    track(scores, RunningMax(c=0.1), alpha=0.25)
    np.testing.assert_array_equal(scores, kept)


def test_no_scores_are_no_thresholds(any_rule):
    q, err = track([], any_rule, alpha=0.1)
    assert (q.shape, err.shape, err.dtype) == ((0,), (0,), np.bool_)
    for shape in ((0, 5), (3, 0), (4, 0)):
        assert track_many(np.empty(shape), any_rule, alpha=0.1).q.shape == shape
    assert track_episodes([], any_rule, alpha=0.1, carry=True) == ()
    assert [t.q.size for t in track_episodes([[], [1.0]], any_rule, alpha=0.1, carry=True)] == [
        0,
        1,
    ]


BAD_SCORES = [
    ([1.0, float("nan")], r"scores must be finite, got scores\[1\] = nan"),
    ([float("-inf")], r"scores must be finite, got scores\[0\] = -inf"),
    ([0.5, 1.5], r"scores must lie in .*\(0\.0, 1\.0\), got scores\[1\] = 1\.5"),
    ([True, False], "scores must hold integers or floats .* got dtype bool"),
    ([1j], "dtype complex128"),
    (["1"], "dtype <U1"),
    ([None], "dtype object"),
    ([10**30], "dtype object"),
    (np.array(["2026-01-01"], dtype="M8[s]"), "dtype datetime64"),
    (np.ma.masked_array([1.0], mask=[True]), "scores must not be masked"),
    ([[1.0], [1.0, 2.0]], "scores must be a rectangular array of numbers"),
    (1.0, r"scores must have 1 dimension\(s\), got shape \(\)"),
    ([[1.0]], r"scores must have 1 dimension\(s\), got shape \(1, 1\)"),
]


@pytest.mark.parametrize(("scores", "message"), BAD_SCORES, ids=[m for _, m in BAD_SCORES])
def test_bad_scores_are_refused_by_name_and_value(scores, message):
    with pytest.raises(ValueError, match=message):
        track(scores, Fixed(eta=1.0), alpha=0.1, bounds=(0.0, 1.0))


def test_extended_precision_is_refused():
    if np.dtype(np.longdouble).itemsize > 8:
        with pytest.raises(ValueError, match="at most 64 bits"):
            track(np.ones(3, dtype=np.longdouble), Fixed(eta=1.0), alpha=0.1)


def test_many_and_episodes_name_the_place():
    with pytest.raises(ValueError, match=r"scores\[1, 0\] = nan"):
        track_many([[1.0], [float("nan")]], Fixed(eta=1.0), alpha=0.1)
    with pytest.raises(ValueError, match=r"scores must have 2 dimension\(s\), got shape \(2,\)"):
        track_many([1.0, 2.0], Fixed(eta=1.0), alpha=0.1)
    with pytest.raises(ValueError, match=r"episodes\[1\] must be finite, got episodes\[1\]\[0\]"):
        track_episodes([[1.0], [float("inf")]], Fixed(eta=1.0), alpha=0.1, carry=True)
    with pytest.raises(ValueError, match=r"lengths\[1\] must be >= 0, got -1"):
        fed_back([1, -1], delay=1)


@pytest.mark.parametrize(("name", "value"), [("alpha", 1.0), ("delay", 0), ("q0", np.nan)])
def test_settings_are_refused_by_name_and_value(name, value):
    arguments = {"alpha": 0.1} | {name: value}
    for call in (
        lambda **a: track([1.0], Fixed(eta=1.0), **a),
        lambda **a: track_many([[1.0]], Fixed(eta=1.0), **a),
        lambda **a: track_episodes([[1.0]], Fixed(eta=1.0), carry=False, **a),
    ):
        with pytest.raises(ValueError, match=f"^{name} must .*, got {value!r}"):
            call(**arguments)


@pytest.mark.parametrize("rows", [1, 4, 5])
@pytest.mark.parametrize("delay", [1, 2])
def test_a_step_out_of_range_is_refused(rows, delay):
    scores = np.full((rows, 3), 1e308)
    for rule in (RunningMax(c=10.0), PI(RunningMax(c=10.0), K_I=1.0, C_sat=1.0)):
        with pytest.raises(ValueError, match="beyond the range of floats, got 1e"):
            track_many(scores, rule, alpha=0.1, delay=delay)
        with pytest.raises(ValueError, match="beyond the range of floats, got 1e"):
            track(scores[0], rule, alpha=0.1, delay=delay)
    spread = [1e308, -1e308, 0.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="beyond the range of floats"):
        track(spread, TrailingRange(lr=1.0, window=2), alpha=0.1)


def test_settings_that_matter_have_no_default():
    with pytest.raises(TypeError, match="alpha"):
        track([1.0], Fixed(eta=1.0))
    with pytest.raises(TypeError, match="carry"):
        track_episodes([[1.0]], Fixed(eta=1.0), alpha=0.1)


def test_the_rule_never_sees_what_an_episode_left_under_way():
    """With delay 2 the greatest score comes last in its episode: no step is made of it."""
    first, second = track_episodes(
        [[1.0, 1.0, 100.0], [1.0, 1.0, 1.0]], RunningMax(c=1.0), alpha=0.25, carry=True, delay=2
    )
    assert first.q.tolist() == [0.0, 0.0, 0.75]
    assert second.q.tolist() == [1.5, 1.5, 1.25]


def test_fed_back_by_hand():
    assert fed_back([4, 0, 2, 1], delay=3).tolist() == [True, True, False, False] + [False] * 3
    assert fed_back([], delay=1).shape == (0,)
    assert fed_back([2], delay=1).all()


def test_step_sizes_are_the_callers_to_change():
    steps = step_sizes([1.0, 2.0], Fixed(eta=1.0))
    steps[0] = 5.0
    assert steps.tolist() == [5.0, 1.0]


def test_the_room_imports_numpy_and_numba_and_nothing_heavier():
    code = "import sys, cpl.conformal; print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"torch", "pandas", "matplotlib", "gymnasium", "highway_env", "z3"}
    assert not heavy & set(done.stdout.split())
