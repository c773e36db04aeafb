import numpy as np
import pytest

from cpl.rng import stream
from cpl.stats.frozen import frozen_coverage


def log(rng, blocks=200, size=30, change=None):
    """Scores of blocks that share a level, so that they are no independent draws."""
    level = np.repeat(rng.gamma(20, 0.05, blocks), size)
    scores = level * np.abs(rng.normal(size=blocks * size))
    if change is not None:
        scores[change * size :] *= 1.5
    return scores, np.repeat(np.arange(blocks), size)


def test_a_log_that_stays_the_same_rarely_raises_a_flag():
    flags = 0
    for k in range(200):
        found = frozen_coverage(*log(stream(k, "frozen")), alpha=0.1, calibration=60, windows=5)
        flags += found.can_pay
    assert flags <= 20  # 5 % of 200 are 10; the intervals hold together


def test_a_log_that_changes_does_where_it_changes():
    scores, blocks = log(stream(0, "frozen"), change=140)
    found = frozen_coverage(scores, blocks, alpha=0.1, calibration=60, windows=7)
    assert found.can_pay
    assert found.below[found.first >= 140].all()
    assert not found.below[found.first < 120].any()
    calm = frozen_coverage(scores[::-1], blocks, alpha=0.1, calibration=50, windows=5)
    assert calm.above.any()


def test_the_margin_is_the_conformal_quantile_of_the_first_blocks():
    scores, blocks = np.arange(40.0), np.repeat(np.arange(8), 5)
    found = frozen_coverage(scores, blocks, alpha=0.1, calibration=4, windows=1)
    assert found.margin == 18.0  # the 19th of 20
    assert found.coverage.tolist() == [0.0]
    assert found.nominal == pytest.approx(0.9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"calibration": 1}, "calibration must be >= 2"),
        ({"windows": 9}, "9 windows"),
        ({"alpha": 0.001}, "alpha must be at least"),
        ({"blocks": np.tile([0, 1], 40)}, "one piece"),
        ({"scores": np.full(80, np.nan)}, "scores must be finite"),
    ],
)
def test_what_cannot_be_judged_is_refused(change, message):
    settings = {
        "scores": np.arange(80.0),
        "blocks": np.repeat(np.arange(8), 10),
        "alpha": 0.1,
        "calibration": 4,
        "windows": 2,
    }
    with pytest.raises(ValueError, match=message):
        frozen_coverage(**{**settings, **change})
