"""The search is exhaustive, its decisions are the code's, and it finds what is wrong."""

import pytest

from cpl.experiments import published
from cpl.robot import search as module
from cpl.robot.search import FRESH, search


def test_nothing_moves_without_a_fresh_order_to_a_small_depth():
    found = search(6)
    assert found.states > 20_000
    assert found.settled <= 2
    none = search(8, faults=0)
    assert none.settled <= 2


def test_to_the_published_depth_the_robot_is_at_rest_within_the_bound():
    table = published("robot_search").table
    assert table["faults"].tolist() == [0, 1]
    assert (table["depth"] >= 16).all()
    assert (table["settled"] * module.TURN_S <= 0.3).all()


def test_a_process_that_nobody_replaces_is_found(monkeypatch):
    """Without a second that acts, a hung watchdog leaves a robot that walks."""
    monkeypatch.setattr(module, "_stand_by", lambda state: state)
    assert search(10).settled >= 4


def test_the_search_asks_the_functions_that_run(monkeypatch):
    """Orders that were as old as their arrival would lead elsewhere."""
    real, sound = module.take, search(6).states
    monkeypatch.setattr(
        module,
        "take",
        lambda state, order, now, *rest: real(
            state, module.Order(**{**vars(order), "heard_s": now}), now, *rest
        ),
    )
    module._watchdog.cache_clear()
    broken = search(6).states
    module._watchdog.cache_clear()
    assert broken != sound


@pytest.mark.parametrize("faults", [0, 1])
def test_a_robot_that_moves_all_along_moves_on_fresh_orders(faults):
    assert search(1, faults).oldest <= FRESH
