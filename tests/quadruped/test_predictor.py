"""The network in numpy, its file, and how it is trained."""

import json

import numpy as np
import pytest

from cpl.quadruped.predictor import Predictor, load_predictor, save_predictor, unweighted
from cpl.quadruped.training import TrainingConfig, auc, train


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


def test_what_is_saved_is_loaded(tiny, tmp_path):
    about = {"seed": 3, "runs": 43}
    save_predictor(tiny, tmp_path / "net", about)
    loaded, said = load_predictor(tmp_path / "net")
    assert said == about
    for name in ("mean", "std", "w1", "b1", "w2", "b2"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(tiny, name))


def test_a_flipped_bit_is_refused(tiny, tmp_path):
    save_predictor(tiny, tmp_path / "net", {})
    file = tmp_path / "net.safetensors"
    damaged = bytearray(file.read_bytes())
    damaged[-1] ^= 1
    file.write_bytes(bytes(damaged))
    with pytest.raises(ValueError, match="SHA-256"):
        load_predictor(tmp_path / "net")


@pytest.mark.parametrize(
    ("text", "message"),
    [("{", "unusable"), ("{}", "unusable"), ("[]", "unusable"), ("\xff", "unusable")],
)
def test_a_damaged_sidecar_is_refused(tiny, tmp_path, text, message):
    save_predictor(tiny, tmp_path / "net", {})
    (tmp_path / "net.json").write_text(text, encoding="latin-1")
    with pytest.raises(ValueError, match=message):
        load_predictor(tmp_path / "net")


def test_other_features_are_refused(tiny, tmp_path):
    file = save_predictor(tiny, tmp_path / "net", {})
    sidecar = json.loads(file.read_text())
    sidecar["features"].reverse()
    file.write_text(json.dumps(sidecar))
    with pytest.raises(ValueError, match="its features are"):
        load_predictor(tmp_path / "net")


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
