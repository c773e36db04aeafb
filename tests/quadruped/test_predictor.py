"""The network in numpy, its file, and how it is trained."""

import numpy as np
import pytest

from cpl.quadruped.features import FEATURES
from cpl.quadruped.predictor import Predictor, decode_predictor, encode_predictor, unweighted
from cpl.quadruped.training import TrainingConfig, auc, train
from cpl.store import DamagedModelError, encode_model


@pytest.fixture
def tiny():
    """Return a network with two units: logit = relu(x0) - relu(-x0) - 1 = x0 - 1."""
    w1 = np.zeros((2, 47))
    w1[0, 0], w1[1, 0] = 1.0, -1.0
    return Predictor(
        mean=np.zeros(47), std=np.ones(47), w1=w1, b1=np.zeros(2), w2=np.array([1.0, -1.0]), b2=-1.0
    )


def test_the_network_by_hand(tiny):
    x = np.zeros((3, 47))
    x[:, 0] = [1.0, 1.0 + np.log(3), -1e6]
    np.testing.assert_allclose(tiny(x), [0.5, 0.75, 0.0], atol=1e-12)


def test_what_is_encoded_is_decoded_to_the_last_bit(tiny):
    about = {"seed": 3, "runs": 43}
    content = encode_predictor(tiny, about)
    decoded, said = decode_predictor(content)
    assert (said, encode_predictor(decoded, about)) == (about, content)
    for name in ("mean", "std", "w1", "b1", "w2", "b2"):
        np.testing.assert_array_equal(getattr(decoded, name), getattr(tiny, name))


def test_a_flipped_bit_is_refused(tiny):
    damaged = bytearray(encode_predictor(tiny, {}))
    damaged[-1] ^= 1
    with pytest.raises(DamagedModelError, match="digest"):
        decode_predictor(bytes(damaged))


@pytest.mark.parametrize(
    ("arrays", "config", "message"),
    [
        ({"w1": np.ones(2)}, {"features": [], "about": {}}, "features must be"),
        ({"w1": np.ones(2)}, {"features": list(FEATURES), "about": {}}, "arrays must be"),
        ({"w1": np.ones(2)}, {}, "features must be"),
    ],
)
def test_another_model_is_refused(arrays, config, message):
    with pytest.raises(DamagedModelError, match=message):
        decode_predictor(encode_model(arrays, config))


def test_a_model_with_shapes_of_another_network_is_refused(tiny):
    arrays = {name: getattr(tiny, name) for name in ("mean", "std", "w1", "b1", "w2", "b2")}
    content = encode_model(arrays | {"b1": np.zeros(3)}, {"features": list(FEATURES), "about": {}})
    with pytest.raises(DamagedModelError, match="b1 must have shape"):
        decode_predictor(content)


def test_wrong_shapes_are_refused(tiny):
    with pytest.raises(ValueError, match=r"b1 must have shape \(2,\), not \(3,\)"):
        Predictor(mean=tiny.mean, std=tiny.std, w1=tiny.w1, b1=np.zeros(3), w2=tiny.w2, b2=tiny.b2)


@pytest.mark.parametrize("truth", [0.05, 0.444, 0.9])
def test_the_weight_is_undone(truth):
    """The minimiser of the weighted loss at a true probability p is w p / (w p + 1 - p)."""
    l_hat = 5 * truth / (5 * truth + 1 - truth)
    assert unweighted(l_hat, 5.0) == pytest.approx(truth)


def test_unweighted_names_what_is_wrong():
    with pytest.raises(ValueError, match=r"l_hat .* not 1.5"):
        unweighted(1.5, 5.0)
    with pytest.raises(ValueError, match=r"weight .* not 0"):
        unweighted(0.5, 0)


def rows(seed, n=400):
    """Return rows whose label is decided by the first feature, with noise."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(n, 47))
    return x, (x[:, 0] + 0.3 * rng.normal(size=n) > 1.0).astype(float)


def test_training_learns_and_is_deterministic():
    config = TrainingConfig(epochs=30, units=16, learning_rate=1e-2)
    runs = [rows(0), rows(1)]
    net = train(runs, config, seed=0)
    x, y = rows(2)
    assert auc(net(x), y) > 0.9
    np.testing.assert_array_equal(net.w1, train(runs, config, seed=0).w1)
    assert not np.array_equal(net.w1, train(runs, config, seed=1).w1)


def test_the_positive_weight_lifts_the_output():
    x = rows(0)[0] * 0  # nothing to learn but the base rate
    y = (np.random.default_rng(1).random(len(x)) < 0.2).astype(float)
    mean = [
        float(
            train(
                [(x, y)],
                TrainingConfig(positive_weight=w, units=8, epochs=60, learning_rate=1e-2),
                seed=0,
            )(x).mean()
        )
        for w in (1.0, 5.0)
    ]
    p = y.mean()
    np.testing.assert_allclose(mean, [p, 5 * p / (5 * p + 1 - p)], atol=0.05)


def test_training_needs_both_labels():
    x, y = rows(0)
    with pytest.raises(ValueError, match=r"not \[0.0\] alone"):
        train([(x, y * 0)], TrainingConfig(), seed=0)


def test_auc_by_hand():
    assert auc(np.array([0.0, 1.0]), np.array([1.0, 0.0])) == 0.0
    assert np.isnan(auc(np.array([0.5]), np.array([1.0])))
