"""The batched loop against one road driven by hand, and the controls against what they promise."""

from dataclasses import replace

import numpy as np
import pytest

from cpl.conformal import PI, RunningMax, Tracker
from cpl.highway import PAPER, Engine, nearest_distances
from cpl.highway.proximity import proximity
from cpl.policies.controls import (
    Always,
    Clock,
    Coin,
    LookAhead,
    OracleCrash,
    OracleProximity,
    RandomSwitch,
    Replay,
    capped,
    cruise,
    slower,
)
from cpl.policies.evaluate import Drivers, Tracking, drive
from cpl.policies.switch import Switch, switch, thresholds

ROAD = replace(PAPER, target_speeds=(20.0, 30.0, 40.0), vehicles_count=12, duration=20.0)
SEEDS = np.arange(20_000_000, 20_000_012)
RULE = RunningMax(c=0.1)


def weaving(obs):
    """A fast policy that looks at something: faster, and to the left of a near car."""
    return np.where(obs[:, 1, 1] < 0.1, 0, 3)


def guess(flat):
    """A forecast that is a smooth function of the history."""
    return 0.5 + 0.5 * np.tanh(flat[:, 106] - flat[:, 6]), 0.1 + 0.0 * flat[:, 0]


DRIVERS = Drivers(safe=slower, speed=weaving)


def by_hand(q_safe, seed, tracking):
    """One episode on one road with one tracker, written down from the definitions."""
    engine = Engine(ROAD, 1)
    obs, tracker = engine.reset([seed]), Tracker(tracking.rule, alpha=tracking.alpha)
    seen, issued, truth, rows = [], {}, {}, []
    start, t = engine.state().x[0, 0], 0
    truth[0] = float(proximity(nearest_distances(engine))[0])
    while True:
        seen.append(obs.reshape(1, -1))
        l_hat, q = 0.0, tracker.q
        if len(seen) >= 5:
            l_hat = float(guess(np.concatenate(seen[-5:], axis=1))[0][0])
            issued[t] = (l_hat, q)
        safe = len(seen) < 5 or l_hat + q >= q_safe
        rows.append((safe, q if len(seen) >= 5 else 0.0))
        out = engine.step((slower if safe else weaving)(obs))
        obs, t = out.obs, t + 1
        truth[t] = float(proximity(nearest_distances(engine))[0])
        made = t - tracking.delay
        if made in issued:
            error = truth[made + 3] - issued[made][0]
            met = issued[made][1] if tracking.issued else tracker.q
            tracker.feedback(error if tracking.signed else abs(error), met)
        if out.terminated[0] or out.truncated[0]:
            return {
                "steps": t,
                "crashed": bool(out.info.crashed[0]),
                "safe_steps": sum(row[0] for row in rows),
                "u_sum": sum(row[1] for row in rows),
                "distance_m": engine.state().x[0, 0] - start,
                "scored": sum(k + tracking.delay <= t for k in issued),
            }


@pytest.mark.parametrize(
    "tracking",
    [
        Tracking(rule=RULE, alpha=0.1),
        Tracking(rule=RULE, alpha=0.3, delay=5),
        Tracking(rule=PI(RULE, K_I=0.1, C_sat=5.0), alpha=0.1, issued=False),
        Tracking(rule=RULE, alpha=0.1, signed=True),
    ],
    ids=["default", "late", "PI, present threshold", "signed"],
)
def test_the_batch_drives_as_one_road_by_hand(tracking):
    grid = [0.3, 0.5, 0.9]
    rides = drive(
        ROAD, DRIVERS, Switch(grid), SEEDS[:5],
        settings=3, forecast=guess, tracking=tracking, n_envs=4,
    ).episodes  # fmt: skip
    assert rides[["setting", "seed"]].duplicated().sum() == 0
    for row in rides.itertuples():
        expected = by_hand(grid[row.setting], row.seed, tracking)
        found = {name: getattr(row, name) for name in expected}
        assert found == pytest.approx(expected)
    assert rides["safe_steps"].nunique() > 2


def test_results_do_not_depend_on_how_many_roads_are_driven_at_a_time():
    tables = [
        drive(ROAD, DRIVERS, Switch([0.4, 0.6]), SEEDS, settings=2, forecast=guess,
              tracking=Tracking(rule=RULE, alpha=0.1), n_envs=n).episodes
        for n in (3, 64)
    ]  # fmt: skip
    assert tables[0].equals(tables[1])


def test_carried_thresholds_go_on_in_the_next_episode_of_their_stream():
    tracking = Tracking(rule=RULE, alpha=0.1, carry=True, streams=2)
    steps = drive(
        ROAD, DRIVERS, Switch([0.5]), SEEDS, forecast=guess, tracking=tracking, record=True
    ).steps
    first = steps[steps["step"] == 4].set_index("seed")["u"]
    assert (first.iloc[:2] == 0.0).all()
    assert (first.iloc[2:] != 0.0).all()
    last = steps[steps["step"] >= 4].dropna().groupby("seed")["u"].last()
    assert first.iloc[2] == pytest.approx(last.iloc[0], abs=0.1)


def test_recorded_steps_add_up_to_the_episodes():
    rides = drive(
        ROAD, DRIVERS, Switch([0.5]), SEEDS[:6], forecast=guess,
        tracking=Tracking(rule=RULE, alpha=0.1), record=True,
    )  # fmt: skip
    steps, episodes = rides.steps, rides.episodes.set_index("seed")
    decided = steps[steps["safe"] >= 0]
    assert decided.groupby("seed").size().tolist() == episodes["steps"].tolist()
    assert decided.groupby("seed")["safe"].sum().tolist() == episodes["safe_steps"].tolist()
    np.testing.assert_allclose(decided.groupby("seed")["u"].sum(), episodes["u_sum"])
    wide = steps.set_index(["seed", "step"])
    later = wide["l_tilde"].groupby("seed").shift(-3)
    missed = (later - wide["l_hat"]).abs() > wide["u"]
    assert missed[later.notna()].groupby("seed").sum().tolist() == episodes["missed"].tolist()


def test_another_uncertainty_takes_the_quantile_s_place():
    rides = drive(ROAD, DRIVERS, Switch([0.5]), SEEDS, forecast=guess).episodes
    np.testing.assert_allclose(rides["u_sum"], 0.1 * rides["u_steps"], rtol=1e-6)
    assert (rides["scored"] > 0).any()


def test_roads_that_wait_for_the_last_episode_do_not_count_on():
    """More roads than are needed at the end: their clocks must not run past an episode's length."""
    seen = []

    def watching(moment):
        seen.append(moment.step.max())
        return np.ones(len(moment.step), dtype=bool)

    road = replace(ROAD, duration=5.0)
    drive(road, DRIVERS, watching, SEEDS, n_envs=8)
    assert max(seen) == 5


def test_nothing_is_forecast_without_a_forecaster():
    rides = drive(ROAD, DRIVERS, Always([True, False]), SEEDS, settings=2).episodes
    assert rides[["u_sum", "scored", "missed"]].to_numpy().sum() == 0
    duty = rides["safe_steps"] / rides["steps"]
    assert duty.groupby(rides["setting"]).mean().tolist() == [1.0, 0.0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seeds": []}, "seeds, settings and n_envs"),
        ({"settings": 0}, "seeds, settings and n_envs"),
        ({"tracking": Tracking(rule=RULE, alpha=0.1, delay=2)}, "delay >= the horizon 3"),
        ({"forecast": None, "tracking": Tracking(rule=RULE, alpha=0.1)}, "must have a forecast"),
    ],
)
def test_impossible_drives_are_refused(changes, message):
    given = {"seeds": SEEDS, "settings": 1, "forecast": guess, "tracking": None} | changes
    with pytest.raises(ValueError, match=message):
        drive(ROAD, DRIVERS, Switch([0.5]), given.pop("seeds"), **given)


def test_the_switch_is_safe_at_equality_and_with_an_infinite_quantile():
    assert switch([0.25, 0.25], [0.25, 0.0], 0.5).tolist() == [True, False]
    assert switch([0.0, 0.0], [np.inf, -np.inf], 2.0).tolist() == [True, False]


@pytest.mark.parametrize("q_safe", [-0.1, 2.1, np.nan, [0.3, 3.0], [], [[0.3]]])
def test_thresholds_outside_the_range_are_refused(q_safe):
    with pytest.raises(ValueError, match="q_safe must"):
        thresholds(q_safe)


def duties(chooser, settings):
    rides = drive(ROAD, DRIVERS, chooser, SEEDS, settings=settings).episodes
    return rides.assign(duty=rides["safe_steps"] / rides["steps"])


def test_clocks_change_over_once():
    early = duties(Clock([0, 8, 20], safe_first=True), 3)
    assert early["changes"].max() == 1
    assert (early["safe_steps"] == np.minimum(early["steps"], early["setting"].map({0: 0, 1: 8, 2: 20}))).all()  # fmt: skip  # noqa: E501
    late = duties(Clock([8], safe_first=False), 1)
    assert (late["safe_steps"] == np.maximum(late["steps"] - 8, 0)).all()


def test_the_coin_decides_for_whole_episodes_and_the_dice_for_steps():
    coin = duties(Coin([0.5], episodes=12, seed=1), 1)
    assert set(coin["duty"]) == {0.0, 1.0}
    dice = duties(RandomSwitch([0.3], episodes=12, steps=20, seed=1), 1)
    assert dice["safe_steps"].sum() / dice["steps"].sum() == pytest.approx(0.3, abs=0.12)
    with pytest.raises(ValueError, match="share must lie"):
        Coin([1.5], episodes=1, seed=0)


def test_a_replayed_quantile_is_the_recorded_one():
    """Replaying every episode its own trace gives the same ride."""
    tracking = Tracking(rule=RULE, alpha=0.1)
    own = drive(ROAD, DRIVERS, Switch([0.5]), SEEDS, forecast=guess, tracking=tracking, record=True)
    traces = own.steps.pivot_table(index="seed", columns="step", values="u", dropna=False)
    filled = traces.ffill(axis=1).fillna(0.0).to_numpy()[None]
    again = drive(ROAD, DRIVERS, Replay([0.5], filled), SEEDS, forecast=guess).episodes
    same = ["steps", "crashed", "safe_steps", "distance_m"]
    assert again[same].equals(own.episodes[same])
    with pytest.raises(ValueError, match="traces must have shape"):
        Replay([0.5, 0.6], filled)


def test_a_constant_added_to_the_forecast_only_shifts_the_threshold():
    """The frontier of split conformal constants is the one of "No Quantile"."""
    constant = drive(ROAD, DRIVERS, Replay([0.6], np.full((1, 1, 20), 0.25)), SEEDS, forecast=guess)
    plain = drive(ROAD, DRIVERS, Switch([0.35]), SEEDS, forecast=lambda x: (guess(x)[0], None))
    same = ["steps", "crashed", "safe_steps", "distance_m"]
    assert constant.episodes[same].equals(plain.episodes[same])


def test_the_look_ahead_is_what_then_happens():
    engine = Engine(ROAD, len(SEEDS))
    obs = engine.reset(SEEDS)
    look = LookAhead(weaving, 6)
    near, crashed = look(engine, obs)
    for k in range(6):
        out = engine.step(weaving(obs))
        obs = out.obs
        np.testing.assert_array_equal(proximity(nearest_distances(engine)), near[k])
        np.testing.assert_array_equal(out.info.crashed, crashed[k])
    assert crashed.any()
    with pytest.raises(ValueError, match="steps must be >= 1"):
        LookAhead(weaving, 0)


def test_a_car_that_sees_crashes_coming_has_fewer():
    plain = drive(ROAD, DRIVERS, Always([False], after=4), SEEDS, forecast=guess).episodes
    seeing = drive(ROAD, DRIVERS, OracleCrash([2, 4], weaving), SEEDS, settings=2, forecast=guess)
    rates = seeing.episodes.groupby("setting")["crashed"].mean()
    assert rates[1] < plain["crashed"].mean()
    near = drive(ROAD, DRIVERS, OracleProximity([0.0, 2.0], weaving), SEEDS, settings=2,
                 forecast=guess).episodes.groupby("setting")["safe_steps"].sum()  # fmt: skip
    assert near[0] > near[1] == 4 * len(SEEDS)


def test_limits_of_speed():
    assert capped(ROAD, 30.0).target_speeds == (20.0, 25.0, 30.0)
    assert cruise(ROAD, 23.0).target_speeds == (23.0, 24.0)
    rides = drive(cruise(ROAD, 23.0), Drivers(safe=slower, speed=slower), Always([True]), SEEDS)
    assert rides.episodes["last_speed"][~rides.episodes["crashed"]].to_numpy() == pytest.approx(23.0, abs=0.1)  # fmt: skip  # noqa: E501
