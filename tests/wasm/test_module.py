"""The shipped module in node: the native engine's bits on every fixture and every ride."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cpl.conformal import Fixed, RunningMax
from cpl.conformal._kernels import follow
from cpl.experiments.switch.anywhere import Config
from cpl.forecast.methods import Plain
from cpl.highway import Engine
from cpl.network import Portable, decode_networks
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Tracking, drive
from cpl.policies.gate import Gate, Tracked
from cpl.policies.greedy import Greedy
from cpl.policies.switch import Switch
from cpl.store import data_path, project_root
from cpl.wasm import MODULE, gate, module_bytes, stale
from tests.node import node
from tests.wasm import golden
from tests.wasm.job import Job, Ride, Roads, row

FIXTURES = Path(__file__).resolve().parents[1] / "highway" / "fixtures"
ROW = (
    "steps", "crashed", "speed_sum", "last_speed", "distance_m", "overtaken", "safe_steps",
    "changes", "u_sum", "u_steps", "scored", "missed",
)  # fmt: skip


@pytest.fixture(scope="module")
def networks():
    def read(name):
        return decode_networks(data_path("models", f"{name}.safetensors").read_bytes())

    return {
        "safe": read("base_policies-paper/safe-0").network("q"),
        "speed": read("base_policies-paper/speed-0").network("q"),
        "forecaster": read("forecasts-paper/pair-0").network("plain"),
    }


def test_the_module_is_made_of_the_present_code():
    assert stale() == [], "python -m cpl.wasm makes it anew (pip install '.[wasm]' first)"


def test_the_module_needs_nothing_and_is_small():
    assert len(module_bytes()) < 1_000_000
    script = (
        "const m = new WebAssembly.Module(require('fs').readFileSync(process.argv[1]));"
        "console.log(JSON.stringify([WebAssembly.Module.imports(m).length,"
        " WebAssembly.Module.exports(m).map((e) => e.name).sort()]))"
    )
    imports, exports = json.loads(node("-e", script, str(MODULE)))
    assert imports == 0
    assert {"memory", "road_reset", "road_step", "ride_run"} <= set(exports)


@pytest.mark.parametrize("stage", [*golden.STAGES, *golden.INJECTED])
def test_fixtures_are_played_bit_for_bit(stage, tmp_path):
    job = golden.job_of(FIXTURES, stage)
    assert job.differences(job.run(tmp_path)) == []


def test_noise_and_dropout_are_drawn_alike(tmp_path):
    job = Job()
    config = Config(observation_noise=0.05).road()
    roads = Roads(job, config, 2)
    roads.reset([5, 6], "reset")
    for t in range(12):
        roads.step([t % 5, 3], f"step {t}")
    assert job.differences(job.run(tmp_path)) == []


@pytest.mark.parametrize(
    ("driver", "change"),
    [
        ("switch", {}),
        ("switch", {"running": False, "step": 0.05, "delay": 5, "alpha": 0.2}),
        ("switch", {"observation_noise": 0.02, "vehicles_density": 1.5, "q_safe": 0.45}),
        ("no quantile", {"q_safe": 0.2}),
        ("speed", {"top_speed_mps": 30.0}),
        ("safe", {}),
    ],
)
def test_rides_are_those_of_drive(driver, change, networks, tmp_path):
    config = Config(episodes=6, **change)
    safe, speed, plain = (Portable.of(networks[name]) for name in ("safe", "speed", "forecaster"))
    tracking = Tracking(rule=config.rule(), alpha=config.alpha, delay=config.delay)
    table = drive(
        config.road(),
        Drivers(safe=Greedy(safe), speed=Greedy(speed)),
        Always([driver == "safe"]) if driver in ("safe", "speed") else Switch(config.q_safe),
        config.first_seed + np.arange(config.episodes),
        forecast=Plain(plain),
        tracking=None if driver == "no quantile" else tracking,
        path="own",
    ).episodes
    job = Job()
    ride = _ride(job, config, networks, driver)
    for seed in table["seed"]:
        ride.drive(seed)
    _compare(job.run(tmp_path), table)


def test_a_threshold_that_is_carried_over_is_drives(networks, tmp_path):
    config = Config(episodes=5, carry=True)
    safe, speed, plain = (Portable.of(networks[name]) for name in ("safe", "speed", "forecaster"))
    rule = RunningMax(c=config.step)
    table = drive(
        config.road(),
        Drivers(safe=Greedy(safe), speed=Greedy(speed)),
        Switch(config.q_safe),
        config.first_seed + np.arange(config.episodes),
        forecast=Plain(plain),
        tracking=Tracking(rule=rule, alpha=config.alpha, delay=3, carry=True, streams=1),
        path="own",
    ).episodes
    job = Job()
    ride = _ride(job, config, networks, "switch")
    for number, seed in enumerate(table["seed"]):
        ride.drive(seed, forget=number == 0)
    _compare(job.run(tmp_path), table)


def test_the_gate_decides_as_the_package_does(networks, tmp_path):
    config, seeds = Config(), range(20_000_000, 20_000_006)
    fast = Greedy(Portable.of(networks["speed"]))
    job = Job()
    ride = _ride(job, config, networks, "gate")
    tracked, expected = [], []
    for seed in seeds:
        margin = Tracked(Fixed(eta=gate.ETA), 1, alpha=gate.ALPHA, q0=gate.Q0, memory=gate.MEMORY)
        own, engine = Gate(config.road(), 1, margin), Engine(config.road(), 1, path="own")
        own.begin()
        obs, steps = engine.reset([seed]), 0
        while True:
            out = engine.step(own(obs, fast.values(obs)))
            obs, steps = out.obs, steps + 1
            if out.terminated[0] or out.truncated[0]:
                break
        expected.append((steps, bool(out.terminated[0]), float(engine.state().x[0, 0])))
        tracked.append([float(margin.tracker.q[0]), float(margin.scale[0])])
        ride.drive(seed)
        job.steps.append(["take", ride.gate["tracked"], 16])
    found = job.run(tmp_path)
    for k, (steps, crashed, x) in enumerate(expected):
        got = row(found[3 * k], found[3 * k + 1])
        assert (got["steps"], got["crashed"]) == (steps, crashed)
        assert got["start_x"] + got["distance_m"] == pytest.approx(x, abs=1e-9)
        margin = np.array(found[3 * k + 2], np.uint8).view(np.float64)
        np.testing.assert_allclose(margin, tracked[k], rtol=1e-9)


def test_the_tracker_follows_a_stream_bit_for_bit(tmp_path):
    scores = np.random.default_rng(0).uniform(0, 1, 500)
    for rule, delay in ((Fixed(eta=0.05), 1), (RunningMax(c=0.1), 3)):
        steps, ends = rule.steps(scores[None])[0], np.array([200, 500])
        expected, setting = np.empty(500), np.array([0.1, 0.0, 0.0])
        follow(scores, steps, int(len(steps) > 1), ends, delay, 0.1, 0.0, expected)
        job = Job()
        q = job.place(np.zeros(500))
        words = [job.place(scores), 500, job.place(steps), len(steps), job.place(ends), 2, q, delay]
        job.call("track", job.place(np.array(words, np.int32)), job.place(setting))
        job.read(q, expected, "q")
        assert job.differences(job.run(tmp_path)) == []


@pytest.mark.oracle
def test_the_module_can_be_made_again_byte_for_byte():
    pytest.importorskip("ziglang", reason="the extra wasm is not installed")
    script = "from cpl.wasm.lower import build; import sys; sys.stdout.buffer.write(build())"
    command = [sys.executable, "-W", "ignore", "-c", script]
    done = subprocess.run(command, capture_output=True, check=True, cwd=project_root())
    assert done.stdout == module_bytes()


def _ride(job, config, networks, driver):
    return Ride(
        job,
        config.road(),
        networks,
        driver=driver,
        q_safe=config.q_safe,
        alpha=config.alpha,
        share=config.step,
        running=isinstance(config.rule(), RunningMax),
        delay=config.delay,
    )


def _compare(found, table):
    for number, wanted in enumerate(table.to_dict("records")):
        got = row(found[2 * number], found[2 * number + 1])
        assert {name: got[name] for name in ROW} == {name: wanted[name] for name in ROW}
