import json
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.store import DamagedModelError, decode_model, encode_model

ARRAYS = {
    "w": np.arange(6, dtype=np.float32).reshape(2, 3),
    "n": np.array([1, -2], dtype=np.int64),
    "scale": np.array(0.5),
}
CONTENT = encode_model(ARRAYS, {"seed": 3, "rate": 1e-3})


def test_round_trip():
    model = decode_model(CONTENT)
    assert model.config == {"seed": 3, "rate": 1e-3}
    assert sorted(model.arrays) == sorted(ARRAYS)
    for name, array in ARRAYS.items():
        assert model.arrays[name].dtype == array.dtype
        np.testing.assert_array_equal(model.arrays[name], array)


def test_the_same_arrays_give_the_same_bytes():
    assert encode_model(dict(reversed(ARRAYS.items())), {"rate": 1e-3, "seed": 3}) == CONTENT


@given(st.integers(0, len(CONTENT) * 8 - 1))
def test_every_flipped_bit_is_noticed(bit):
    damaged = bytearray(CONTENT)
    damaged[bit // 8] ^= 1 << bit % 8
    try:
        model = decode_model(bytes(damaged))
    except DamagedModelError:
        return
    # a blank of the header's padding may change without a change of what it says
    assert model.config == {"seed": 3, "rate": 1e-3}
    assert all(np.array_equal(model.arrays[name], ARRAYS[name]) for name in ARRAYS)


@given(st.integers(0, len(CONTENT) - 1))
def test_every_truncation_is_noticed(length):
    with pytest.raises(DamagedModelError):
        decode_model(CONTENT[:length])


def test_a_header_that_claims_to_be_huge_is_refused():
    with pytest.raises(DamagedModelError, match="header"):
        decode_model(struct.pack("<Q", 1 << 40) + b"{}")


def test_a_file_of_others_is_refused():
    header = json.dumps({"w": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}}).encode()
    with pytest.raises(DamagedModelError):
        decode_model(struct.pack("<Q", len(header)) + header + bytes(4))


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({}, "arrays must not be empty"),
        ({"w": np.array([np.nan])}, "array 'w' must be finite"),
        ({"w": np.array(["a"])}, "array 'w' must hold plain numbers"),
        ({"w": np.array([object()])}, "array 'w' must hold plain numbers"),
    ],
)
def test_what_is_no_model_is_refused(arrays, message):
    with pytest.raises(ValueError, match=message):
        encode_model(arrays, {})
