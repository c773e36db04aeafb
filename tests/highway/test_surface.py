"""What programs written for highway-env touch beside `reset` and `step`.

`PLAYED` and `LEFT_OUT` name the tests of highway-env 1.12 that make a highway-v0, by their ids
there: each is either played here against `cpl/highway-v0`, or left out for the reason beside it.
"""

import copy
import multiprocessing
import pickle
import time

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from cpl.highway.env import HighwayEnv
from cpl.highway.reference import reference_env
from cpl.store import project_root

SMALL = {"vehicles_count": 6, "lanes_count": 3}
PLAYED = {
    "envs/test_gym.py::test_env_step[highway-v0]": "test_an_episode_stays_in_its_spaces",
    "envs/test_gym.py::test_env[highway-v0]": "test_gymnasiums_checker_is_content",
    "envs/test_gym.py::test_env_reset_options": "test_reset_options_hold_from_then_on",
    "envs/test_actions.py::test_action_type[DiscreteMetaAction]": "test_configure_then_reset",
    "envs/test_time.py::test_running_time": "test_faster_than_the_clock",
    "envs/test_multiprocessing.py::test_env_in_subprocess[highway-v0]": (
        "test_a_process_of_its_own_finds_the_road_by_module_and_name"
    ),
    "graphics/test_render.py::test_render[highway-v0]": "test_a_picture_has_the_size_asked_for",
    "graphics/test_gym_render_mode.py::TestRenderModeDefaults::test_none_derives_offscreen": (
        "test_render_options_read_as_derived"
    ),
    "graphics/test_gym_render_mode.py::TestRenderModeDefaults::test_rgb_array_derives_offscreen": (
        "test_render_options_read_as_derived"
    ),
    "graphics/test_gym_render_mode.py::TestRenderReturn::test_none_returns_none": (
        "test_without_a_render_mode_there_is_no_picture"
    ),
    "graphics/test_gym_render_mode.py::TestRenderReturn::test_rgb_array_returns_ndarray": (
        "test_a_picture_has_the_size_asked_for"
    ),
}
LEFT_OUT = {
    "envs/test_actions.py::test_action_type[ContinuousAction]": "refused: meta-actions alone",
    "envs/test_actions.py::test_action_type[DiscreteAction]": "refused: meta-actions alone",
    "envs/test_env_preprocessors.py::test_preprocessors": "no road of objects to edit",
    "envs/test_finite_mdp.py::test_compute_ttc_grid_on_highway_env": "no road of objects to read",
    "envs/test_finite_mdp.py::test_compute_ttc_grid_predicts_collision": "no road to edit",
    "envs/test_observations.py::test_occupancy_grid_shape_no_uint8_overflow": (
        "refused: the table of cars alone"
    ),
    "graphics/test_render.py::test_obs_grayscale[highway-v0]": "refused: the table of cars alone",
    "graphics/test_gym_render_mode.py::TestRenderModeDefaults::test_human_derives_onscreen": (
        "no window; highway-env's own needs a display, too"
    ),
    "graphics/test_gym_render_mode.py::TestRenderModeDefaults::test_explicit_override_respected": (
        "no window: offscreen_rendering=False is refused"
    ),
    "graphics/test_gym_render_mode.py::TestRenderReturn::test_human_returns_none": "no window",
    "graphics/test_gym_render_mode.py::TestRenderReturn::"
    "test_rgb_array_with_window_still_returns_ndarray": "no window",
    "graphics/test_gym_render_mode.py::TestRenderReturn::test_human_with_offscreen_returns_none": (
        "no window, so no mode `human`"
    ),
    "graphics/test_gym_render_mode.py::TestDeprecation::test_offscreen_env_var_emits_warning": (
        "the variable was never read here"
    ),
}


def make(**words):
    return gymnasium.make("cpl/highway-v0", **words)


def test_every_test_of_theirs_is_played_or_left_out_for_a_reason():
    assert not PLAYED.keys() & LEFT_OUT.keys()
    assert all(name in globals() for name in PLAYED.values())
    assert all(LEFT_OUT.values())


def test_gymnasiums_checker_is_content():
    check_env(make(**SMALL).unwrapped, skip_render_check=True)


def test_an_episode_stays_in_its_spaces():
    env = make(**SMALL)
    obs, _ = env.reset(seed=0)
    ended = False
    while not ended:
        assert env.observation_space.contains(obs)
        obs, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        ended = terminated or truncated
        assert 0 <= reward <= 1


def test_reset_options_hold_from_then_on():
    env = make(config={"duration": 12}).unwrapped
    assert env.config["duration"] == 12
    env.reset(options={"config": {"duration": 14}})
    assert env.config["duration"] == 14
    env.reset()
    assert env.config["duration"] == 14


def test_configure_then_reset():
    env = make().unwrapped
    env.configure({"action": {"type": "DiscreteMetaAction"}})
    env.reset(seed=0)
    assert env.action_space.contains(env.get_available_actions()[0])


def test_faster_than_the_clock():
    env = make()
    env.reset(seed=0)
    env.step(1)  # compiled by now
    begun = time.perf_counter()
    for _ in range(10):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    assert 10 / env.unwrapped.config["policy_frequency"] > 0.5 * (time.perf_counter() - begun)


def _elsewhere(told):
    env = gymnasium.make("cpl.highway:cpl/highway-v0")
    env.reset(seed=0)
    told.put(env.step(1)[0].shape)


@pytest.mark.oracle
@pytest.mark.parametrize("method", ["forkserver", "spawn"])
def test_a_process_of_its_own_finds_the_road_by_module_and_name(method):
    context = multiprocessing.get_context(method)
    told = context.Queue()
    process = context.Process(target=_elsewhere, args=(told,))
    process.start()
    assert told.get(timeout=300) == (5, 5)
    process.join(timeout=30)


def test_a_picture_has_the_size_asked_for():
    env = make(render_mode="rgb_array", config={"offscreen_rendering": True}, **SMALL)
    env.reset(seed=0)
    config = env.unwrapped.config
    assert env.render().shape == (config["screen_height"], config["screen_width"], 3)
    env.close()


@pytest.mark.parametrize("mode", [None, "rgb_array"])
def test_render_options_read_as_derived(mode):
    config = make(render_mode=mode).unwrapped.config
    assert config["offscreen_rendering"] is True
    assert config["real_time_rendering"] is False


def test_without_a_render_mode_there_is_no_picture():
    env = HighwayEnv(**SMALL)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


def _listed(value):
    return list(value) if isinstance(value, tuple) else value


def test_the_config_reads_like_highway_envs():
    ours, theirs = HighwayEnv(**SMALL).config, reference_env(SMALL).config
    for name, value in theirs.items():
        if isinstance(value, dict):  # ours is longer: it has the defaults, too
            assert all(ours[name][inner] == each for inner, each in value.items())
        else:
            assert _listed(ours[name]) == _listed(value), name
    assert ours.get("no such option", 7) == 7
    assert "lanes_count" in ours
    assert len(dict(ours)) == len(ours)


def test_what_is_set_holds_from_the_next_reset():
    ours, real = HighwayEnv(**SMALL), reference_env(SMALL)
    ours.reset(seed=3)
    real.reset(seed=3)
    for env in (ours, real):
        env.config.update({"vehicles_count": 4, "lanes_count": 2})
        env.config["initial_lane_id"] = 1
    assert ours.step(1)[0].shape == (5, 5)  # the old road drives on
    np.testing.assert_array_equal(ours.reset()[0], real.reset()[0])
    assert ours.config["lanes_count"] == ours.engine.config.lanes_count == 2


def test_what_cannot_be_set_is_refused_and_changes_nothing():
    env = HighwayEnv(**SMALL)
    with pytest.raises(ValueError, match="unknown option lane_count=2"):
        env.config["lane_count"] = 2
    with pytest.raises(ValueError, match="lanes_count must be"):
        env.config.update({"vehicles_count": 2, "lanes_count": 0})
    with pytest.raises(TypeError):
        env.config["observation"]["vehicles_count"] = 9
    with pytest.raises(TypeError, match="has a value always"):
        del env.config["lanes_count"]
    assert env.config["vehicles_count"] == 6


def test_options_of_a_reset_are_never_ignored():
    env = HighwayEnv(**SMALL)
    with pytest.raises(ValueError, match=r"got \['vehicles_count'\]; .*options=\{'config': \{'veh"):
        env.reset(options={"vehicles_count": 3})
    env.reset(options={})


def test_available_actions_are_highway_envs():
    ours, real = HighwayEnv(lanes_count=3, vehicles_count=2), reference_env(
        {"lanes_count": 3, "vehicles_count": 2}
    )  # fmt: skip
    with pytest.raises(ValueError, match="before reset"):
        ours.get_available_actions()
    for seed in range(3):
        ours.reset(seed=seed)
        real.reset(seed=seed)
        for action in (3, 0, 0, 3, 3, 2, 2, 2, 4, 4, 4, 4):
            assert ours.get_available_actions() == real.get_available_actions()
            if ours.step(action)[2] or real.step(action)[2]:
                break


@pytest.mark.parametrize("frequencies", [(15, 2), (15, 4), (10, 3), (5, 5), (7, 6)])
def test_frequencies_that_do_not_divide_drive_as_highway_env(frequencies):
    simulation, policy = frequencies
    options = SMALL | {"simulation_frequency": simulation, "policy_frequency": policy}
    ours, real = HighwayEnv(**options), reference_env(options)
    np.testing.assert_array_equal(ours.reset(seed=5)[0], real.reset(seed=5)[0])
    for action in (3, 0, 1, 2, 3, 1):
        mine, theirs = ours.step(action), real.step(action)
        np.testing.assert_allclose(mine[0], theirs[0], rtol=0, atol=1e-6)
        assert mine[2:4] == theirs[2:4]
        assert mine[1] == pytest.approx(theirs[1], abs=1e-12)


def test_a_copy_after_a_render_drives_and_draws_the_same():
    env = HighwayEnv(render_mode="rgb_array", **SMALL)
    env.reset(seed=1)
    picture = env.render()
    for twin in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        np.testing.assert_array_equal(twin.render(), picture)
        np.testing.assert_array_equal(twin.step(3)[0], copy.deepcopy(env).step(3)[0])
        twin.close()
    env.close()


def test_docstring_and_chapter_have_one_table_of_what_differs():
    rows = [line.strip() for line in HighwayEnv.__doc__.splitlines() if line.strip()[:1] == "|"]
    chapter = (project_root() / "book" / "road.md").read_text(encoding="utf-8")
    assert len(rows) > 5
    assert "\n".join(rows) in chapter
