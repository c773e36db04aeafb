"""All networks of a comparison from one set of rollouts, stored as one file and read back."""

from functools import partial

import numpy as np
import pytest

from cpl.forecast.errors import NoRolloutsError, WrongModelError
from cpl.forecast.methods import METHODS, Constant, Plain
from cpl.forecast.schedule import Schedule
from cpl.forecast.stored import (
    crash_classifier,
    forecaster,
    read_suite,
    scales,
    write_suite,
)
from cpl.forecast.suite import Settings, _folded, crash_labels, learn, split
from cpl.network import MLP, DamagedModelError, decode_networks, encode_networks
from cpl.rng import stream

SETTINGS = Settings(schedule=Schedule(epochs=2, batch=64), certificate_epochs=2)
DRAW = partial(stream, 0, "test")


@pytest.fixture(scope="module")
def parts(rollouts):
    return split(rollouts, DRAW("split"))


@pytest.fixture(scope="module")
def suite(rollouts, parts):
    return learn(rollouts, parts, SETTINGS, DRAW)


@pytest.fixture(scope="module")
def content(suite, rollouts, parts):
    found = scales(suite, rollouts, parts.calibration, SETTINGS, DRAW("c"), alpha=0.1)
    return write_suite(suite, found, SETTINGS, {"pair": 0})


def test_no_episode_serves_two_ends(rollouts, parts):
    total = parts.train.astype(int) + parts.validation + parts.calibration
    assert (total == 1).all()
    assert parts.validation.sum() == parts.calibration.sum() == 6
    with pytest.raises(ValueError, match=r"got 0\.5 of 60 episodes"):
        split(rollouts, DRAW("split"), held_out=0.5)


def test_the_networks_are_the_papers(suite):
    assert suite.networks["plain"].sizes == (125, 64, 128, 64, 1)
    assert suite.networks["plain"].parameter_count == 24_705
    names = {"plain", "dropout", "hau", "crash", *(f"ensemble{k}" for k in range(5))}
    assert suite.networks.keys() == names
    assert suite.networks["hau"].sizes[-1] == 2
    assert suite.arrays["certificates_weight"].shape == (128, 100)
    assert set(suite.curves) == names | {"certificates"}


def test_folding_takes_the_standardisation_into_the_first_layer():
    rng = np.random.default_rng(0)
    weights = tuple(rng.normal(size=s).astype(np.float32) for s in ((4, 3), (3, 1)))
    net = MLP(weights, (np.ones(3, np.float32), np.zeros(1, np.float32)), "sigmoid")
    center, scale = rng.normal(size=4).astype(np.float32), np.array([1, 0.1, 2, 0.5], np.float32)
    x = rng.normal(size=(9, 4)).astype(np.float32)
    folded = _folded(net, center, scale)
    np.testing.assert_allclose(folded(x), net((x - center) / scale), atol=1e-5)


def test_crash_labels_count_to_the_crash_and_leave_the_unknown_out(rollouts):
    places, crash = crash_labels(rollouts, length=5, horizon=3)
    seen = dict(zip(places.tolist(), crash.tolist(), strict=True))
    for e in range(len(rollouts)):
        last = int(rollouts.steps[e])
        for t in range(rollouts.obs.shape[1]):
            got = seen.get(e * rollouts.obs.shape[1] + t)
            if t < 4 or t > last or (rollouts.crashed[e] and t == last):
                assert got is None
            elif rollouts.crashed[e]:
                assert got is (last - t <= 3)
            else:
                assert got is (False if t + 3 <= last else None)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("calibrated", [False, True])
def test_a_stored_suite_forecasts_as_it_did(content, suite, rollouts, method, calibrated):
    model = read_suite(content, length=5, horizon=3)
    flat = rollouts.histories(5)[rollouts.moments(length=5, horizon=3) - 4]
    made = forecaster(model, method, calibrated=calibrated, rng=DRAW("f"))
    l_hat, u = made(flat)
    assert np.isfinite(l_hat).all()
    if method in ("conformal", "none"):
        np.testing.assert_array_equal(l_hat, suite.networks["plain"](flat)[:, 0])
        assert isinstance(made, Constant if calibrated and method == "none" else Plain)
    if u is not None and calibrated:
        assert (u > 0).mean() > 0.9
    assert crash_classifier(model).sizes[-1] == 1


def test_calibrated_uncertainties_cover_the_calibration_data(content, rollouts, parts):
    model = read_suite(content, length=5, horizon=3)
    places = rollouts.moments(length=5, horizon=3, episodes=parts.calibration)
    truth = rollouts.l_tilde.ravel()[places + 3]
    for method in ("none", "ensemble", "hau", "certificates"):
        l_hat, u = forecaster(model, method, calibrated=True, rng=DRAW("f"))(
            rollouts.histories(5)[places - 4]
        )
        assert np.mean(np.abs(truth - l_hat) <= u * (1 + 1e-5)) >= 0.9


def test_wrong_and_damaged_models_are_named(content):
    with pytest.raises(WrongModelError, match="must have horizon 2, got 3"):
        read_suite(content, length=5, horizon=2)
    with pytest.raises(DamagedModelError):
        read_suite(content[:-7], length=5, horizon=3)
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 4
    with pytest.raises(DamagedModelError):
        read_suite(bytes(flipped), length=5, horizon=3)
    model = decode_networks(content)
    networks = {name: net for name, net in model.networks.items() if name != "hau"}
    other = encode_networks(networks, model.config, model.arrays)
    with pytest.raises(WrongModelError, match="missing \\['hau'\\]"):
        read_suite(other, length=5, horizon=3)
    whole = read_suite(content, length=5, horizon=3)
    whole.config["scales"]["hau"] = float("inf")
    with pytest.raises(WrongModelError, match="a finite scale of 'hau', got inf"):
        forecaster(whole, "hau", calibrated=True, rng=DRAW("f"))
    with pytest.raises(ValueError, match="got 'magic'"):
        forecaster(whole, "magic", calibrated=True, rng=DRAW("f"))


def test_too_short_rollouts_are_named(rollouts, parts):
    long = Settings(schedule=Schedule(epochs=1), horizon=30)
    with pytest.raises(NoRolloutsError, match="must have an episode of 34 steps"):
        learn(rollouts, parts, long, DRAW)
