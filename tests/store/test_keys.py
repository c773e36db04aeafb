from dataclasses import dataclass
from enum import Enum
from importlib.metadata import version

import numpy as np
import pytest

from cpl.store import canonical_json, stage_key, versions_below


@dataclass(frozen=True, kw_only=True)
class Toy:
    alpha: float
    seeds: tuple[int, ...]


class Colour(Enum):
    RED = "red"


def test_canonical_json_does_not_depend_on_order_or_container():
    assert canonical_json({"a": 1, "b": [2]}) == canonical_json({"b": (2,), "a": 1})
    assert canonical_json(Toy(alpha=0.1, seeds=(1,))) == '{"alpha":0.1,"seeds":[1]}'
    assert canonical_json([np.float64(0.1), np.int8(3), np.bool_(True), Colour.RED, "ü"]) == (
        '[0.1,3,true,"red","\\u00fc"]'
    )


def test_values_of_different_type_stay_different():
    assert len({canonical_json(v) for v in (1, 1.0, True, "1", [1], None)}) == 6


@pytest.mark.parametrize("value", [float("nan"), np.inf, {1}, {1: 2}, b"x", object(), print])
def test_what_json_cannot_hold_is_refused(value):
    with pytest.raises(ValueError, match=r"to be stored as JSON|must be JSON"):
        canonical_json({"x": value})


def test_every_part_of_a_key_counts():
    base = {"fingerprint": "f", "versions": {"numpy": "2"}, "upstream": ["u"]}
    keys = {
        stage_key("a", {"n": 1}, **base),
        stage_key("b", {"n": 1}, **base),
        stage_key("a", {"n": 2}, **base),
        stage_key("a", {"n": 1.0}, **base),
        stage_key("a", {"n": 1}, **{**base, "fingerprint": "g"}),
        stage_key("a", {"n": 1}, **{**base, "versions": {"numpy": "3"}}),
        stage_key("a", {"n": 1}, **{**base, "upstream": []}),
    }
    assert len(keys) == 7
    assert stage_key("a", {"n": 1}, **base) in keys


def test_versions_are_looked_up_without_importing():
    versions = versions_below("cpl.store", "cpl.stats")
    assert versions == {"numpy": np.__version__, "scipy": version("scipy")}
