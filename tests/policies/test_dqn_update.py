"""The compiled update beside torch's: products, first weights, loss, gradient, clipping, Adam."""

from itertools import pairwise

import numpy as np
import pytest
import torch

from cpl.policies.dqn import DQNConfig
from cpl.policies.dqn.compiled import Learner
from cpl.policies.dqn.initial import initial_network
from cpl.policies.dqn.tiles import address, multiply
from cpl.policies.dqn.update import FIRST, PARAMETERS, SECOND, _adam


def floats(rng, *shape):
    return rng.standard_normal(shape).astype(np.float32)


@pytest.mark.parametrize(
    ("rows", "cols", "n"), [(8, 32, 25), (25, 48, 32), (5, 16, 1), (17, 80, 7)]
)
@pytest.mark.parametrize("transposed", [False, True])
def test_products_of_any_size(rows, cols, n, transposed):
    rng = np.random.default_rng(rows)
    a, b, start = floats(rng, rows, n), floats(rng, n, cols), floats(rng, rows)
    stored = np.ascontiguousarray(a.T) if transposed else a
    strides = (1, rows) if transposed else (n, 1)
    c = np.full(rows * cols + 16, 7.0, np.float32)
    left, right, begin = (address(m.ravel(), 0) for m in (stored, b, start))
    multiply(left, *strides, right, cols, address(c, 0), begin, rows, cols, n)
    exact = a.astype(np.float64) @ b + start[:, None]
    np.testing.assert_allclose(c[: rows * cols].reshape(rows, cols), exact, atol=2e-5)
    assert (c[rows * cols :] == 7).all()


def test_a_product_is_one_chain_of_fused_multiply_adds():
    # The first product is exact in float64, so one rounding to float32 is what fusing leaves.
    a, b = np.float32([[1 + 2**-12] * 8]).T, np.full((1, 16), 1 - 2**-12, np.float32)
    start = np.full(8, -1, np.float32)
    c = np.zeros((8, 16), np.float32)
    where = [address(m.ravel(), 0) for m in (a, b, start)]
    multiply(where[0], 1, 1, where[1], 16, address(c.reshape(-1), 0), where[2], 8, 16, 1)
    assert (c == np.float32(-(2.0**-24))).all()


@pytest.mark.parametrize("seed", [0, 7, 2**32 - 1])
def test_first_weights_are_torchs_own(seed):
    sizes = (25, 48, 16, 5)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        layers = [torch.nn.Linear(i, o) for i, o in pairwise(sizes)]
    ours = initial_network(sizes, seed)
    for layer, w, b in zip(layers, ours.weights, ours.biases, strict=True):
        np.testing.assert_array_equal(layer.weight.detach().numpy().T, w)
        np.testing.assert_array_equal(layer.bias.detach().numpy(), b)


class Torch:
    """The same update by autograd, as Stable-Baselines3 writes it."""

    def __init__(self, network, config):
        self.config = config
        layers = []
        for w, b in zip(network.weights, network.biases, strict=True):
            layer = torch.nn.Linear(*w.shape)
            layer.weight.data, layer.bias.data = torch.tensor(w.T.copy()), torch.tensor(b)
            layers += [layer, torch.nn.ReLU()]
        self.online = torch.nn.Sequential(*layers[:-1])
        self.target = [p.detach().clone() for p in self.online.parameters()]
        self.optimizer = torch.optim.Adam(self.online.parameters(), lr=config.learning_rate)

    def learn(self, obs, following, action, reward, terminal):
        with torch.no_grad():
            names = [name for name, _ in self.online.named_parameters()]
            weights = dict(zip(names, self.target, strict=True))
            best = torch.func.functional_call(self.online, weights, following).max(1).values
            wanted = reward + (1 - terminal) * self.config.gamma * best
        now = self.online(obs).gather(1, action[:, None]).squeeze(1)
        loss = torch.nn.functional.smooth_l1_loss(now, wanted)
        self.optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.online.parameters(), self.config.max_grad_norm)
        self.optimizer.step()
        return loss.item()


@pytest.mark.parametrize(
    ("hidden", "batch", "max_norm"),
    [((256, 256), 32, 10.0), ((16,), 16, 10.0), ((32, 16, 48), 48, 0.05)],
)
def test_updates_follow_torch(hidden, batch, max_norm):
    rng = np.random.default_rng(1)
    config = DQNConfig(hidden=hidden, batch_size=batch, max_grad_norm=max_norm)
    network = initial_network((25, *hidden, 5), seed=3)
    ours, theirs = Learner(network, config), Torch(network, config)
    replay = floats(rng, 300, 53)
    replay[:, 50], replay[:, 52] = rng.integers(5, size=300), rng.random(300) < 0.2
    replay[:, 51] *= 3  # errors on both sides of Huber's bend
    for step in range(12):
        index = rng.integers(300, size=batch)
        rows = torch.tensor(replay[index])
        loss = theirs.learn(
            rows[:, :25], rows[:, 25:50], rows[:, 50].long(), rows[:, 51], rows[:, 52]
        )
        assert ours.learn(replay, index) == pytest.approx(loss, rel=2e-5)
        if step == 7:
            ours.copy_to_target()
            theirs.target = [p.detach().clone() for p in theirs.online.parameters()]
    found = ours.network()
    for layer, (w, b) in enumerate(zip(found.weights, found.biases, strict=True)):
        torchs = theirs.online[2 * layer]
        np.testing.assert_allclose(w, torchs.weight.detach().numpy().T, atol=2e-5)
        np.testing.assert_allclose(b, torchs.bias.detach().numpy(), atol=2e-5)


def test_greedy_is_the_networks_best_action():
    network = initial_network((25, 64, 32, 5), seed=0)
    learner = Learner(network, DQNConfig(hidden=(64, 32)))
    obs = floats(np.random.default_rng(0), 50, 25)
    values = network(obs)
    found = [learner.best(row) for row in obs]
    assert [action for action, _ in found] == values.argmax(axis=1).tolist()
    np.testing.assert_allclose([value for _, value in found], values.max(axis=1), rtol=1e-4)


def test_a_network_comes_back_as_it_went_in():
    network = initial_network((7, 16, 32, 3), seed=5)
    again = Learner(network, DQNConfig(hidden=(16, 32))).network()
    for one, other in zip(
        network.weights + network.biases, again.weights + again.biases, strict=True
    ):
        np.testing.assert_array_equal(one, other)


def test_moments_of_silent_units_become_zero_and_move_nothing():
    one = np.float32(1)
    memory = np.zeros((5, 4), np.float32)
    memory[PARAMETERS] = 0.5
    memory[FIRST], memory[SECOND] = 1e-29, 1e-35
    for _ in range(3000):
        _adam(memory, one, np.float32(5e-4), one)
    assert not memory[FIRST].any()
    assert not memory[SECOND].any()
    assert (memory[PARAMETERS] == np.float32(0.5)).all()
