"""A forecaster of drift: what it learns, what is kept apart, what is counted."""

import numpy as np
import pandas as pd
import pytest

from cpl.forecast.drift import FEATURES, DriftForecaster, Met, answers, halves, meet


def series(n=600, seed=0, scale=1.0):
    rng = np.random.default_rng(seed)
    table = pd.DataFrame(rng.uniform(size=(n, 3)), columns=list(FEATURES))
    noise = rng.uniform(0.8, 1.2, size=n)
    return table.assign(t_s=0.1 * np.arange(n), drift_m=scale * (0.05 + table["speed_mps"]) * noise)


def test_half_of_the_outcomes_in_training_are_above_one_half():
    told = series()
    outcome = DriftForecaster.fit(told).outcome(told)
    assert np.mean(outcome > 0.5) == pytest.approx(0.5, abs=0.01)
    assert ((outcome >= 0) & (outcome < 1)).all()


def test_the_forecast_follows_what_the_drift_depends_on():
    told, other = series(seed=0), series(seed=1)
    found = DriftForecaster.fit(told)
    assert np.corrcoef(found.forecast(other), found.outcome(other))[0, 1] > 0.85
    assert found.weights[0] > 5 * abs(found.weights[1])
    far = other.assign(speed_mps=1e6)
    assert (found.forecast(far) == 1).all()  # an outcome is at most one, and so is a forecast


def test_nothing_of_one_half_is_in_the_other():
    first, second = halves(series(), horizon_s=1.0)
    assert second["t_s"].iloc[0] - first["t_s"].iloc[-1] > 2.0


def test_on_its_own_kind_both_margins_cover_and_on_another_scale_only_the_tracker_does():
    span = {"alpha": 0.2, "c": 0.1, "delay": 10, "W": 40}
    first, second = halves(series(3000), horizon_s=1.0)
    same = meet(first, second, **span)
    other = meet(first, second.assign(drift_m=30 * second["drift_m"]), **span)
    for found in (same, other):
        assert 1 - found.steps["err"].mean() == pytest.approx(0.8, abs=0.04)
        assert (found.windows["coverage"] >= found.windows["guaranteed"] - 1e-9).all()
        assert len(found.windows) == len(second) - 40 + 1
    assert 1 - same.steps["err_frozen"].mean() == pytest.approx(0.8, abs=0.05)
    assert 1 - other.steps["err_frozen"].mean() < 0.3


def test_what_is_counted_by_hand():
    err = np.array([1, 1, 0, 0] * 25, dtype=bool)  # a miss two steps after a miss: never
    steps = pd.DataFrame(
        {
            "t_s": 0.1 * np.arange(100),
            "err": err,
            "err_frozen": np.arange(100) < 50,
            "speed_mps": np.arange(100.0),
            "turn_radps": np.zeros(100),
            "drift_m": -np.arange(100.0),
        }
    )
    windows = pd.DataFrame({"coverage": [0.5, 0.9, 0.7, 0.8], "guaranteed": [0.0, 0.1, 0.75, 0.0]})
    told = answers(
        Met(steps=steps, windows=windows, frozen=0.1, delay=2), alpha=0.2, seed=0, resamples=20
    ).set_index("number")
    value = told["value"]
    assert value[["coverage", "coverage_frozen"]].tolist() == [0.5, 0.5]
    assert value["bursts"] == 0.0
    assert value["bursts_frozen"] == pytest.approx((48 / 50) / 0.5)
    assert value["with_speed"] == pytest.approx(-1.0)
    assert np.isnan(value["with_turning"])  # it never turned, so nothing can go with it
    assert value["windows_below"] == 0.5
    assert value["windows_promised_nothing"] == 0.5
    assert value["windows_broken"] == 0.25
    assert told["n"].tolist() == [100] * 6 + [4] * 3


def test_too_little_is_refused():
    with pytest.raises(ValueError, match="ten rows or more"):
        DriftForecaster.fit(series(5))
    with pytest.raises(ValueError, match="ten rows or more"):
        DriftForecaster.fit(series().assign(drift_m=0.0))
