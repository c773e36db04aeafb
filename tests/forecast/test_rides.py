"""Scores and thresholds along rides, by hand."""

import pandas as pd
import pytest

from cpl.conformal import Fixed
from cpl.forecast.rides import score_rides, track_rides


@pytest.fixture
def steps():
    """Two rides; the second is too short for a forecast two steps ahead."""
    rows = [
        ("a", 0, 0.1),
        ("a", 1, 0.2),
        ("a", 2, 0.4),
        ("a", 3, 0.1),
        ("b", 0, 0.9),
        ("b", 1, 0.8),
    ]
    return pd.DataFrame(rows, columns=["ride", "step", "l_tilde"])


def test_a_score_stands_where_its_forecast_was_made(steps):
    scored = score_rides(steps, by=["ride"], horizon=2)
    assert scored["ride"].tolist() == ["a", "a"]
    assert scored["step"].tolist() == [0, 1]
    assert scored["l_hat"].tolist() == [0.1, 0.2]
    assert scored["l_tilde"].tolist() == [0.4, 0.1]
    assert scored["score"].tolist() == pytest.approx([0.3, 0.1])


def test_no_forecast_is_checked_across_two_rides(steps):
    scored = score_rides(steps, by=["ride"], horizon=1)
    assert scored["ride"].tolist() == ["a", "a", "a", "b"]
    assert scored["score"].tolist() == pytest.approx([0.1, 0.2, 0.3, 0.1])


@pytest.mark.parametrize(("carry", "last"), [(True, 0.15), (False, 0.0)])
def test_the_threshold_is_carried_over_or_not(steps, carry, last):
    scored = score_rides(steps, by=["ride"], horizon=1)
    tracked = track_rides(scored, Fixed(eta=0.1), by=["ride"], alpha=0.5, delay=1, carry=carry)
    assert tracked["q"].tolist() == pytest.approx([0.0, 0.05, 0.1, last])
    assert tracked["err"].tolist() == [True, True, True, not carry]


@pytest.mark.parametrize("horizon", [0, 4])
def test_refuses_a_horizon_that_checks_nothing(steps, horizon):
    with pytest.raises(ValueError, match="horizon"):
        score_rides(steps, by=["ride"], horizon=horizon)
