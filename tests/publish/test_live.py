"""Live figures: the tracker of the pages is the package's, packed rides are the recorded ones."""

import json
import re
import struct

import numpy as np
import pandas as pd
import pytest

from cpl.claims import _ledger, ledger
from cpl.experiments import published
from cpl.experiments.listen import replays
from cpl.policies.measures import SUMS
from cpl.publish.live import as_script, files_for_page, files_for_site
from cpl.publish.live._pareto import points
from cpl.publish.live._rides import FRAMES_PER_SECOND, opening_moments, ride_scripts, scenes
from cpl.store import project_root
from tests.node import node
from tests.publish.vectors import tracker_vectors

STATIC = project_root() / "book" / "_static" / "live"


@pytest.fixture(scope="module")
def rides():
    return published("replays", "book")


def value_of(script: str) -> object:
    """Return what a data script puts where figures look for it."""
    return json.loads(re.search(r"\] = (.*?);$", script, re.MULTILINE)[1])


def test_the_tracker_of_the_pages_gives_the_numbers_of_the_package(tmp_path):
    (tmp_path / "vectors.json").write_text(json.dumps(tracker_vectors(), allow_nan=False))
    code = (
        f"const t = require({json.dumps(str(STATIC / 'tracker.js'))});"
        f"const v = require({json.dumps(str(tmp_path / 'vectors.json'))});"
        "console.log(JSON.stringify(t.compare(v)))"
    )
    assert json.loads(node("-e", code)) == []


def test_a_tracker_that_rounds_otherwise_is_noticed(tmp_path):
    vectors = tracker_vectors()
    vectors["tracks"][0]["q"][7] += 1e-15
    vectors["exact"][1]["err"][3] ^= 1
    vectors["bounds"][2]["most"] += 1
    (tmp_path / "vectors.json").write_text(json.dumps(vectors))
    code = (
        f"const t = require({json.dumps(str(STATIC / 'tracker.js'))});"
        f"const v = require({json.dumps(str(tmp_path / 'vectors.json'))});"
        "console.log(t.compare(v).length)"
    )
    assert int(node("-e", code)) == 3


def test_vectors_have_late_feedback_ties_and_infinite_thresholds():
    vectors = tracker_vectors()
    assert {v["delay"] for v in vectors["tracks"]} == {1, 2, 3}
    assert any("Infinity" in v["q"] for v in vectors["tracks"])
    assert any(s == q for v in vectors["exact"] for s, q in zip(v["scores"], v["q"], strict=True))


def test_a_script_refuses_what_json_cannot_say():
    with pytest.raises(ValueError, match="not JSON compliant"):
        as_script("answer", float("nan"))


def test_packed_rides_are_the_recorded_ones(rides):
    packed = scenes(rides.table, rides.config)
    scene = packed[-1]
    ride = next(one for one in scene["rides"] if one["policy"] == "switch")
    here = rides.table.query(
        "top_speed_mps == @scene['top'] and seed == @scene['seed'] and policy == 'switch'"
    )
    ego = here.query("car == 0").sort_values("time_s")
    np.testing.assert_allclose(np.cumsum(ride["ego"]["x"]) / 10, ego["x_m"], atol=0.0501)
    np.testing.assert_allclose(np.cumsum(ride["ego"]["y"]) / 10, ego["y_m"], atol=0.0501)
    assert ride["crashed"] == bool(ego["crashed"].any())
    frames = sum(len(x) for _, x, _, _ in ride["cars"])
    assert frames == len(here) - len(ego)
    decided = ego.dropna(subset="action")
    assert ride["safe"] == decided["safe"].astype(int).tolist()
    assert ride["duration_s"] * FRAMES_PER_SECOND == ride["frames"] - 1


def test_a_page_loads_one_scene_and_finds_the_others_one_by_one(rides):
    scripts = ride_scripts(rides.table, rides.config)
    index = value_of(scripts["rides.js"])
    assert len(scripts) == 1 + len(index["scenes"])
    assert f'["ride-{index["opening"]}"]' in scripts["rides.js"]
    assert max(map(len, scripts.values())) < 250_000


def test_the_opening_scene_is_picked_by_a_rule(rides):
    index = value_of(ride_scripts(rides.table, rides.config)["rides.js"])
    widest = [s for s in index["scenes"] if s["top"] == max(s["top"] for s in index["scenes"])]
    outcome = {s["key"]: {r["policy"]: r["crashed"] for r in s["rides"]} for s in widest}
    fits = [key for key, o in outcome.items() if o["speed"] and not o["switch"]]
    assert index["opening"] == (fits[0] if fits else widest[0]["key"])
    moments = opening_moments(rides.table, rides.config)
    assert len(moments) == 2
    assert all((frame["vehicle"] == 0).sum() == 1 for frame in moments.values())


def test_every_policy_meets_the_same_traffic_at_the_start(rides):
    start = rides.table.query("time_s == 0")
    for _, cars in start.groupby(["top_speed_mps", "seed"]):
        first, *others = (one.drop(columns=NOT_TRAFFIC) for _, one in cars.groupby("policy"))
        for other in others:
            pd.testing.assert_frame_equal(
                first.reset_index(drop=True), other.reset_index(drop=True)
            )


NOT_TRAFFIC = ["policy", "action", "l_tilde", "l_hat", "q", "safe"]


def test_a_ride_is_recorded_the_same_way_twice():
    config = replays.PROFILES["smoke"]
    (shard,) = replays.EXPERIMENT.shards(config)
    once, twice = (replays.EXPERIMENT.run(config, shard) for _ in range(2))
    pd.testing.assert_frame_equal(once, twice)
    assert set(once["policy"]) == {"speed", "switch", "safe"}
    ends = once.query("car == 0").groupby("policy")["time_s"].max()
    assert (ends <= config.duration_s).all()


@pytest.fixture(scope="module")
def counted():
    """Block sums of two methods over three pairs: the second is a little slower."""
    rng = np.random.default_rng(0)
    rows = []
    for method, slower in (("none", 0.0), ("conformal", 0.3)):
        for pair in range(3):
            for level in range(4):
                for block in range(5):
                    sums = dict.fromkeys(SUMS, 0.0) | {
                        "episodes": 20,
                        "steps": 20 * (40 - 5 * level),
                        "crashes": level,
                        "episode_speed_sum": 20 * (22 + level - slower) + rng.normal(),
                        "distance_km": 10.0,
                    }
                    where = {"top_mps": 40.0, "pair": pair, "method": method, "level": level}
                    more = {"calibrated": False, "value": level / 10, "block": block}
                    rows.append({**where, **more, **sums})
    return pd.DataFrame(rows)


def test_points_of_the_explorer_are_means_with_intervals(counted):
    found = points(counted.loc[counted["method"] == "none"])
    assert [p["q_safe"] for p in found] == [0.0, 0.1, 0.2, 0.3]
    assert [p["duration"][0] for p in found] == [40.0, 35.0, 30.0, 25.0]
    assert [p["crashes"][0] for p in found] == [0.0, 0.05, 0.1, 0.15]
    assert [p["collisions"][0] for p in found] == [0.0, 0.1, 0.2, 0.3]
    assert all(low <= value <= high for value, low, high in (p["speed"] for p in found))


def test_points_are_compared_with_a_rival_at_their_own_speed(counted):
    slower = [p["beside"]["none"] for p in points(counted) if p["method"] == "conformal"]
    assert slower[0] == dict.fromkeys(["duration", "crashes", "collisions"])  # none is so slow
    for gap in slower[1:]:  # .3 m/s of a curve that loses 5 s a m/s
        value, low, high = gap["duration"]
        assert low < value < high
        assert value == pytest.approx(-1.5, abs=0.2)


def test_the_explorer_reads_a_rival_as_the_package_does(counted, tmp_path):
    try:
        found = points(published("pareto", "paper").table)
    except FileNotFoundError:
        found = points(counted)
    (tmp_path / "points.json").write_text(json.dumps(found, allow_nan=False))
    code = f"""
        globalThis.self = {{ cplLive: {{ kit: {{ mount() {{}} }} }} }};
        require({json.dumps(str(STATIC / "pareto.js"))});
        const points = require({json.dumps(str(tmp_path / "points.json"))});
        const curve = (p, method) =>
          points.filter((o) => o.range === p.range && o.method === method);
        const rows = points.flatMap((p) => Object.entries(p.beside).flatMap(([rival, gaps]) =>
          Object.entries(gaps).map(([name, gap]) => {{
            const there = self.cplLive.pareto.read(curve(p, rival), p.speed[0], name);
            return [gap && gap[0], there === null ? null : p[name][0] - there];
          }})));
        console.log(JSON.stringify(rows))"""
    rows = json.loads(node("-e", code))
    assert len(rows) == sum(len(gaps) for p in found for gaps in p["beside"].values())
    assert any(gap is not None for gap, _ in rows)
    for gap, shown in rows:
        assert shown == (None if gap is None else pytest.approx(gap, abs=2e-5))


def test_each_live_figure_has_its_data_and_its_picture():
    files = files_for_site("```{live} tracker\n```{live} road\n```{live} pareto\n")
    for name in ("data/rides.js", "data/pareto.js", "data/ledger.json"):
        assert f"_static/live/{name}" in files
    for name in ("tracker", "road", "pareto"):
        assert files[f"_static/live/{name}.svg"].lstrip().startswith(b"<?xml")
    assert sum(map(len, files.values())) < 4e6


def test_a_page_gets_the_data_of_its_own_figures_and_rows(monkeypatch):
    decided, first = [], ledger()[0]
    monkeypatch.setattr(_ledger, "_row", lambda claim, _root: decided.append(claim) or first)
    text = "```{live} tracker\n```\nSee {claim}`20` and {claim}`51`."
    files = files_for_page(text, "theory")
    assert set(files) == {"_static/live/tracker.svg", "_static/live/data/ledger.json"}
    assert [claim.row for claim in decided] == [2, 4, 5, 8, 20, 51]
    assert files_for_page("Nothing.", "preface") == files_for_site("Nothing.") == {}


def test_a_link_to_the_book_has_a_picture_of_the_usual_size():
    picture = files_for_site("{live} tracker")["_static/preview.png"]
    assert picture.startswith(b"\x89PNG")
    assert struct.unpack(">II", picture[16:24]) == (1200, 630)
    assert len(picture) < 200_000
