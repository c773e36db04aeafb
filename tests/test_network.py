import itertools

import numpy as np
import pytest

from cpl.network import MLP, DamagedModelError, decode_networks, encode_networks
from cpl.rng import stream
from cpl.store import encode_model


def net(sizes=(25, 16, 8, 5), output="linear", seed=0):
    rng = stream(seed, "net")
    pairs = list(itertools.pairwise(sizes))
    return MLP(
        tuple(rng.normal(size=pair).astype(np.float32) for pair in pairs),
        tuple(rng.normal(size=pair[1]).astype(np.float32) for pair in pairs),
        output,
    )


@pytest.mark.parametrize("output", ["linear", "sigmoid"])
def test_it_computes_what_torch_computes(output):
    torch = pytest.importorskip("torch")
    mine = net(output=output)
    layers = []
    for w, b in zip(mine.weights, mine.biases, strict=True):
        layer = torch.nn.Linear(*w.shape)
        layer.weight.data, layer.bias.data = torch.tensor(w.T.copy()), torch.tensor(b)
        layers += [layer, torch.nn.ReLU()]
    layers[-1] = torch.nn.Sigmoid() if output == "sigmoid" else torch.nn.Identity()
    x = stream(1, "x").normal(size=(7, 25)).astype(np.float32)
    theirs = torch.nn.Sequential(*layers)(torch.tensor(x)).detach().numpy()
    # A sum that cancels is off by what its terms round: the largest outputs say how large they are.
    np.testing.assert_allclose(mine(x), theirs, rtol=2e-5, atol=1e-6 * np.abs(theirs).max())
    assert mine(x).dtype == np.float32


def test_the_hidden_layer_leads_to_the_output():
    mine, x = net(), np.ones((3, 25), np.float32)
    np.testing.assert_array_equal(mine.hidden(x) @ mine.weights[-1] + mine.biases[-1], mine(x))


def test_the_sigmoid_does_not_overflow():
    steep = MLP((np.full((1, 1), 1e6, np.float32),), (np.zeros(1, np.float32),), "sigmoid")
    assert steep(np.array([[-1.0], [1.0]], np.float32)).ravel().tolist() == [0.0, 1.0]


def test_networks_come_back():
    model = decode_networks(
        encode_networks({"a": net(), "b": net(output="sigmoid")}, {"k": 1}, {"scale": np.ones(1)})
    )
    x = np.ones((2, 25), np.float32)
    np.testing.assert_array_equal(model.network("b")(x), net(output="sigmoid")(x))
    assert model.config == {"k": 1}
    assert list(model.arrays) == ["scale"]
    with pytest.raises(DamagedModelError, match="no network 'c'"):
        model.network("c")


def test_a_model_without_networks_is_refused():
    with pytest.raises(DamagedModelError, match="no networks"):
        decode_networks(encode_model({"w": np.ones(1)}, {}))


@pytest.mark.parametrize("name", ["a.b", "scale"])
def test_names_must_be_clear(name):
    with pytest.raises(ValueError, match="names must be unique"):
        encode_networks({name: net()}, {}, {"scale": np.ones(1)})


@pytest.mark.parametrize(
    ("weights", "biases", "output", "message"),
    [
        ((np.ones((2, 3)),), (np.ones(2),), "linear", "layer 0 must fit"),
        ((np.ones((2, 3)), np.ones((4, 1))), (np.ones(3), np.ones(1)), "linear", "layer 1 must"),
        ((np.full((2, 3), np.nan),), (np.ones(3),), "linear", "layer 0 must be finite"),
        ((), (), "linear", "at least one"),
        ((np.ones((2, 3)),), (np.ones(3),), "tanh", "output must be one of"),
    ],
)
def test_layers_that_do_not_fit_are_refused(weights, biases, output, message):
    with pytest.raises(ValueError, match=message):
        MLP(weights, biases, output)


def test_inputs_of_another_shape_are_refused():
    with pytest.raises(ValueError, match=r"x must have shape \(n, 25\), got \(2, 24\)"):
        net()(np.ones((2, 24), np.float32))
