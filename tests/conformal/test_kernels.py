"""The kernels as plain Python: what is compiled is what is written, and every line is reached."""

import numpy as np
import pytest

from cpl.conformal import Fixed, _kernels, rules, sequence, track, track_exact, track_many

COMPILED = ["decay", "follow", "follow_counts", "follow_lanes", "follow_pi",
            "rolling_max"]  # fmt: skip


@pytest.fixture
def scores():
    return np.random.default_rng(5).normal(size=(6, 60)).round(2)


def test_no_kernel_is_forgotten():
    assert sorted(COMPILED) == sorted(set(_kernels.__all__) - {"LANES"})


@pytest.mark.parametrize("delay", [1, 3])
def test_plain_and_compiled_give_the_same_bits(any_rule, delay, scores, monkeypatch):
    how = {"alpha": 0.2, "delay": delay, "q0": 0.5}
    compiled = track_many(scores, any_rule, **how), track(scores[0], any_rule, **how)
    for name in COMPILED:
        monkeypatch.setattr(_kernels, name, getattr(_kernels, name).py_func)
    plain = track_many(scores, any_rule, **how), track(scores[0], any_rule, **how)
    assert rules._kernels is sequence._kernels is _kernels
    for a, b in zip(compiled, plain, strict=True):
        assert a.q.tobytes() == b.q.tobytes()
        assert a.err.tobytes() == b.err.tobytes()


def test_plain_and_compiled_counts_agree(scores, monkeypatch):
    compiled = track_exact(scores[0], Fixed(eta=0.3), alpha=0.1, delay=2)
    monkeypatch.setattr(_kernels, "follow_counts", _kernels.follow_counts.py_func)
    plain = track_exact(scores[0], Fixed(eta=0.3), alpha=0.1, delay=2)
    assert compiled.q.tobytes() == plain.q.tobytes()
    assert compiled.misses.tolist() == plain.misses.tolist()
