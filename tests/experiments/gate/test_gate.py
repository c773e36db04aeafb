"""The worlds of the gate's experiments, and that all drivers meet the same ones."""

from collections import Counter

import numpy as np
import pytest

from cpl.experiments import compute
from cpl.experiments.gate.drivers import Capped, Foresight, Plain, Scheduled, Switching
from cpl.experiments.gate.replays import replays
from cpl.experiments.gate.streams import WORLDS, Gated, Roads, drive, schedule
from cpl.experiments.gate.study import calibrated
from cpl.highway import PAPER
from cpl.policies.gate import Constant, Gate

LIKED = np.array([0.5, 0.2, 0.4, 1.0, 0.1])


def throttle(obs):
    """Always faster, if it may."""
    return np.tile(LIKED, (len(obs), 1))


def crawl(obs):
    """Always slower."""
    return np.tile(LIKED[[0, 1, 2, 4, 3]], (len(obs), 1))


def test_every_stream_visits_every_world_and_all_are_visited_at_any_time():
    names = tuple(WORLDS)[:8]
    worlds = schedule(names, streams=16, stay=3, seed=5)
    assert worlds.shape == (16, 24)
    for stream in worlds:
        assert Counter(stream.tolist()) == dict.fromkeys(names, 3)
        assert (np.diff(np.unique(stream, return_inverse=True)[1]) != 0).sum() == 7
    for here in worlds.T:
        assert set(Counter(here.tolist()).values()) == {2}
    assert len({tuple(stream) for stream in worlds}) > 8
    with pytest.raises(ValueError, match="multiple of 8"):
        schedule(names, streams=12, stay=1, seed=0)


def test_worlds_do_not_depend_on_who_drives():
    """Same seed, same noise, same events, whatever else is in the batch."""
    for world in ("noise", "dropout", "bursts", "braking"):
        few = Roads(np.array([world] * 2), np.array([7, 8]))
        many = Roads(np.array([world] * 4), np.array([8, 7, 7, 8]))
        a, b = few.reset(), many.reset()
        for _ in range(14):
            assert np.array_equal(a, b[[1, 0]])
            assert np.array_equal(a, b[[2, 3]])
            a, b = few.step(np.full(2, 4))[0], many.step(np.full(4, 4))[0]


def test_a_car_ahead_brakes_and_drives_on():
    roads = Roads(np.array(["braking"] * 8), np.arange(8))
    roads.reset()
    _, _, engine = roads.parts[0]
    wished, braked = engine.state().target_speed, False
    for _ in range(20):
        roads.step(np.full(8, 4))
        target = engine.state().target_speed
        braked |= bool((target[:, 1:] < 10).any())
        assert ((target[:, 1:] == 5.0) | (target[:, 1:] == wished[:, 1:])).all()
    assert braked


def test_noise_comes_and_goes_in_bursts():
    roads = Roads(np.array(["bursts"]), np.array([3]))
    quiet = Roads(np.array(["in"]), np.array([3]))
    a, b = roads.reset(), quiet.reset()
    for step in range(30):
        same = np.array_equal(a, b)
        assert same == (step % 25 < 10)
        a, b = roads.step(np.array([4]))[0], quiet.step(np.array([4]))[0]


def test_equal_drivers_get_equal_episodes():
    worlds = schedule(("in", "braking"), streams=4, stay=1, seed=0)
    drivers = [Plain("a", throttle), Plain("b", throttle)]
    table = drive(drivers, worlds, first_seed=100, steps=12)
    a, b = (table[table["method"] == name].drop(columns="method") for name in "ab")
    assert np.array_equal(a.drop(columns="world").to_numpy(), b.drop(columns="world").to_numpy())
    assert len(a) == 8
    again = drive(drivers[:1], worlds, first_seed=100, steps=12)
    assert np.array_equal(again["crashed"], a["crashed"])


def test_who_knows_more_crashes_less():
    worlds = np.full((24, 1), "in")
    gate = Gate(PAPER, 24, Constant(3.0, 24))
    drivers = [
        Plain("blind", throttle),
        Gated(["gate"], gate, throttle),
        Foresight("oracle", throttle),
        Capped("capped", throttle, 20.0),
        Scheduled("clock", crawl, throttle, until=30),
        Scheduled("coin", crawl, throttle, until=None, share=1.0),
        Switching("switch", crawl, throttle, 24, q_safe=-1.0),
    ]
    table = drive(drivers, worlds, first_seed=200)
    crashes = table.groupby("method")["crashed"].sum()
    steps = table.groupby("method")["steps"].sum()
    speed = table.groupby("method")["speed_sum"].sum() / steps
    assert crashes["blind"] > 18
    assert crashes["gate"] < 6
    assert crashes["oracle"] < 6
    assert speed["capped"] < 21
    assert speed["coin"] == pytest.approx(speed["switch"])  # the slow one drives, always
    assert crashes["clock"] <= crashes["blind"]


def test_tuning_finds_the_margin_that_errs_as_often_as_wanted():
    margin = calibrated(throttle, Constant, (-5.0, 0.0, 2.0, 40.0), alpha=0.2, streams=16)
    assert -5.0 < margin < 10.0


def test_replayed_margins_keep_what_their_names_say():
    worlds = np.array([["in", "noise"], ["in", "noise"], ["noise", "in"], ["noise", "in"]])
    q = np.random.default_rng(0).normal(5, 1, (80, 4)) + 10 * (
        np.repeat(worlds.T, 40, 0) == "noise"
    )
    played = replays(q, worlds)
    assert np.array_equal(played["donor quantile"][:40, :2], q[:40, [1, 0]])
    assert np.allclose(np.sort(played["shuffled quantile"], axis=1), np.sort(q, axis=1))
    assert np.allclose(played["mean quantile"], q.mean())
    mean = played["mean quantile of the world"]
    assert set(np.round(np.unique(mean), 6)) == {
        round(float(q[np.repeat(worlds.T, 40, 0) == name].mean()), 6) for name in ("in", "noise")
    }


def test_a_replayed_stream_has_both_methods_in_both_worlds():
    ride = compute("gate_ride", profile="smoke").table
    assert set(ride["method"]) == {"constant", "quantile"}
    assert set(ride["world"]) == {"in", "noise"}
    ego = ride[ride["car"] == 0]
    assert (ego["x_m"] == 0).all()
    assert (ego.loc[ego["method"] == "constant", "margin_m"] == 3.0).all()
    assert (
        ego.groupby(["method", "episode"])["step"].apply(lambda s: s.is_monotonic_increasing).all()
    )


def test_the_experiments_run_shrunken():
    """On policies that were hardly trained: the real thing, all parts, in one store."""
    stream = compute("gate_stream", profile="smoke").table
    controls = compute("gate_controls", profile="smoke").table
    attempts = compute("gate_attempts", profile="smoke").table
    assert set(stream["method"]) == {"quantile", "frozen", "EWMA", "constant"}
    assert {"oracle", "pi_switch", "donor quantile", "ACI", "speed cap"} <= set(controls["method"])
    assert set(controls["setting"]) == {"changing", "bursts"}
    assert set(attempts["attempt"]) == {"as published", "asymmetric step"}
    for table in (stream, controls):
        assert (table["crashes"] <= table["episodes"]).all()
        assert (table["missed"] <= table["scored"]).all()
        assert table["speed_sum"].between(15 * table["steps"], 41 * table["steps"]).all()
