import re
from dataclasses import dataclass
from typing import Annotated

import pytest

from cpl.settings.ranges import Choice, Count, Probability, Settings, Share, interval, ranges_of


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    pairs: Count
    alpha: Probability = 0.1
    shares: tuple[Share, ...] = (0.0, 1.0)
    kinds: Annotated[tuple[str, ...], Choice(("safe", "speed"))] = ("safe",)
    weights: Annotated[tuple[float, ...], interval("[0, inf)")] = ()
    free: int = -7


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"pairs": 0}, "pairs must be in [1, inf), got 0"),
        ({"shares": (0.5, 1.5)}, "shares must be in [0, 1], got 1.5"),
        ({"alpha": 1.0}, "alpha must be in (0, 1), got 1.0"),
        ({"alpha": float("nan")}, "alpha must be in (0, 1), got nan"),
        ({"kinds": ("safe", "fast")}, "kinds must be in {safe, speed}, got 'fast'"),
        ({"weights": (1.0, -1.0)}, "weights must be in [0, inf), got "),
        ({"weights": (float("inf"),)}, "weights must be in [0, inf), got "),
    ],
)
def test_a_field_out_of_its_range_is_named(change, named):
    with pytest.raises(ValueError, match=re.escape(named)):
        Config(**{"pairs": 1, **change})


def test_ranges_are_those_of_the_annotations():
    assert {name: str(allowed) for name, allowed in ranges_of(Config).items()} == {
        "pairs": "[1, inf)",
        "alpha": "(0, 1)",
        "shares": "[0, 1]",
        "kinds": "{safe, speed}",
        "weights": "[0, inf)",
    }
    assert Config(pairs=1).free == -7


@dataclass(frozen=True, kw_only=True)
class Other(Config):
    pairs: int = 3


def test_another_default_keeps_the_range():
    assert Other().pairs == 3
    with pytest.raises(ValueError, match="pairs must be in"):
        Other(pairs=0)


@pytest.mark.parametrize("text", ["[1, 1]", "(2, 1)"])
def test_an_empty_interval_is_refused(text):
    with pytest.raises(ValueError, match="is empty"):
        interval(text)
