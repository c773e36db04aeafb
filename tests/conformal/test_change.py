"""Alarms: what public code says of the same bets, and what is promised while nothing changes."""

import json
from pathlib import Path

import numpy as np
import pytest

from cpl.conformal.change import alarms, bets_on_errors, bets_on_ranks, p_values

GOLDEN = json.loads((Path(__file__).parent / "family" / "golden.json").read_text("utf-8"))["change"]


def test_the_statistics_are_those_of_online_cp():
    found = alarms(GOLDEN["factors"], level=20.0)
    np.testing.assert_allclose(found.ville, GOLDEN["ville"], rtol=1e-9)
    np.testing.assert_allclose(found.shiryaev_roberts, GOLDEN["shiryaev_roberts"], rtol=1e-9)
    # Theirs restarts at this step as well, so that it is never below 1.
    np.testing.assert_allclose(np.maximum(found.cusum, 1.0), GOLDEN["cusum"], rtol=1e-9)


def test_the_mean_factor_is_one_while_nothing_changes():
    """Exactly, over a fine grid of the next rank or error, whatever came before."""
    past = np.random.default_rng(0).random(30)
    grid = (np.arange(2000) + 0.5) / 2000
    factors = [bets_on_ranks(np.r_[past, p])[-1] for p in grid]
    assert np.mean(factors) == pytest.approx(1.0, abs=1e-9)
    errors = past < 0.3
    hit, miss = (bets_on_errors(np.r_[errors, e], alpha=0.2)[-1] for e in (0, 1))
    assert 0.8 * hit + 0.2 * miss == pytest.approx(1.0, abs=1e-12)


def test_false_alarms_are_as_rare_as_promised():
    rng = np.random.default_rng(1)
    ever, waits = 0, []
    for _ in range(200):
        found = alarms(bets_on_ranks(p_values(rng.normal(size=300))), level=20.0)
        ever += found.first["ville"] is not None
        # An alarm that did not come in 300 steps counts as 300: the mean can only be larger.
        waits.append([found.first[name] or 300 for name in ("cusum", "shiryaev_roberts")])
    assert ever / 200 <= 0.05 + 0.03
    assert np.mean(waits, axis=0).min() >= 20.0


def test_a_change_is_found_and_late_ones_sooner_by_those_that_forget():
    rng = np.random.default_rng(2)
    scores = np.r_[rng.random(400), 3 * rng.random(200)]
    found = alarms(bets_on_ranks(p_values(scores)), level=5000.0)
    assert 400 < found.first["shiryaev_roberts"] <= found.first["cusum"] < 520
    assert found.first["ville"] is None or found.first["ville"] >= found.first["cusum"]
    frozen = scores > np.quantile(scores[:200], 0.9)
    errors = alarms(bets_on_errors(frozen[200:], alpha=0.1), level=100.0)
    assert 200 < errors.first["cusum"] < 230


def test_nothing_overflows_and_nothing_is_swallowed():
    found = alarms(np.full(5000, 4.0), level=10.0)
    assert np.isfinite(found.shiryaev_roberts).all()
    assert alarms([], level=2.0).first == dict.fromkeys(("ville", "cusum", "shiryaev_roberts"))
    for wrong, message in (
        (lambda: alarms([-1.0], level=2.0), "factors must be >= 0"),
        (lambda: alarms([1.0], level=1.0), "level must be > 1, got 1.0"),
        (lambda: bets_on_ranks([2.0]), "p must lie"),
        (lambda: bets_on_errors([0], alpha=1.0), "alpha must"),
    ):
        with pytest.raises(ValueError, match=message):
            wrong()
