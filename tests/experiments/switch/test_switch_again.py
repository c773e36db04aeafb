"""A pair trained anew, at the paper's sizes, agrees with the published result (pytest -m again)."""

import pytest

from cpl.experiments import published
from cpl.experiments.run.publication import compute
from cpl.policies.comparison import chosen, foretold
from cpl.policies.measures import table_of

MEASURES = ("duration_s", "episode_speed_mps", "step_speed_mps", "crashes_per_km")


@pytest.mark.again
def test_a_training_seed_that_nobody_saw_lies_where_the_published_ones_foretell():
    """About six minutes on two cores, of which the forecaster of the new pair takes four."""
    result = published("pareto")
    one_more = {"pairs": 1, "side_pairs": 0, "methods": ("conformal", "none")}
    one_more["first_pair"] = result.config.first_pair + result.config.pairs
    fresh = compute("pareto", "paper", one_more, workers=2).table  # the policies beside each other
    old = result.table[result.table["top_mps"] == result.config.top_speed_mps]
    inside = []
    for method in ("conformal", "none", "safe", "speed"):
        new = table_of(chosen(fresh, {"method": method}), ["level"])
        for name in MEASURES:
            told = foretold(chosen(old, {"method": method}), name, confidence=0.99)
            values = zip(told, new[name], strict=True)
            inside += [estimate.low <= value <= estimate.high for estimate, value in values]
    assert sum(inside) >= 0.95 * len(inside)
