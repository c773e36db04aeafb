"""highway-env's option names, nested and flat."""

import pytest

from cpl.highway import Config, change_config, highway_env_options, make_config
from cpl.highway.reference import reference_env


def test_defaults_are_highway_envs():
    assert make_config()[0] == Config()
    real = reference_env({}).config
    ours = highway_env_options(Config())
    for name, value in ours.items():
        if name not in ("observation", "action"):
            assert real[name] == value, name


def test_highway_envs_own_default_config_is_accepted():
    from highway_env.envs.highway_env import HighwayEnv

    options = HighwayEnv.default_config()
    assert make_config(**options)[0] == Config()
    assert make_config(config=options)[0] == Config()


def test_round_trip_through_highway_envs_dictionary():
    config = Config(
        vehicles_count=7,
        target_speeds=(20, 30, 40),
        see_behind=True,
        features=("presence", "x", "heading"),
        features_range={"x": (-50, 50)},
        initial_lane_id=1,
    )
    assert make_config(**highway_env_options(config))[0] == config


def test_both_spellings_mean_the_same():
    flat = make_config(see_behind=True, observation_vehicles_count=7, target_speeds=(20, 30, 40))
    nested = make_config(
        config={
            "observation": {"type": "Kinematics", "vehicles_count": 7, "see_behind": True},
            "action": {"type": "DiscreteMetaAction", "target_speeds": [20, 30, 40]},
        }
    )
    assert flat == nested


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lane_count": 3}, "unknown option lane_count=3"),
        ({"observation": {"vehicle_count": 3}}, "unknown option observation.vehicle_count=3"),
        ({"action": {"speeds": (1, 2)}}, "unknown option action.speeds"),
        ({"config": {"nonsense": None}}, "unknown option nonsense=None"),
        ({"observation": {"type": "GrayscaleObservation"}}, "observation.type must be"),
        ({"action": {"type": "ContinuousAction"}}, "action.type must be 'DiscreteMetaAction'"),
        ({"action": {"lateral": False}}, "action.lateral must be True"),
        ({"controlled_vehicles": 2}, "controlled_vehicles must be 1"),
        ({"other_vehicles_type": "other"}, "other_vehicles_type must be"),
        ({"observation": 5}, "observation must be a dictionary of options, got 5"),
        ({"see_behind": True, "observation": {"see_behind": True}}, "see_behind is given twice"),
        ({"lanes_count": 0}, "lanes_count must be an integer in"),
        ({"vehicles_density": -1}, "vehicles_density must be"),
        ({"target_speeds": ()}, "target_speeds must be"),
        ({"target_speeds": (30, 20)}, "target_speeds must be"),
        ({"simulation_frequency": 15, "policy_frequency": 16}, "simulation_frequency must be"),
        ({"duration": float("nan")}, "duration must be"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        make_config(**options)


def test_change_keeps_the_rest():
    config, picture = make_config(lanes_count=3, screen_width=900)
    changed, drawn = change_config(config, picture, {"vehicles_count": 5, "scaling": 3})
    assert (changed.lanes_count, changed.vehicles_count) == (3, 5)
    assert (drawn["screen_width"], drawn["scaling"]) == (900, 3)
