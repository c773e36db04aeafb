"""Schedules keep the bounds that every schedule keeps, and the needs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.experiments.run.schedule import Piece, longest_path_s, makespan, one_after_another


@st.composite
def graphs(draw):
    """Pieces that need some of those before them."""
    count = draw(st.integers(1, 14))
    pieces = {}
    for name in range(count):
        needs = draw(st.lists(st.integers(0, name - 1), max_size=3)) if name else []
        seconds = draw(st.floats(0.1, 10.0))
        pieces[name] = Piece(seconds=seconds, needs=tuple(needs))
    return pieces


@settings(max_examples=150, deadline=None)
@given(graphs(), st.integers(1, 6), st.booleans())
def test_every_schedule_keeps_grahams_bounds(pieces, workers, longest_first):
    found = makespan(pieces, workers, longest_first=longest_first)
    work, chain = sum(p.seconds for p in pieces.values()), longest_path_s(pieces)
    assert found.seconds >= max(work / workers, chain) - 1e-9
    assert found.seconds <= work / workers + (1 - 1 / workers) * chain + 1e-9
    assert found.bound_s == pytest.approx(max(work / workers, chain))
    assert 0 < found.busy <= 1 + 1e-9


@settings(max_examples=60, deadline=None)
@given(graphs(), st.floats(0.0, 2.0))
def test_one_worker_does_all_the_work_and_unlimited_ones_the_longest_chain(pieces, driver_s):
    work = sum(p.seconds for p in pieces.values())
    assert makespan(pieces, 1).seconds == pytest.approx(work)
    assert makespan(pieces, len(pieces)).seconds == pytest.approx(longest_path_s(pieces))
    slowed = makespan(pieces, len(pieces), driver_s=driver_s)
    assert slowed.seconds >= driver_s * len(pieces) - 1e-9


def test_the_driver_limits_how_many_workers_help():
    pieces = {n: Piece(seconds=1.0) for n in range(1000)}
    assert makespan(pieces, 1000, driver_s=0.01).seconds == pytest.approx(11.0)
    assert makespan(pieces, 100, driver_s=0.01).seconds == pytest.approx(11.0, abs=0.2)
    assert makespan(pieces, 10, driver_s=0.01).seconds == pytest.approx(100.0, rel=0.02)


def test_longest_first_helps_where_order_matters():
    pieces = {n: Piece(seconds=1.0) for n in range(4)} | {"long": Piece(seconds=4.0)}
    assert makespan(pieces, 2).seconds == 4.0
    assert makespan(pieces, 2, longest_first=False).seconds == 6.0


def test_stages_in_turn_take_at_least_as_long_as_all_at_once():
    rng = np.random.default_rng(3)
    first = {("a", n): Piece(seconds=float(rng.uniform(1, 5))) for n in range(7)}
    second = {
        ("b", n): Piece(seconds=float(rng.uniform(1, 5)), needs=(("a", n),)) for n in range(7)
    }
    turn = one_after_another([first, second], 4)
    assert turn.seconds >= makespan({**first, **second}, 4).seconds
    assert turn.work_s == pytest.approx(sum(p.seconds for p in (*first.values(), *second.values())))


@pytest.mark.parametrize(
    ("pieces", "words", "named"),
    [
        ({}, {"workers": 0}, "workers must be >= 1"),
        ({}, {"workers": 1, "driver_s": -1.0}, "driver_s >= 0"),
        ({"a": Piece(seconds=1.0, needs=("b",))}, {"workers": 1}, "needs must name pieces"),
        (
            {"a": Piece(seconds=1.0, needs=("b",)), "b": Piece(seconds=1.0, needs=("a",))},
            {"workers": 1},
            "circles",
        ),
    ],
)
def test_what_makes_no_sense_is_named(pieces, words, named):
    with pytest.raises(ValueError, match=named):
        makespan(pieces, **words)
