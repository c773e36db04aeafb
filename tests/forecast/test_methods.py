"""Every method on networks small enough to do by hand, and the laws that all of them obey."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.forecast.errors import HistoryShapeError
from cpl.forecast.methods import (
    Certificates,
    Constant,
    Dropout,
    Ensemble,
    Heteroscedastic,
    Plain,
    calibrate,
    features,
)
from cpl.network import MLP


def network(seed=0, sizes=(6, 4, 8, 4, 1), output="sigmoid"):
    rng = np.random.default_rng(seed)
    pairs = list(pairwise(sizes))
    weights = tuple(rng.normal(size=pair).astype(np.float32) for pair in pairs)
    return MLP(weights, tuple(rng.normal(size=n).astype(np.float32) for _, n in pairs), output)


def certificates(net):
    rng = np.random.default_rng(3)
    weight, bias = rng.normal(size=(8, 3)), rng.normal(size=3)
    return Certificates(net, weight.astype(np.float32), bias.astype(np.float32))


MADE = {
    "plain": Plain(network()),
    "constant": Constant(network(), 0.2),
    "dropout": Dropout(network(), np.random.default_rng(1)),
    "ensemble": Ensemble([network(k) for k in range(5)]),
    "hau": Heteroscedastic(network(sizes=(6, 4, 8, 4, 2), output="linear")),
    "certificates": certificates(network()),
}
FLAT = np.random.default_rng(2).normal(size=(7, 6)).astype(np.float32)


@pytest.mark.parametrize("name", MADE)
def test_a_forecast_is_a_share_and_its_uncertainty_not_negative(name):
    l_hat, u = MADE[name](FLAT)
    assert l_hat.shape == (7,)
    assert l_hat.dtype == np.float32
    assert ((l_hat >= 0) & (l_hat <= 1)).all()
    if name == "plain":
        assert u is None
    else:
        assert u.shape == (7,)
        assert u.dtype == np.float32
        assert (u >= 0).all()


@pytest.mark.parametrize("name", MADE)
def test_a_history_of_another_shape_is_refused(name):
    for wrong in (FLAT[:, :5], FLAT[0], FLAT[None]):
        with pytest.raises(HistoryShapeError, match=r"flat must have shape \(n, 6\)"):
            MADE[name](wrong)


@pytest.mark.parametrize("name", ["dropout", "ensemble", "hau", "certificates"])
def test_the_scale_multiplies_the_uncertainty_only(name):
    made = MADE[name]
    fields = {key: getattr(made, key) for key in made.__dataclass_fields__}
    if name == "dropout":
        made = type(made)(**{**fields, "rng": np.random.default_rng(5)})
        fields["rng"] = np.random.default_rng(5)
    (l_hat, u), (again, scaled) = made(FLAT), type(made)(**{**fields, "scale": 3.0})(FLAT)
    np.testing.assert_array_equal(l_hat, again)
    np.testing.assert_allclose(scaled, 3 * u, rtol=1e-6)


def test_without_dropped_units_dropout_is_the_network():
    l_hat, u = Dropout(network(), np.random.default_rng(0), rate=0.0)(FLAT)
    np.testing.assert_allclose(l_hat, network()(FLAT)[:, 0], rtol=1e-5)
    np.testing.assert_allclose(u, 0, atol=1e-6)


def test_dropout_keeps_the_mean_of_a_linear_layer():
    # One hidden layer, linear output: dropping and scaling up is right on average.
    net = network(sizes=(6, 50, 1), output="linear")
    many = Dropout(net, np.random.default_rng(0), passes=4000)
    x = FLAT[:1]
    h = net.hidden(x)
    drawn = [many._pass(x)[0] for _ in range(4000)]
    logit = np.log(np.array(drawn) / (1 - np.array(drawn)))
    expected = float((h @ net.weights[-1] + net.biases[-1])[0, 0])
    spread = np.sqrt((0.1 / 0.9) * np.sum((h[0] * net.weights[-1][:, 0]) ** 2))
    assert abs(logit.mean() - expected) < 5 * spread / np.sqrt(4000)
    assert logit.std() == pytest.approx(spread, rel=0.1)


def test_the_ensemble_by_hand():
    def constant(value):
        bias = np.array([np.log(value / (1 - value))], np.float32)
        return MLP((np.zeros((2, 1), np.float32),), (bias,), "sigmoid")

    l_hat, u = Ensemble([constant(0.2), constant(0.4)])(np.zeros((1, 2), np.float32))
    assert l_hat[0] == pytest.approx(0.3)
    assert u[0] == pytest.approx(0.1)


def test_hau_by_hand():
    bias = np.array([0.0, 2 * np.log(0.25)], np.float32)  # f = 0, s = log of 0.25 squared
    net = MLP((np.zeros((2, 2), np.float32),), (bias,), "linear")
    l_hat, u = Heteroscedastic(net)(np.zeros((1, 2), np.float32))
    assert l_hat[0] == 0.5
    assert u[0] == pytest.approx(0.25)


def test_certificates_share_the_forecast_and_square_the_distance():
    net = network()
    l_hat, u = certificates(net)(FLAT)
    np.testing.assert_allclose(l_hat, net(FLAT)[:, 0], rtol=1e-5)
    own = certificates(net)
    phi = features(net, FLAT)
    assert phi.shape == (7, 8)
    np.testing.assert_allclose(u, np.mean((phi @ own.weight + own.bias) ** 2, 1), rtol=1e-5)


@given(st.integers(1, 200), st.sampled_from([0.05, 0.1, 0.25, 0.5]), st.integers(0, 2**32 - 1))
def test_calibration_covers_its_own_data(n, alpha, seed):
    rng = np.random.default_rng(seed)
    score, u = rng.random(n), rng.random(n) + 0.01
    scale = calibrate(score, u, alpha)
    if np.isfinite(scale):
        covered = score <= scale * u * (1 + 1e-12)
        assert covered.mean() >= 1 - alpha
        assert covered.sum() <= np.ceil((1 - alpha) * (n + 1) - 1e-9) + 1e-9


def test_calibration_of_too_little_is_infinite_and_of_nothing_refused():
    assert calibrate(np.ones(5), None, 0.1) == np.inf
    with pytest.raises(ValueError, match=r"got \(0,\)"):
        calibrate(np.empty(0), None, 0.1)
