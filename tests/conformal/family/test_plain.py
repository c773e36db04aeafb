"""The members' updates as plain Python: what is compiled is what is written, line by line."""

import sys

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from cpl.conformal import _window
from cpl.conformal.state import Running
from tests.conformal.conftest import STATE_RULES

SCORES = np.r_[
    np.random.default_rng(3).uniform(0, 1, 60), np.random.default_rng(4).normal(2, 1, 60)
].round(3)


@pytest.fixture
def plain(monkeypatch):
    """Let the functions of a module call each other as Python."""

    def plain_(module):
        for name, value in list(vars(module).items()):
            if isinstance(value, Dispatcher):
                monkeypatch.setattr(module, name, value.py_func)

    return plain_


@pytest.mark.parametrize("rule", STATE_RULES, ids=repr)
@pytest.mark.filterwarnings("ignore:overflow|divide by zero|invalid value:RuntimeWarning")
def test_plain_and_compiled_updates_give_the_same_states(rule, plain):
    plain(_window)
    plain(sys.modules[type(rule).__module__])
    update = type(rule).update.__wrapped__
    alpha, numbers = 0.2, rule.numbers(0.2)
    running, state = Running(rule, alpha, 0.5), rule.begin(alpha, 0.5)
    for score in SCORES:
        met = running.q
        running.take(float(score), met)
        update(state, numbers, float(score), met)
        np.testing.assert_allclose(state, running.state, rtol=1e-12, atol=1e-300)
