"""Training: it learns what can be learned, stops by its rule, and says when it cannot."""

import numpy as np
import pytest

from cpl.forecast.certificates import fit_certificates
from cpl.forecast.errors import NoRolloutsError, TrainingDivergedError
from cpl.forecast.schedule import Moments, Schedule
from cpl.forecast.training import _has_converged, fit

SIZES = (3, 8, 8, 8, 1)


def samples(n=600, bad=None):
    rng = np.random.default_rng(0)
    x = rng.normal(size=(n, 3)).astype(np.float32)
    y = (1 / (1 + np.exp(-x[:, 0] + 0.5 * x[:, 1]))).astype(np.float32)
    if bad is not None:
        y[5] = bad
    return Moments(x, y, np.arange(n // 2), np.arange(n // 2, n))


def test_it_learns_and_is_the_same_again():
    data, schedule = samples(), Schedule(epochs=40, batch=32, lr=1e-2)
    one = fit(SIZES, data, schedule, np.random.default_rng(1))
    two = fit(SIZES, data, schedule, np.random.default_rng(1))
    for a, b in zip(one.network.weights, two.network.weights, strict=True):
        np.testing.assert_array_equal(a, b)
    assert one.curve == two.curve
    best = min(epoch.validation for epoch in one.curve)
    assert best < 0.1 * np.var(data.targets)
    # The weights that are returned are those of the best epoch.
    error = one.network(data.inputs[data.validation])[:, 0] - data.targets[data.validation]
    assert np.mean(error**2) == pytest.approx(best, rel=1e-4)


def test_the_variance_of_noise_is_found():
    data = samples(4000)
    noise = np.random.default_rng(2).normal(size=len(data.targets)) * 0.1
    noisy = data._replace(targets=(data.targets + noise).astype(np.float32))
    sizes, schedule = (3, 8, 8, 8, 2), Schedule(epochs=30, batch=64, lr=1e-2)
    made = fit(sizes, noisy, schedule, np.random.default_rng(1), loss="gaussian")
    assert made.network.output == "linear"
    s = made.network(data.inputs)[:, 1]
    assert np.exp(0.5 * np.median(s)) == pytest.approx(0.1, rel=0.2)


def test_a_probability_is_found():
    data = samples(4000)
    label = np.random.default_rng(3).random(4000) < data.targets
    labelled = data._replace(targets=label.astype(np.float32))
    schedule = Schedule(epochs=15, batch=64, lr=1e-2)
    made = fit(SIZES, labelled, schedule, np.random.default_rng(1), loss="cross entropy")
    p = made.network(data.inputs[data.validation])[:, 0]
    assert np.mean((p - data.targets[data.validation]) ** 2) < 0.01


def test_dropout_is_for_training_only():
    data, schedule = samples(), Schedule(epochs=1, batch=64)
    made = fit(SIZES, data, schedule, np.random.default_rng(1), dropout=0.5)
    error = made.network(data.inputs[data.validation])[:, 0] - data.targets[data.validation]
    assert np.mean(error**2) == pytest.approx(made.curve[0].validation, rel=1e-4)


@pytest.mark.parametrize(
    ("losses", "done"),
    [
        ([1.0], False),
        ([1.0, 0.9, 0.8], False),  # three epochs, none before them
        ([1.0, 0.9, 0.8, 0.7], False),
        ([1.0, 0.995, 0.992, 0.991], True),
        ([1.0, 1.1, 1.2, 0.98], False),
        ([-2.0, -2.001, -2.002, -2.003], True),  # a likelihood may be negative
        ([-2.0, -2.1, -2.2, -2.3], False),
    ],
)
def test_the_rule_of_convergence(losses, done):
    assert _has_converged(losses, Schedule(epochs=9)) is done


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_loss_that_is_no_number_returns_no_network(bad):
    with pytest.raises(TrainingDivergedError, match="in epoch 1"):
        fit(SIZES, samples(bad=bad), Schedule(epochs=3), np.random.default_rng(0))


def test_nothing_to_learn_from_is_named():
    empty = samples()._replace(train=np.empty(0, np.int64))
    with pytest.raises(NoRolloutsError, match="got 0 and 300"):
        fit(SIZES, empty, Schedule(epochs=3), np.random.default_rng(0))


def test_certificates_find_the_directions_of_least_variation():
    rng = np.random.default_rng(0)
    scales = np.array([3.0, 2.0, 1.0, 0.1, 0.05, 0.01])
    turn, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    phi = ((rng.normal(size=(5000, 6)) * scales) @ turn.T + 0.7).astype(np.float32)
    found = fit_certificates(phi, rng, k=3, epochs=40)
    overlap = np.linalg.svd(turn[:, 3:].T @ found.weight)[1]
    assert overlap.min() > 0.95
    assert found.penalty < 0.01
    shown = np.square(phi @ found.weight + found.bias).mean()
    assert shown == pytest.approx(found.curve[-1], rel=0.02)
    assert found.curve[-1] < 0.02
    with pytest.raises(NoRolloutsError, match="got none"):
        fit_certificates(phi[:0], rng, k=3)
