"""The gate: exact roll-outs, hand-computed tolerances, who is who, what counts as an error."""

from dataclasses import replace

import numpy as np
import pytest

from cpl.conformal import Fixed, Tracker
from cpl.highway import PAPER, Engine, make_config
from cpl.highway.reference import reference_env
from cpl.policies.gate import (
    Adaptive,
    Averaged,
    Constant,
    Decision,
    Gate,
    GateConfig,
    Outcome,
    Recorded,
    Stacked,
    Tracked,
)

ROAD = replace(PAPER, vehicles_count=15)
LIKED = np.array([0.2, 0.5, 0.3, 1.0, 0.1])  # lane left, idle, lane right, faster, slower


def observation(ego, *others):
    """One observation in the engine's units: ego (y, vx), others (dx, dy, dvx, dvy)."""
    obs = np.zeros((1, 5, 5), np.float32)
    y, vx = ego
    obs[0, 0] = [1, 1, y / 16, vx / 80, 0]
    for row, (dx, dy, dvx, dvy) in enumerate(others, 1):
        obs[0, row] = [1, dx / 200, dy / 16, dvx / 80, dvy / 80]
    return obs


def one(margin=0.0, road=PAPER, **settings):
    gate = Gate(road, 1, Constant(margin, 1), GateConfig(**settings))
    gate.begin()
    return gate


@pytest.mark.parametrize("top", [30.0, 40.0, 50.0])
def test_the_ego_car_is_rolled_out_as_the_engine_drives_it(top):
    road = replace(ROAD, target_speeds=tuple(np.linspace(20, top, 3)), vehicles_density=0.5)
    n, rng = 32, np.random.default_rng(0)
    engine, gate = Engine(road, n), Gate(road, n, Constant(-np.inf, n))
    obs = engine.reset(np.arange(n))
    gate.begin()
    start, alive = engine.state().x[:, 0], np.ones(n, np.bool_)
    for _ in range(30):
        out = engine.step(gate(obs, rng.normal(size=(n, 5))))
        obs, state = out.obs, engine.state()
        alive &= ~out.info.crashed & ~state.has_impact[:, 0]
        assert np.abs(gate._place[:, 0] - (state.x[:, 0] - start))[alive].max() < 1e-4
        assert (gate._ego[:, 3] == state.target_lane[:, 0])[alive].all()
        assert (gate._ego[:, 4] == state.target_speed[:, 0])[alive].all()
    assert alive.sum() > 3


def test_what_is_rolled_out_further_is_what_happens_under_the_plan():
    """A car that is really far away is passed at the time and place that D was computed for."""
    road = replace(ROAD, vehicles_count=1, vehicles_density=0.4, enable_lane_change=False)
    engine = Engine(road, 16)
    obs = engine.reset(np.arange(16))
    gate = Gate(road, 16, Constant(0.0, 16), GateConfig(growth=0.0, stride=15, horizon=3))
    gate.begin()
    cars = gate._read(obs)
    tolerated, *_ = gate.look(cars)
    gaps = []
    for action in (3, 4, 4):
        engine.step(np.full(16, action))
        state = engine.state()
        dx, dy = (getattr(state, k)[:, 1] - getattr(state, k)[:, 0] for k in ("x", "y"))
        gaps.append(np.maximum(np.abs(dx) - 5, 3 * (np.abs(dy) - 2)))
    # The other car is forecast at constant speed and drives at its desired speed.
    assert np.abs(np.min(gaps, axis=0) - tolerated[:, 3]).max() < 0.05


def test_tolerances_by_hand():
    obs = observation((4.0, 20.0), (30.0, 0.0, 0.0, 0.0))
    gate = one(growth=0.0, stride=15)
    gate(obs, LIKED[None])
    left, idle, right, faster, slower = gate.sight.tolerated[0]
    assert idle == pytest.approx(25.0, abs=1e-4)  # 30 m less a car's length, at equal speeds
    assert slower == idle  # 20 m/s is the lowest level: the same plan
    # Faster towards 25 m/s for a second and back: closer by 5 (1 - .6 (1 - e^(-5/3))) = 2.6 m and
    # what is left of the difference for another .6 s.
    assert 19.0 < faster < 22.0
    assert left == right > idle  # a lane away after three seconds, but not after one


def test_a_car_in_the_next_lane_tolerates_the_weighted_gap_across():
    obs = observation((4.0, 20.0), (0.0, 4.0, 0.0, 0.0))
    for weight in (1.0, 3.0):
        gate = one(growth=0.0, weight=weight)
        gate(obs, LIKED[None])
        assert gate.sight.tolerated[0, 1] == pytest.approx(2 * weight, abs=1e-4)
        assert gate.sight.tolerated[0, 2] < 0  # into it


def test_later_looks_ask_for_more():
    obs = observation((4.0, 20.0), (30.0, 0.0, 0.0, 0.0))
    flat, growing = one(growth=0.0, stride=15), one(growth=1.0, stride=15)
    flat(obs, LIKED[None])
    growing(obs, LIKED[None])
    # 25 m at all times: at the third second that is 25 of the margin, at the first 75.
    assert growing.sight.tolerated[0, 1] == pytest.approx(flat.sight.tolerated[0, 1], abs=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_tolerance_is_lipschitz_in_where_the_cars_are(seed):
    """D(a) is what it says: cars that are off by e from the forecast cost at most e."""
    rng = np.random.default_rng(seed)
    others = rng.uniform([0, -8, -5, -1], [60, 8, 5, 1], (4, 4))
    for e in (0.5, 2.0, 10.0):
        moved = others.copy()
        moved[:, 0] += rng.uniform(-e, e, 4)
        gates = [one(growth=0.0, forecast="velocity") for _ in range(2)]
        for gate, cars in zip(gates, (others, moved), strict=True):
            gate(observation((4.0, 22.0), *cars), LIKED[None])
        change = np.abs(gates[0].sight.tolerated - gates[1].sight.tolerated)
        assert change.max() <= e + 1e-3


def test_the_best_liked_action_that_tolerates_the_margin_else_the_safest():
    obs = observation((4.0, 20.0), (30.0, 0.0, 0.0, 0.0))
    assert one(0.0)(obs, LIKED[None])[0] == 3
    assert one(24.0, growth=0.0)(obs, LIKED[None])[0] == 1  # faster tolerates about 20
    hemmed = observation((0.0, 25.0), (12.0, 0.0, -5.0, 0.0), (5.0, 4.0, 0.0, 0.0))
    gate = one(1000.0)
    chosen = gate(hemmed, LIKED[None])[0]
    assert gate.sight.tolerated[0, chosen] == gate.sight.tolerated[0].max()
    assert gate.sight.changed[0]
    free = one(1000.0, actions=(3, 4))
    assert free(observation((4.0, 20.0)), LIKED[None])[0] == 3  # nobody there: all is tolerated


def test_cars_are_recognised_whatever_row_shows_them():
    gate = one()
    a, b = (30.0, 0.0, 0.0, 0.0), (50.0, 4.0, 0.0, 0.0)
    for order in ((a, b), (b, a), (a, b)):
        gate(observation((4.0, 20.0), *order), np.array([[0, 1, 0, 0, 0]]))
        seen = gate._past_id[0, 0, :2]
        assert seen.tolist() == ([0, 1] if order[0] is a else [1, 0])
    gate(observation((4.0, 20.0), a, (90.0, 0.0, 0.0, 0.0)), np.array([[0, 1, 0, 0, 0]]))
    assert gate._past_id[0, 0, :2].tolist() == [0, 2]  # a newcomer gets a new number


def test_cars_out_of_sight_are_kept_for_a_while():
    idle = np.array([[0, 1, 0, 0, 0.0]])
    gate = one(memory=2)
    gate(observation((4.0, 20.0), (30.0, 0.0, -2.0, 0.0)), idle)
    for seconds in (1, 2):
        gate(observation((4.0, 20.0)), idle)
        kept = gate._cars[0, 4]
        assert kept[0] == 1.0
        assert kept[1] == pytest.approx(30.0 - 2.0 * seconds, abs=1e-3)
    gate(observation((4.0, 20.0)), idle)
    assert (gate._cars[0, :, 0] == 0).all()
    assert np.isinf(gate.sight.tolerated).all()


@pytest.mark.parametrize(
    ("kind", "error"), [("closing", 6.0), ("position", 6.0), ("clearance", 6.0)]
)
def test_a_car_that_falls_back_is_an_error_of_as_much(kind, error):
    gate, idle = one(error=kind), np.array([[0, 1, 0, 0, 0.0]])
    for second in range(4):
        back = 2.0 * second  # forecast to keep its distance, it loses 2 m each second
        gate(observation((4.0, 20.0), (40.0 - back, 0.0, 0.0, 0.0)), idle)
    assert gate.sight.outcome.known[0].all()
    assert gate.sight.outcome.errors[0] == pytest.approx([2.0, 4.0, error], abs=1e-3)


def test_a_car_that_drives_off_is_no_closing_error():
    gate, idle = one(), np.array([[0, 1, 0, 0, 0.0]])
    for second in range(4):
        gate(observation((4.0, 20.0), (40.0 + 2.0 * second, 0.0, 0.0, 0.0)), idle)
    assert gate.sight.outcome.errors[0, 2] == pytest.approx(-6.0, abs=1e-3)
    assert not gate.sight.missed[0]


def test_nothing_is_scored_across_episodes():
    gate, idle = one(), np.array([[0, 1, 0, 0, 0.0]])
    for _ in range(5):
        gate(observation((4.0, 20.0), (40.0, 0.0, 0.0, 0.0)), idle)
    gate.begin()
    for known in ([False] * 3, [True, False, False], [True, True, False], [True] * 3):
        gate(observation((4.0, 20.0), (40.0, 0.0, 0.0, 0.0)), idle)
        assert gate.sight.outcome.known[0].tolist() == known


def test_highway_env_and_the_engine_are_driven_alike():
    """The gate sees observations only: the same on the real thing."""
    road, _ = make_config(
        config={"vehicles_count": 12, "action": {"target_speeds": [20, 25, 30]}, "duration": 20}
    )
    options = {
        "vehicles_count": 12,
        "duration": 20,
        "action": {"type": "DiscreteMetaAction", "target_speeds": [20, 25, 30]},
    }
    env, engine = reference_env(options), Engine(road, 1)
    changed = 0
    for seed in range(2):
        margins = [Tracked(Fixed(eta=1.0), 1, alpha=0.1, q0=1.0, memory=10) for _ in range(2)]
        gates = [Gate(road, 1, margin) for margin in margins]
        for gate in gates:
            gate.begin()
        theirs, ours = np.asarray(env.reset(seed=seed)[0])[None], engine.reset([seed])
        for _ in range(15):
            a, b = (g(o, LIKED[None]) for g, o in zip(gates, (theirs, ours), strict=True))
            assert a[0] == b[0]
            assert gates[0].sight.margin[0] == pytest.approx(gates[1].sight.margin[0], abs=1e-3)
            changed += int(gates[0].sight.changed[0])
            obs, _, ended, _, _ = env.step(int(a[0]))
            out = engine.step(b)
            theirs, ours = np.asarray(obs)[None], out.obs
            assert ended == bool(out.terminated[0])
            if ended:
                break
    env.close()
    assert changed > 0


def feed(margin, errors, n=1, horizon=3):
    """Feed errors at the longest horizon, each forecast's margin `horizon` decisions before."""
    ring, margins = [np.zeros((n, margin.width))] * horizon, []
    for error in errors:
        known = np.zeros((n, horizon), np.bool_)
        known[:, -1] = np.isfinite(error)
        values = np.zeros((n, horizon))
        values[:, -1] = np.nan_to_num(error)
        outcome = Outcome(
            errors=values, known=known, clearance=values[:, -1], active=np.ones(n, np.bool_)
        )
        margin.learn(outcome, np.stack(ring[::-1][:horizon], axis=1))
        ring = [*ring[1:], margin.issue()]
        margins.append(ring[-1][:, 0].copy())
    return np.array(margins)


def test_the_plain_tracked_margin_is_the_tracker_with_its_delay():
    errors = np.random.default_rng(1).normal(3, 2, 200)
    margin = Tracked(Fixed(eta=0.5), 1, alpha=0.2, q0=2.0)
    issued = feed(margin, np.r_[[np.nan] * 3, errors])[: len(errors), 0]
    tracker, expected = Tracker(Fixed(eta=0.5), alpha=0.2, delay=3, q0=2.0), []
    for error in errors:
        expected.append(tracker.q)
        tracker.update(error)
    assert np.allclose(issued, expected)


def test_scaled_and_plain_cover_what_they_aim_at_when_the_scale_changes():
    rng = np.random.default_rng(2)
    errors = np.abs(rng.normal(size=4000)) * np.repeat([1, 6, 2, 9], 1000)
    for memory, eta in ((None, 0.5), (10, 0.2)):
        margin = Tracked(Fixed(eta=eta), 1, alpha=0.1, q0=1.0, memory=memory)
        margins = feed(margin, errors)
        missed = errors[3:] > margins[:-3, 0]
        assert missed.mean() == pytest.approx(0.1, abs=0.01)


def test_other_margins_follow_the_errors():
    errors = np.abs(np.random.default_rng(3).normal(size=2000)) * np.repeat([1, 5], 1000)
    makers = [
        Averaged(1, memory=20, deviations=1.0, start=(1.0, 1.0)),
        Adaptive(1, alpha=0.1, gamma=0.01, window=60, start=1.0, top=40.0),
    ]
    for margin in makers:
        margins = feed(margin, errors)[:, 0]
        assert margins[1500:].mean() > 3 * margins[200:1000].mean()


def test_adaptive_conformal_inference_reads_the_quantile_of_its_window():
    margin = Adaptive(1, alpha=0.25, gamma=0.0, window=7, start=5.0, top=99.0)
    margins = feed(margin, [1.0, 2, 3, 4, 5, 6, 7])
    # ceil(.75 (n + 1)) th smallest of n: none of 1 and 2, then the third of 3 and so on.
    assert margins[:, 0].tolist() == [99.0, 99.0, 3.0, 4.0, 5.0, 6.0, 6.0]


def test_decision_theory_moves_by_near_misses():
    margin = Decision(1, eta=1.0, epsilon=0.25, near=2.0, start=3.0)
    assert feed(margin, [5.0, 1.0, 5.0])[:, 0].tolist() == [2.75, 3.5, 3.25]


def test_stacked_margins_are_each_their_own():
    errors = np.random.default_rng(4).normal(3, 2, (300, 2))
    alone = [
        feed(Tracked(Fixed(eta=0.5), 1, alpha=a, q0=0.0), errors[:, k])
        for k, a in ((0, 0.1), (1, 0.3))
    ]
    parts = [Tracked(Fixed(eta=0.5), 1, alpha=a, q0=0.0) for a in (0.1, 0.3)]
    both = feed(Stacked([*parts, Constant(7.0, 1)], [1, 1, 1]), np.c_[errors, errors[:, :1]], n=3)
    assert np.array_equal(both[:, 0], alone[0][:, 0])
    assert np.array_equal(both[:, 1], alone[1][:, 0])
    assert (both[:, 2] == 7.0).all()
    replayed = Recorded(both)
    assert np.array_equal(replayed.issue()[:, 0], both[0])
    assert np.array_equal(replayed.issue()[:, 0], both[1])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"horizon": 0}, r"horizon must be in \[1, inf\), got 0"),
        ({"forecast": "crystal"}, "forecast must be in {velocity, lane, idm}, got 'crystal'"),
        ({"weight": -1.0}, r"weight must be in \(0, inf\), got -1.0"),
        ({"growth": -1.0}, r"growth must be in \[0, inf\), got -1.0"),
        ({"actions": (7,)}, r"actions must be some of 0 to 4, got \(7,\)"),
    ],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        GateConfig(**settings)


def test_observations_that_cannot_be_looked_ahead_from_are_refused():
    with pytest.raises(ValueError, match="road must show"):
        Gate(replace(PAPER, absolute=True), 1, Constant(1.0, 1))


def test_the_closed_loop_keeps_the_accounts_and_the_walls():
    """The chapter's theorem: whatever is driven, misses are where the quantile has gone."""
    alpha, eta, h, n = 0.1, 0.5, 3, 8
    margin = Tracked(Fixed(eta=eta), n, alpha=alpha, q0=0.5, memory=10)
    road = replace(PAPER, observation_noise=0.01, vehicles_count=20)
    engine, gate = Engine(road, n), Gate(road, n, margin)
    rng, begins = np.random.default_rng(0), margin.tracker.q
    scored = missed = np.zeros(n)
    scaled = [np.array([0.5])]
    for episode in range(4):
        obs, active = engine.reset(np.arange(n) + n * episode), np.ones(n, np.bool_)
        gate.begin()
        for _ in range(20):
            scale = gate._issued[:, -1, 2]
            actions = gate(obs, rng.normal(size=(n, 5)), active)  # any base policy will do
            known = gate.sight.scored
            assert np.array_equal(gate.sight.missed, margin.missed)
            scaled.append(gate.sight.outcome.errors[known, -1] / scale[known])
            scored, missed = scored + known, missed + margin.missed
            q = margin.tracker.q
            assert np.allclose(eta * (missed - alpha * scored), q - begins, atol=1e-9)
            low, high = (f(np.concatenate(scaled)) for f in (np.min, np.max))
            assert (q <= high + h * (1 - alpha) * eta + 1e-9).all()
            assert (q >= low - h * alpha * eta - 1e-9).all()
            assert (np.abs(missed - alpha * scored) <= (high - low) / eta + h + 1e-9).all()
            out = engine.step(actions)
            obs, active = out.obs, active & ~out.info.crashed
    assert (scored > 20).all()
    assert 0 < missed.sum() < 0.5 * scored.sum()
