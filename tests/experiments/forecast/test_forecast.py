"""What stands on the forecasters: the real run, shrunken, and sums that can be checked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from cpl.conformal import RunningMax, track_episodes
from cpl.experiments import compute
from cpl.experiments.forecast import (
    coverage_episodes,
    forecast_cost,
    forecast_danger,
    forecast_ride,
)
from cpl.experiments.forecast.coverage_episodes import (
    _after,
    _Episode,
    _issued,
    _paired,
    _tracked,
    _windows,
)
from cpl.forecast.methods import METHODS

MODULES = [coverage_episodes, forecast_danger, forecast_cost, forecast_ride]


pytestmark = pytest.mark.usefixtures("shared_store")


@pytest.fixture(scope="module")
def tables(smoke):
    return smoke("coverage_episodes", "forecast_danger", "forecast_cost", "forecast_ride")


def made_up(rng, count=30):
    """Episodes of all lengths, the shortest too short for any forecast to be checked."""
    for k in range(count):
        steps = int(rng.integers(2, 40))
        l_tilde, l_hat = rng.random(steps + 1), rng.random(max(steps - 4, 0))
        yield _Episode(k, bool(rng.random() < 0.5), l_tilde, np.full(steps + 1, 25.0), l_hat)


def sums(table, **where):
    for name, value in where.items():
        table = table[table[name] == value]
    assert len(table) == 1
    return float(table["value"].iloc[0]), int(table["n"].iloc[0])


@pytest.mark.parametrize("driver", coverage_episodes.DRIVERS)
@pytest.mark.parametrize("top", [30.0, 40.0])
def test_coverage_with_a_reset_is_what_the_identity_says(tables, driver, top):
    table = tables["coverage_episodes"].query("driver == @driver and top_speed_mps == @top")
    config = coverage_episodes.PROFILES["smoke"]
    where = {"rule": "P, fixed", "carry": False}
    misses, n = sums(table, quantity="fed miss", **where)
    ends, _ = sums(table, quantity="q end", **where)
    assert misses == pytest.approx(config.alpha * n + ends / config.eta, abs=1e-9)


def test_the_identity_on_any_episodes():
    rng = np.random.default_rng(3)
    config = coverage_episodes.PROFILES["smoke"]
    episodes = list(made_up(rng))
    rule = coverage_episodes.rules(config)["P, fixed"]
    rows = {
        r["quantity"]: r for r in _tracked(config, episodes, rule, False) if r["group"] == "all"
    }
    n, misses = rows["fed miss"]["n"], rows["fed miss"]["value"]
    assert misses == pytest.approx(config.alpha * n + rows["q end"]["value"] / config.eta)
    assert n == sum(max(len(e.scores) - 2, 0) for e in episodes)


def test_the_quantile_after_an_episode_by_hand():
    config = coverage_episodes.PROFILES["smoke"]
    rule = coverage_episodes.rules(config)["P, fixed"]
    # Three scores: only the first is ever fed back, a miss at q = 0.
    assert _after(config, np.array([0.5, 0.5, 0.5]), rule) == pytest.approx(0.09)
    assert _after(config, np.array([0.5, 0.5]), rule) == 0.0


def test_windows_by_hand():
    config = coverage_episodes.PROFILES["smoke"]
    track = track_episodes([[0.0] * 7], RunningMax(c=0.1), alpha=0.1, carry=False)[0]
    err = np.array([True, False, False, False, False, False, False])
    told = _windows(config, [track._replace(err=err), track._replace(err=err[:4])])
    assert (told["value"], told["n"]) == (2, 3)  # the first of three has the miss


def test_the_threshold_that_stands_beside_a_forecast_is_the_one_its_score_meets():
    config = coverage_episodes.PROFILES["smoke"]
    episodes = list(made_up(np.random.default_rng(4)))
    issued = _issued(config, episodes)
    met = track_episodes(
        [each.scores for each in episodes], RunningMax(c=0.1), alpha=0.1, carry=False, delay=3
    )
    for each, track in zip(episodes, met, strict=True):
        assert len(issued[each.seed]) == len(each.l_hat)
        np.testing.assert_array_equal(issued[each.seed][: len(track.q)], track.q)


def test_pairs_share_a_seed_and_the_steps_that_both_have():
    inside = {1: np.array([0.1, 0.2, 0.9]), 2: np.array([0.5])}
    outside = {1: np.array([0.3, 0.4]), 3: np.array([9.0])}
    row = _paired(inside, outside)[0]
    assert (row["value"], row["n"]) == (pytest.approx(0.2), 1)


def test_counts_of_the_coverage_agree_with_each_other(tables):
    table = tables["coverage_episodes"]
    assert table["value"].notna().all()
    miss = table.query("quantity == 'miss'")
    assert (miss["value"] <= miss["n"]).all()
    for _, part in miss.query("group == 'all'").groupby(["driver", "top_speed_mps"]):
        reset = part.query("not carry")
        assert reset["n"].nunique() == 1  # all rules track the same scores
    safe = table.query("quantity == 'safe' and driver == 'safe'")
    assert (safe["value"] == safe["n"]).all()
    fast = table.query("quantity == 'too fast' and top_speed_mps == 30")
    assert (fast["value"] == 0).all()
    assert set(table.query("quantity == 'q_safe'")["driver"]) == {"switch"}


def test_danger_is_judged_by_probabilities(tables):
    table = tables["forecast_danger"]
    aucs = table.query("quantity == 'auc'")
    known = aucs["value"].dropna()
    assert known.between(0, 1).all()
    assert len(known) > 0
    shares = table.query("quantity != 'auc'")["value"]
    assert shares.between(0, 1).all()
    assert (table.query("quantity == 'too fast' and top_speed_mps == 30")["value"] == 0).all()
    assert set(aucs.groupby(["top_speed_mps", "policy"]).size()) == {14, 15}


def test_what_a_forecast_costs_is_counted(tables):
    table = tables["forecast_cost"].set_index("method")
    assert set(METHODS) < set(table.index)
    assert (table["seconds"] > 0).all()
    assert table.loc["none", "parameters"] == 24_705
    assert table.loc["none", "operations"] == 2 * (125 * 64 + 64 * 128 + 128 * 64 + 64)
    assert table.loc["ensemble", "operations"] == 5 * table.loc["none", "operations"]
    assert table.loc["dropout", "passes"] == table.loc["ensemble", "networks"] == 5
    assert table.loc["conformal", "weights_changed"] == 0
    assert (table.loc[["dropout", "ensemble", "hau"], "weights_changed"] > 0).all()


def test_a_ride_has_its_forecasts_beside_what_happened(tables):
    table = tables["forecast_ride"]
    assert table["step"].tolist() == list(range(4, 4 + len(table)))
    assert table["q"].iloc[0] == 0.0
    np.testing.assert_array_equal(
        table["missed"], np.abs(table["l_tilde"] - table["l_hat"]) > table["q"]
    )
    assert not table["safe"].any()
    again = compute("forecast_ride", profile="smoke", driver="safe").table
    assert again["safe"].all()


def test_a_ride_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match=r"ride must be below \d+, .* 64 episodes .* got 99"):
        compute("forecast_ride", profile="smoke", ride=99)


def test_the_switch_of_a_ride_keeps_to_its_threshold():
    table = compute("forecast_ride", profile="smoke", driver="switch", q_safe=0.5).table
    danger = table["l_hat"] + table["q"] >= 0.5
    np.testing.assert_array_equal(table["safe"], danger)


def test_the_quantile_of_the_closed_loop_is_the_one_that_is_tracked_afterwards(tables):
    """The switch was driven with q in the loop; tracking its scores again gives the same q."""
    config = forecast_ride.PROFILES["smoke"]
    table = compute("forecast_ride", profile="smoke", driver="switch", q_safe=0.7).table
    scores = np.abs(table["l_tilde"] - table["l_hat"]).to_numpy()
    how = {"alpha": config.alpha, "carry": False, "delay": 3}
    (track,) = track_episodes([scores], RunningMax(c=config.step), **how)
    np.testing.assert_allclose(track.q, table["q"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("module", MODULES)
def test_every_profile_has_shards_of_unique_names(module):
    for config in module.PROFILES.values():
        names = [shard.name for shard in module.EXPERIMENT.shards(config)]
        assert len(names) == len(set(names)) > 0


@pytest.mark.parametrize(
    ("module", "changes", "message"),
    [
        (coverage_episodes, {"episodes": 0}, r"episodes must be in \[1, inf\), got 0"),
        (coverage_episodes, {"share": 1.0}, r"share must be in \(0, 1\), got 1.0"),
        (coverage_episodes, {"alpha": 0.0}, r"alpha must be in \(0, 1\), got 0.0"),
        (coverage_episodes, {"models": "none"}, "models must be in"),
        (coverage_episodes, {"eta": -1.0}, "eta"),
        (forecast_danger, {"reference": 0}, r"reference must be in \[1, inf\), got 0"),
        (forecast_danger, {"lessons": 0}, r"lessons must be in \[1, inf\), got 0"),
        (forecast_danger, {"models": "none"}, "models must be in"),
        (forecast_cost, {"rounds": 0}, r"rounds must be in \[1, inf\), got 0"),
        (forecast_cost, {"models": "none"}, "models must be in"),
        (
            forecast_ride,
            {"driver": "nobody"},
            "driver .* got 'nobody'",
        ),
        (forecast_ride, {"ride": -1}, r"ride must be in \[0, inf\), got -1"),
        (forecast_ride, {"least": 6}, r"least must be in \[7, inf\), got 6"),
        (forecast_ride, {"q_safe": 3.0}, r"q_safe must lie in \[0, 2\], got 3.0"),
        (forecast_ride, {"models": "none"}, "models must be in"),
    ],
)
def test_impossible_settings_are_refused(module, changes, message):
    with pytest.raises(ValueError, match=message):
        replace(module.PROFILES["smoke"], **changes)
