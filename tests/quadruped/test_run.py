"""One run in a world whose errors are scripted: rows, stop rule, supervisor, oracle, metrics."""

import math

import numpy as np
import pytest

from cpl.quadruped import (
    COLUMNS,
    GainLimits,
    Path,
    Policy,
    PolicyConfig,
    RunConfig,
    SupervisorConfig,
    constant_gain,
    corrected_gain,
    paper_gain,
    path_distance,
    run,
    shape,
    summary,
    windowed_coverage,
)

WIDE = GainLimits(kp_min=0.8, kp_max=4.0)


def constant():
    return Policy(constant_gain, WIDE, PolicyConfig())


def test_an_undisturbed_run_arrives_and_keeps_to_the_path(plain_world):
    path = shape("hexagon")
    rows = list(run(plain_world(), path, constant(), None, 0))
    numbers = summary(rows, path, floor_half_width_m=3.0)
    assert numbers["outcome"] == "arrived"
    assert numbers["start_end_m"] < 0.1
    assert numbers["path_error_m"] < 0.1
    assert (numbers["ate_m"], numbers["slam_error_rate"], numbers["outside_s"]) == (0, 0, 0)
    assert all(tuple(row) != () and set(row) == set(COLUMNS) for row in rows)
    assert [row["outcome"] for row in rows[:-1]] == [""] * (len(rows) - 1)


def test_rows_say_what_was_sent(plain_world):
    world = plain_world()
    rows = list(run(world, shape("triangle"), constant(), None, 0))
    names = ("cmd_v_x_mps", "cmd_v_y_mps", "cmd_yaw_rate_radps")
    assert [tuple(row[n] for n in names) for row in rows[:-1]] == world.commands
    assert [rows[-1][n] for n in names] == [0, 0, 0]


def test_a_run_is_given_up_after_its_time(plain_world):
    rows = list(run(plain_world(), shape("triangle"), constant(), None, 0, RunConfig(max_s=1.0)))
    assert (rows[-1]["outcome"], len(rows)) == ("timeout", 11)


def test_a_wall_ends_the_run(plain_world):
    rows = list(run(plain_world(walls={7}), shape("triangle"), constant(), None, 0))
    assert (rows[-1]["outcome"], len(rows)) == ("wall", 8)


def test_a_lost_robot_is_stopped_and_goes_on(plain_world):
    lost = set(range(10, 20))
    args = (shape("triangle"), constant(), SupervisorConfig(v_max_mps=5), 0)
    rows = list(run(plain_world(errors=lost, lost=lost), *args))
    reasons = [row["supervisor"] for row in rows]
    # The last valid pose came at step 9; stopped half a second later, released 0.3 s after valid.
    assert reasons[14:23] == ["slam_lost"] * 6 + ["recovering"] * 3
    assert rows[-1]["outcome"] == "arrived"
    assert summary(rows, args[0], floor_half_width_m=3)["supervised_s"] == pytest.approx(0.9)


def test_the_fence_ends_the_run(plain_world):
    fence = SupervisorConfig(fence_half_width_m=1.0)
    rows = list(run(plain_world(), shape("triangle"), constant(), fence, 0))
    assert (rows[-1]["outcome"], rows[-1]["supervisor"]) == ("geofence", "geofence")


def test_the_oracle_knows_the_label(plain_world):
    errors = {5, 6, 12}
    policy = Policy(corrected_gain, WIDE, PolicyConfig(), oracle=True)
    rows = list(run(plain_world(errors=errors), shape("triangle"), policy, None, 0))
    alarms = {k for k, row in enumerate(rows) if row["l_hat"] == 1.0}
    assert alarms == {3, 4, 10}
    assert {row["score"] for row in rows[2:]} == {0.0}


def test_an_oracle_needs_a_world_that_forks(plain_world):
    world = plain_world()
    policy = Policy(corrected_gain, WIDE, PolicyConfig(), oracle=True)

    class Unforkable:
        reset, step, provenance = world.reset, world.step, "test"

    with pytest.raises(ValueError, match="world must have fork"):
        next(run(Unforkable(), shape("triangle"), policy, None, 0))


def test_the_printed_rule_runs_faster_into_doubt(plain_world):
    """Every other step fails and the forecast is a constant: q settles at 0.6, l_hat + q at 1.2.

    The printed rule takes that for false positives and runs at its fastest through a world where
    half of all steps fail; the corrected one slows down to the minimum.
    """
    half = set(range(0, 1000, 2))
    gains = {}
    for name, rule in (("paper", paper_gain), ("corrected", corrected_gain)):
        policy = Policy(rule, WIDE, PolicyConfig(q0=0.6), forecast=lambda x: 0.6)
        rows = list(run(plain_world(errors=half), shape("triangle"), policy, None, 0))
        gains[name] = rows[-1]["kp"]
    assert gains == {"paper": WIDE.kp_max, "corrected": WIDE.kp_min}


def test_windowed_coverage_by_hand():
    assert windowed_coverage(np.array([-1, 0, 1, 0]), W=3).tolist() == [pytest.approx(2 / 3)]
    assert windowed_coverage(np.array([-1, 0]), W=2).size == 0
    with pytest.raises(ValueError, match=r"W .* not 0"):
        windowed_coverage(np.array([0]), W=0)


def test_the_distance_to_a_path_is_that_to_its_legs():
    path = Path(name="bend", waypoints=np.array([[0, 0, 0], [1, 0, 0], [1, 1, math.pi / 2]]))
    points = np.array([[0.5, 0.2], [1.3, 0.5], [-3.0, 4.0]])
    np.testing.assert_allclose(path_distance(points, path), [0.2, 0.3, 5.0])
