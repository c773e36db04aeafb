import numpy as np
import pytest

from cpl.rng import stream
from cpl.stats import Curve, hierarchical_weights, sums
from cpl.stats.matched import Ratio, along, beside_curve


def study(rng, gain=0.0, groups=5, units=60, episodes=10):
    """A curve of five constants and a method on it, or below it by a known gain."""
    speeds = np.array([22.0, 24.0, 26.0, 28.0, 30.0])
    rates = np.array([0.02, 0.05, 0.1, 0.2, 0.4])
    shape = (groups, units)
    seconds = np.full((*shape, 5), 40.0 * episodes)
    crashes = rng.binomial(episodes, rates, (*shape, 5))
    metres = seconds * (speeds + rng.normal(0, 0.1, (*shape, 5)))
    own = rng.binomial(episodes, 0.15 - gain, shape)
    own_metres = seconds[..., 0] * (27.0 + rng.normal(0, 0.1, shape))
    full = np.full(shape, float(episodes))
    return (
        Ratio(over=own, under=full),
        Ratio(over=own_metres, under=seconds[..., 0]),
        Ratio(over=crashes, under=np.repeat(full[..., None], 5, axis=2)),
        Ratio(over=metres, under=seconds),
    )


def test_the_interval_covers_the_truth_about_as_often_as_it_says():
    inside = 0
    for k in range(60):
        rng = stream(k, "matched")
        weights = hierarchical_weights(5, 60, rng, resamples=150)
        found = beside_curve(*study(rng, gain=0.05), weights)
        inside += found.low <= -0.05 <= found.high
    assert inside >= 53


def test_mixtures_are_never_worse_rivals():
    rng = stream(1, "matched")
    data = study(rng, gain=0.05)
    weights = hierarchical_weights(5, 60, rng, resamples=50)
    line, hull = (beside_curve(*data, weights, mixtures=m) for m in (False, True))
    assert hull.value >= line.value - 1e-12


def test_the_hull_cuts_a_dent():
    ones, wide = np.ones((1, 2)), np.ones((1, 2, 3))
    weights = hierarchical_weights(1, 2, stream(0, "matched"), resamples=4)
    curve = Ratio(over=wide * [0.0, 0.9, 0.4], under=wide), Ratio(over=wide * [0, 1, 2], under=wide)
    own = Ratio(over=0.3 * ones, under=ones), Ratio(over=ones, under=ones)
    assert beside_curve(*own, *curve, weights).value == pytest.approx(0.3 - 0.9)
    assert beside_curve(*own, *curve, weights, mixtures=True).value == pytest.approx(0.3 - 0.2)


def test_all_points_of_a_curve_are_compared_as_each_of_them_is():
    rng = stream(2, "matched")
    _, _, crashes, metres = study(rng)
    _, _, others, other_metres = study(rng)
    weights = hierarchical_weights(5, 60, rng, resamples=150)

    def curve(y, x):
        read = []
        for part in (y, x):
            (over, drawn_over), (under, drawn_under) = (
                sums(values, weights) for values in (part.over, part.under)
            )
            read += [over / under, drawn_over / drawn_under]
        return Curve(y=read[0], y_drawn=read[1], x=read[2], x_drawn=read[3])

    found = along(curve(crashes, metres), curve(others, other_metres), groups=5)
    for k, gap in enumerate(found):
        own = [
            Ratio(over=part.over[..., k], under=part.under[..., k]) for part in (crashes, metres)
        ]
        alone = beside_curve(*own, others, other_metres, weights)
        if gap is not None:
            assert (gap.value, gap.low, gap.high) == pytest.approx(
                (alone.value, alone.low, alone.high)
            )
    assert sum(gap is not None for gap in found) >= 3
