"""The road in a tab: the native engine's bits in Chromium, driven by hand, and in experiments."""

import base64
import io
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cpl.experiments import compute
from cpl.wasm import module_bytes
from tests.wasm import golden

pytestmark = pytest.mark.browser

WHEEL = "book/wheel.html"
ROOT = Path(__file__).resolve().parents[1]
FIXTURES = ROOT / "highway" / "fixtures"
EXECUTOR = ROOT / "wasm" / "executor.js"


@pytest.fixture
def drive(figure):
    """The page with the road loaded, step by step since motion is reduced."""

    def open_(fragment="", **how):
        tab, _ = figure(WHEEL, **how)
        if fragment:
            tab.evaluate("hash => { location.hash = hash; }", fragment)
        stage = tab.locator("figure[data-live=wheel] .live-stage")
        stage.get_by_role("button", name="Drive").click()
        tab.locator("figure[data-live=wheel] .live-stage[data-first]").wait_for()
        return tab, stage

    return open_


def score(stage, driver):
    """A driver's row: seconds, and how it ends."""
    cells = stage.locator(f"tr[data-driver='{driver}'] td").all_inner_texts()
    return int(cells[0]), cells[-1]


@pytest.mark.parametrize("stage", [*golden.STAGES, *golden.INJECTED])
def test_chromium_plays_every_fixture_bit_for_bit(stage, site, open_page):
    job = golden.job_of(FIXTURES, stage)
    tab, _ = open_page((site / WHEEL).as_uri())
    tab.add_script_tag(path=EXECUTOR)
    found = tab.evaluate(
        """([wasm, steps, blob]) => {
          const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
          return runJob(bytes(wasm), JSON.parse(steps), bytes(blob));
        }""",
        [
            base64.b64encode(module_bytes()).decode(),
            json.dumps(job.steps),
            base64.b64encode(bytes(job.blob)).decode(),
        ],
    )
    assert job.differences(found) == []


def test_a_ride_by_keyboard_beside_the_other_drivers(drive):
    tab, stage = drive()
    assert float(stage.get_attribute("data-first")) < 2000  # [ms] until the first step
    before = int(stage.get_attribute("data-step"))
    tab.locator(".live-wheel").focus()
    for key in ("ArrowRight", "ArrowDown", "Enter", "ArrowLeft"):
        tab.keyboard.press(key)
    seconds, end = score(stage, "reader")
    assert seconds == before + 4 or "crash" in end
    for driver in ("safe", "speed", "switch"):
        assert score(stage, driver)[0] >= 4 or "crash" in score(stage, driver)[1]


def test_the_others_drive_as_the_package_does(drive):
    tab, stage = drive()
    pad = tab.locator(".live-wheel")
    for _ in range(45):
        pad.press("Enter")
        if score(stage, "safe")[1] != "drives":
            break
    table = compute(
        "anywhere", drivers=("safe", "speed", "switch"), first_seed=20_000_004, episodes=1
    ).table
    for row in table.itertuples():
        seconds, end = score(stage, row.driver)
        assert (seconds, "✕" in end) == (row.steps, row.crashed)


def test_a_link_leads_to_a_seed_and_its_road(drive):
    tab, stage = drive("seed=7&top=30&pair=1&limit=0.5")
    assert stage.get_attribute("data-seed") == "7"
    assert stage.get_by_label("environment seed").input_value() == "7"
    assert stage.get_by_label("speeds of your car").input_value() == "30"
    stage.get_by_role("button", name="Next seed").click()
    stage.get_by_role("button", name="Link to this seed").click()
    assert tab.evaluate("location.hash") == "#seed=8&top=30&pair=1&limit=0.5"


def test_a_phone_drives_by_its_buttons(drive):
    tab, stage = drive(width=390)
    before = int(stage.get_attribute("data-step"))
    button = stage.get_by_role("button", name="faster")
    assert button.bounding_box()["height"] >= 36
    button.click()
    assert int(stage.get_attribute("data-step")) == before + 1
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390


def test_an_experiment_is_that_of_cpl_compute(figure, tmp_path):
    tab, _ = figure(WHEEL)
    stage = tab.locator("figure[data-live=trial] .live-stage")
    stage.get_by_label("rides of each driver").fill("50")
    stage.get_by_label("limit q_safe").fill("0.4")
    stage.get_by_label("density of the other cars").fill("1.25")
    stage.get_by_role("button", name="Run").click()
    tab.locator("figure[data-live=trial] .live-stage[data-state=done]").wait_for(timeout=120_000)
    with tab.expect_download() as download:
        stage.get_by_role("button", name="Download CSV").click()
    download.value.save_as(tmp_path / "rides.csv")
    text = (tmp_path / "rides.csv").read_text()
    table = pd.read_csv(io.StringIO(text), comment="#")
    assert "# cpl compute anywhere" in text
    expected = compute(
        "anywhere",
        drivers=("switch", "speed", "safe"),
        episodes=50,
        q_safe=0.4,
        vehicles_density=1.25,
    ).table
    assert len(table) == 150
    for name in expected.columns:
        np.testing.assert_array_equal(table[name].to_numpy(), expected[name].to_numpy(), name)


def test_an_experiment_can_be_stopped(figure):
    tab, _ = figure(WHEEL)
    stage = tab.locator("figure[data-live=trial] .live-stage")
    stage.get_by_label("rides of each driver").fill("500")
    run = stage.get_by_role("button", name="Run")
    run.click()
    tab.locator("figure[data-live=trial] .live-stage[data-state=running]").wait_for()
    stage.get_by_role("button", name="Cancel").click()
    assert stage.get_attribute("data-state") == "cancelled"
    run.click()
    tab.locator("figure[data-live=trial] .live-stage[data-state=running]").wait_for()


def test_module_and_data_are_small_and_wait_until_they_are_asked_for(site, server, open_page):
    folder = site / "_static" / "live" / "data"
    assert sum(path.stat().st_size for path in folder.glob("tab*.js")) < 6_000_000
    tab, watch = open_page(f"{server}/{WHEEL}")
    tab.locator("figure[data-live=wheel][data-ready]").wait_for()
    assert not [url for url in watch.requests if "/data/tab" in url]
    tab.locator("figure[data-live=wheel]").get_by_role("button", name="Drive").click()
    tab.locator("figure[data-live=wheel] .live-stage[data-first]").wait_for()
    assert [url for url in watch.requests if "/data/tab" in url]
    assert watch.off_site(server) == []
