"""The multilayer perceptron that everything learned here is: weights, inference, its stored form.

Training needs torch or a compiled learner; using what was trained needs numpy only. Where the same
bits are wanted on every machine, `Portable` adds up in a fixed order.
"""

from cpl.network.forward import Portable, forward, packed
from cpl.network.mlp import MLP, DamagedModelError, Model, decode_networks, encode_networks

__all__ = [
    "MLP",
    "DamagedModelError",
    "Model",
    "Portable",
    "decode_networks",
    "encode_networks",
    "forward",
    "packed",
]
