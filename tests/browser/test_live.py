"""Each live figure, operated as readers operate it: pointer, keyboard, phone; and in numbers."""

import json

import pytest

from cpl.store import project_root
from tests.publish.vectors import tracker_vectors

pytestmark = pytest.mark.browser

PLAYGROUND, REPLAY, TRADEOFF = "book/playground.html", "book/replay.html", "book/tradeoff.html"


def number(stage, name: str) -> float:
    return float(stage.get_attribute(f"data-{name}"))


def test_the_tracker_gives_the_numbers_of_the_package(figure):
    tab, _ = figure(PLAYGROUND)
    vectors = json.dumps(tracker_vectors(), allow_nan=False)
    assert tab.evaluate(f"cplLive.tracker.compare({vectors})") == []


def test_the_optimal_adversary_attains_the_exact_worst_case(figure):
    _, stage = figure(PLAYGROUND)
    stage.get_by_label("the world").select_option("worst")
    assert number(stage, "fullest") == number(stage, "worst") == 14  # 0.1 * 40 + 1 / 0.1
    stage.get_by_label("delay of the feedback").fill("3")
    assert number(stage, "fullest") == number(stage, "worst") == 16
    assert "the worst case" in stage.get_by_role("status").inner_text()


def test_settings_change_by_keyboard_while_the_picture_follows(figure):
    _, stage = figure(PLAYGROUND)
    before = number(stage, "q")
    slider = stage.get_by_label("η, step size")
    slider.focus()
    for _ in range(5):
        slider.press("ArrowRight")
    assert slider.get_attribute("aria-valuetext") == "0.15"
    assert number(stage, "q") != before


def test_the_adversary_plays_by_keyboard_and_cannot_break_the_bound(figure):
    tab, stage = figure(PLAYGROUND)
    stage.get_by_role("button", name="Be the adversary").press("Enter")
    pad = stage.get_by_role("slider", name="Scores of your own")
    assert pad.evaluate("e => e === document.activeElement")
    tab.keyboard.press("0")
    for _ in range(45):
        tab.keyboard.press("b")
    assert number(stage, "fullest") == number(stage, "worst") == 14
    tab.keyboard.press("ArrowDown")
    assert "step 47" in pad.get_attribute("aria-valuetext")


def test_the_adversary_draws_with_a_pointer(figure):
    tab, stage = figure(PLAYGROUND)
    stage.get_by_role("button", name="Be the adversary").click()
    box = stage.get_by_role("slider", name="Scores of your own").bounding_box()
    tab.mouse.move(box["x"] + box["width"] * 0.3, box["y"] + box["height"] * 0.3)
    tab.mouse.down()
    tab.mouse.move(box["x"] + box["width"] * 0.7, box["y"] + box["height"] * 0.3, steps=8)
    tab.mouse.up()
    assert number(stage, "errors") > 5
    assert number(stage, "fullest") <= number(stage, "worst")


@pytest.mark.parametrize("rule", ["running-max", "trailing-max", "trailing-range", "decaying"])
def test_every_step_rule_draws(figure, rule):
    _, stage = figure(PLAYGROUND)
    stage.get_by_label("step rule").select_option(rule)
    for shift in ("none", "drift", "bursts", "waves"):
        stage.get_by_label("the world").select_option(shift)
    stage.get_by_label("W, window").fill("1")
    stage.get_by_label("delay of the feedback").fill("12")
    assert "NaN" not in stage.inner_html()


def test_rides_are_scrubbed_played_and_chosen(figure):
    tab, stage = figure(REPLAY)
    tab.wait_for_function("document.querySelector('.live-stage').dataset.state === 'ready'")
    slider = stage.get_by_role("slider", name="time")
    slider.fill("2")
    assert number(stage, "t") == 2
    slider.press("Home")
    assert number(stage, "t") == 0
    play = stage.get_by_role("button", name="Play")
    play.press("Enter")
    tab.wait_for_function("Number(document.querySelector('.live-stage').dataset.t) > 0.3")
    stage.get_by_role("button", name="Pause").click()
    other = stage.get_by_label("traffic (seed)").locator("option:not(:checked)").first
    stage.get_by_label("traffic (seed)").select_option(other.get_attribute("value"))
    tab.wait_for_function("document.querySelector('.live-stage').dataset.state === 'ready'")
    top = stage.get_by_label("speed range of the car").locator("option").first
    stage.get_by_label("speed range of the car").select_option(top.get_attribute("value"))
    tab.wait_for_function("document.querySelector('.live-stage').dataset.state === 'ready'")
    assert stage.locator(".live-ride").count() >= 3
    assert "NaN" not in stage.inner_html()


def test_nothing_moves_on_its_own_for_readers_who_asked_for_less_motion(figure):
    tab, stage = figure("book/intro.html")
    before = stage.get_attribute("data-t")
    tab.wait_for_timeout(600)
    assert stage.get_attribute("data-t") == before


def test_the_explorer_shows_published_points_or_says_that_there_are_none(figure):
    tab, stage = figure(TRADEOFF)
    if not tab.evaluate("cplLive.data.pareto !== null"):
        assert "published yet" in stage.inner_text()
        return
    slider = stage.get_by_label("limit q_safe")
    slider.press("Home")
    low = number(stage, "limit")
    slider.press("End")
    assert number(stage, "limit") > low
    stage.get_by_label("against speed").select_option("collisions")
    rival = stage.get_by_label("rival", exact=True)
    before = stage.locator("tbody").inner_text()
    rival.select_option("ensemble")
    assert stage.locator("tbody").inner_text() != before
    stage.get_by_label("compare", exact=True).select_option("points")
    assert rival.is_hidden()
    box = stage.get_by_role("checkbox").first
    rows = number(stage, "rows")
    box.uncheck()
    assert number(stage, "rows") == rows - 1
    assert "NaN" not in stage.inner_html()


@pytest.mark.parametrize("where", [PLAYGROUND, REPLAY, TRADEOFF])
def test_live_figures_fit_a_phone_and_their_text_stays_legible(figure, where):
    tab, stage = figure(where, width=360)
    assert tab.evaluate("document.documentElement.scrollWidth - window.innerWidth") <= 0
    sizes = "[...document.querySelectorAll('.live-stage svg text')]"
    small = f"{sizes}.filter(t => parseFloat(getComputedStyle(t).fontSize) < 12).length"
    assert tab.evaluate(small) == 0
    low = [
        control.bounding_box()["height"]
        for control in stage.locator("input:visible, select:visible, button:visible").all()
    ]
    assert all(height >= 18 for height in low)


def test_without_scripts_a_picture_and_a_text_stand_in(site, chromium):
    context = chromium.new_context(java_script_enabled=False)
    tab = context.new_page()
    tab.goto((site / PLAYGROUND).as_uri())
    fallback = tab.locator("figure.live .live-fallback")
    assert fallback.locator("img").is_visible()
    assert len(fallback.locator("img").get_attribute("alt")) > 80
    assert not tab.locator(".live-stage").is_visible()
    context.close()


def test_on_paper_a_picture_stands_in(figure):
    tab, stage = figure(PLAYGROUND)
    tab.emulate_media(media="print")
    assert not stage.is_visible()
    assert tab.locator("figure.live .live-fallback img").is_visible()


def test_scripts_are_kept_small():
    scripts = (project_root() / "book" / "_static" / "live").glob("*.js")
    assert sum(path.stat().st_size for path in scripts) < 80_000
