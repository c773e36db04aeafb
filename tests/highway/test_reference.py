"""highway-env opened up: what is read and written back is all that its next frames depend on."""

import numpy as np
import pytest

from cpl.highway.reference import CAR_FIELDS, EGO_FIELDS, read_state, reference_env, write_state

OPTIONS = {"vehicles_count": 6, "lanes_count": 2, "vehicles_density": 2}


@pytest.mark.parametrize("steps", [0, 3, 9])
def test_a_copied_road_goes_on_as_the_original(steps):
    first, second = reference_env(OPTIONS), reference_env(OPTIONS)
    first.reset(seed=5)
    second.reset(seed=6)
    for _ in range(steps):
        first.step(3)
    write_state(second, read_state(first))
    for action in (0, 3, 2):
        ours, theirs = first.step(action), second.step(action)
        np.testing.assert_array_equal(ours[0], theirs[0])
        assert ours[1:4] == theirs[1:4]
        one, two = read_state(first), read_state(second)
        for name in one:
            np.testing.assert_array_equal(one[name], two[name], name)


def test_fields_and_kinds():
    env = reference_env(OPTIONS)
    env.reset(seed=0)
    state = read_state(env)
    assert state.keys() == {*CAR_FIELDS, *EGO_FIELDS}
    for name, kind in (CAR_FIELDS | EGO_FIELDS).items():
        assert state[name].dtype == kind
        assert state[name].shape == ((7,) if name in CAR_FIELDS else ())
    assert state["speed"][0] == 25
    assert state["timer"][0] == state["delta"][0] == 0
    assert (state["delta"][1:] >= 3.5).all()


def test_the_fast_kind_checks_the_ego_only():
    slow, fast = (reference_env(OPTIONS, fast=kind) for kind in (False, True))
    assert [car.check_collisions for car in slow.road.vehicles] == [True] * 7
    assert [car.check_collisions for car in fast.road.vehicles] == [True] + [False] * 6
