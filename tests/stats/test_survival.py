"""Durations that the clock cuts off, and the correction for many tests."""

import numpy as np
import pytest

from cpl.stats import holm, survival


def test_kaplan_meier_by_hand():
    curve = survival([1, 2, 2, 3, 5], [True, True, False, True, False])
    assert curve.time.tolist() == [1, 2, 3, 5]
    np.testing.assert_allclose(curve.alive, [0.8, 0.6, 0.3, 0.3])
    assert ((curve.low <= curve.alive) & (curve.alive <= curve.high)).all()


def test_no_crash_and_nothing_but_crashes():
    alive = survival([40.0, 40.0], [False, False])
    assert (alive.alive.tolist(), alive.low.tolist(), alive.high.tolist()) == ([1], [1], [1])
    assert survival([1.0, 2.0], [True, True]).alive.tolist() == [0.5, 0.0]


def test_the_exponential_law_is_found_in_spite_of_censoring():
    rng = np.random.default_rng(1)
    lasted, cut = rng.exponential(10.0, 20_000), rng.uniform(0, 30, 20_000)
    curve = survival(np.minimum(lasted, cut), lasted <= cut)
    early = curve.time < 20
    np.testing.assert_allclose(curve.alive[early], np.exp(-curve.time[early] / 10), atol=0.02)


@pytest.mark.parametrize(
    ("durations", "crashed"),
    [([], []), ([1.0], [True, False]), ([1.0], [1]), ([-1.0], [True]), ([np.nan], [True])],
)
def test_wrong_durations_are_refused(durations, crashed):
    with pytest.raises(ValueError, match="crashed"):
        survival(durations, np.array(crashed, dtype=bool) if not durations else crashed)


def test_holm_by_hand():
    np.testing.assert_allclose(holm([0.01, 0.02, 0.03, 0.5]), [0.04, 0.06, 0.06, 0.5])
    np.testing.assert_allclose(holm([0.5, 0.01]), [0.5, 0.02])
    assert holm([0.9, 0.8]).tolist() == [1.0, 1.0]
    with pytest.raises(ValueError, match="probabilities"):
        holm([1.1])


def test_holm_keeps_the_family_error():
    rng = np.random.default_rng(3)
    false_alarms = [(holm(rng.random(5)) < 0.05).any() for _ in range(4000)]
    assert 0.035 < np.mean(false_alarms) < 0.065
