"""Episodes as JSON: exact frames, and a reader that takes nothing else."""

import json

import numpy as np
import pytest

from cpl.highway import Config, Engine, export_replay, read_replay, record_replay

CONFIG = Config(vehicles_count=4, lanes_count=2, duration=4, features_range={"x": (-100, 100)})
ACTIONS = [3, 0, 2]


@pytest.fixture
def replay():
    series = {"q": [0.1, np.nan, 0.3]}
    return record_replay(CONFIG, 11, ACTIONS, label="weaver", series=series)


def test_every_frame_is_the_engines(replay):
    engine = Engine(CONFIG, 1)
    engine.reset([11])
    for decision, action in enumerate(ACTIONS, start=1):
        out = engine.step([action])
        state, frame = engine.state(), decision * CONFIG.frames
        np.testing.assert_array_equal(replay.x_m[frame], state.x[0])
        np.testing.assert_array_equal(replay.y_m[frame], state.y[0])
        np.testing.assert_array_equal(replay.heading_rad[frame], state.heading[0])
        np.testing.assert_array_equal(replay.speed_mps[frame], state.speed[0])
        np.testing.assert_array_equal(replay.crashed[frame], state.crashed[0])
        assert replay.reward[decision - 1] == out.reward[0]
    assert len(replay.x_m) == 3 * CONFIG.frames + 1


def test_noise_in_the_eyes_does_not_move_the_cars(replay):
    noisy = record_replay(
        Config(**{**vars(CONFIG), "observation_noise": 0.5, "order": "shuffled"}), 11, ACTIONS
    )
    np.testing.assert_array_equal(noisy.x_m, replay.x_m)


def test_round_trip(tmp_path, replay):
    path = export_replay(tmp_path / "folder" / "episode.json", replay)
    again = read_replay(path)
    assert again.config == CONFIG
    assert (again.seed, again.label) == (11, "weaver")
    for name, digits in (("x_m", 3), ("y_m", 3), ("heading_rad", 4), ("speed_mps", 3)):
        np.testing.assert_array_equal(getattr(again, name), np.round(getattr(replay, name), digits))
    for name in ("action", "reward", "crashed"):
        np.testing.assert_array_equal(getattr(again, name), getattr(replay, name))
    np.testing.assert_array_equal(again.series["q"], [0.1, np.nan, 0.3])
    assert [path.name for path in path.parent.iterdir()] == ["episode.json"]


def test_the_file_says_what_a_viewer_needs(tmp_path, replay):
    document = json.loads(export_replay(tmp_path / "episode.json", replay).read_text())
    assert document["road"] == {"lanes_count": 2, "lane_width_m": 4.0}
    assert document["car"] == {"length_m": 5.0, "width_m": 2.0}
    assert (document["frame_rate_hz"], document["frames_per_decision"]) == (15, 15)
    assert document["outcome"]["duration_s"] == 3
    assert document["decisions"]["series"]["q"] == [0.1, None, 0.3]
    assert len(document["frames"]["x_m"]) == 46
    assert len(document["frames"]["x_m"][0]) == 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(version=2), "format and version must be"),
        (lambda d: d.pop("seed"), "seed is missing or not a int"),
        (lambda d: d["config"].update(lanes_count=0), "lanes_count must be an integer"),
        (lambda d: d["config"].update(wheels=3), "config does not fit"),
        (lambda d: d["decisions"]["action"].append(1), "x_m has shape"),
        (lambda d: d["decisions"]["action"].__setitem__(0, 9), "action holds something else"),
        (lambda d: d["decisions"]["reward"].pop(), "reward has shape"),
        (lambda d: d["decisions"]["series"].update(q=[1]), "q has shape"),
        (lambda d: d["frames"]["x_m"].pop(), "x_m has shape"),
        (lambda d: d["frames"]["x_m"][0].pop(), "x_m is not an array of numbers"),
        (lambda d: d["frames"]["x_m"][0].__setitem__(0, None), "frames hold a null"),
        (lambda d: d["frames"]["speed_mps"].__setitem__(0, "fast"), "speed_mps is not an array"),
        (lambda d: d["frames"]["crashed"].__setitem__(0, [77]), "crashed names car 77"),
        (lambda d: d["frames"].pop("crashed"), "crashed is missing"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path, replay, change, message):
    path = export_replay(tmp_path / "episode.json", replay)
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(ValueError, match=message):
        read_replay(path)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"a": NaN}', "null"])
def test_no_replay_at_all(tmp_path, text):
    path = tmp_path / "episode.json"
    path.write_text(text)
    with pytest.raises(ValueError, match="is not a replay"):
        read_replay(path)


def test_bad_recordings():
    with pytest.raises(ValueError, match="series 'q' has shape"):
        record_replay(CONFIG, 1, ACTIONS, series={"q": [1.0]})
    with pytest.raises(ValueError, match="actions must be in"):
        record_replay(CONFIG, 1, [7])
    with pytest.raises(ValueError, match="the episode ended at 4"):
        record_replay(CONFIG, 1, [4] * 6)
    with pytest.raises(ValueError, match="seeds must not be negative"):
        record_replay(CONFIG, -1, ACTIONS)
