"""Pictures: the engine's state through highway-env's renderer is highway-env's picture."""

import numpy as np
import pytest

from cpl.highway import Config, HighwayEnv, Renderer
from cpl.highway.reference import read_state, reference_env, write_state

SMALL = {"vehicles_count": 6, "lanes_count": 3}


def test_picture_is_highway_envs():
    ours = HighwayEnv(render_mode="rgb_array", **SMALL)
    real = reference_env(SMALL)
    real.render_mode = "rgb_array"
    ours.reset(seed=1)
    real.reset(seed=1)
    for action in (3, 0, 3):
        ours.step(action)
        real.step(action)
        np.testing.assert_array_equal(ours.render(), real.render())
    ours.close()
    real.close()
    assert ours.render().shape == (150, 600, 3)
    ours.close()


def test_crash_is_seen():
    env = reference_env(SMALL)
    env.reset(seed=0)
    renderer = Renderer(Config(**SMALL), {"screen_width": 900, "scaling": 4.0})
    state = read_state(env)
    before = renderer.draw(state)
    state["crashed"][0] = True
    assert before.shape == (150, 900, 3)
    assert not np.array_equal(before, renderer.draw(state))
    renderer.close()


def test_bad_pictures():
    with pytest.raises(ValueError, match="picture has no option screen_wide"):
        Renderer(Config(), {"screen_wide": 3})
    with pytest.raises(ValueError, match="scaling must be positive, got 0"):
        Renderer(Config(), {"scaling": 0})
    env = reference_env(SMALL)
    with pytest.raises(ValueError, match="state has 6 cars; the road has 7"):
        write_state(env, {name: value[:6] for name, value in read_state(env).items() if value.ndim})
