"""The permutation test by hand, against SciPy, and valid under the null hypothesis."""

import numpy as np
import pytest
from scipy import stats as sp

from cpl.quadruped import sign_flip


@pytest.mark.parametrize(
    ("differences", "p"),
    [([1.0], 1.0), ([1, 2, 3], 0.25), ([1, -1], 1.0), ([0, 0], 1.0), ([1, 1, -1], 1.0)],
)
def test_by_hand(differences, p):
    assert sign_flip(differences).p == p


def test_three_repeats_can_show_nothing_and_nine_can():
    assert sign_flip([0.1, 0.2, 0.3]).least_p == 0.25
    assert sign_flip(np.ones(9)).p == sign_flip(np.ones(9)).least_p == 2 / 512


def test_it_agrees_with_scipy():
    d = np.random.default_rng(0).normal(0.4, 1, size=8)
    expected = sp.permutation_test(
        (d,), np.mean, permutation_type="samples", vectorized=True, n_resamples=np.inf
    )
    assert sign_flip(d).p == pytest.approx(expected.pvalue)


def test_it_is_valid_under_the_null():
    rng = np.random.default_rng(1)
    p = np.array([sign_flip(rng.standard_t(2, size=7)).p for _ in range(2000)])
    for level in (0.05, 0.1, 0.5):
        assert (p <= level).mean() <= level + 3 * np.sqrt(level * (1 - level) / 2000)


def test_many_pairs_are_drawn_and_agree_with_the_normal_law():
    d = np.random.default_rng(2).normal(0.25, 1, size=60)
    drawn = sign_flip(d, np.random.default_rng(3))
    z = d.sum() / np.sqrt((d**2).sum())
    assert not drawn.exact
    assert drawn.p == pytest.approx(2 * sp.norm.sf(abs(z)), rel=0.25)


def test_bad_arguments_are_named():
    with pytest.raises(ValueError, match="differences must be a vector"):
        sign_flip([])
    with pytest.raises(ValueError, match="differences must be a vector"):
        sign_flip([np.nan])
    with pytest.raises(ValueError, match="rng must be given above 20 pairs"):
        sign_flip(np.ones(21))
