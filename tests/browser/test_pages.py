"""Every page of the book, opened as readers open it."""

import gzip
import re
from urllib.parse import urlsplit

import pytest

pytestmark = pytest.mark.browser

RULES = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa")
FIRST_VIEW = 1.5e6  # bytes, as a static host sends them
WIDTHS = {"desktop": 1280, "phone": 390}
_SETTLE_MS = 600  # the theme looks for what now scrolls a third of a second after a change


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_opens_from_disk_and_is_accessible(site, open_page, page, scheme):
    """On a desktop, and when its window is made as narrow as a phone."""
    tab, watch = open_page((site / page).as_uri(), scheme=scheme, width=WIDTHS["desktop"])
    assert watch.off_site(site.as_uri()) == []
    _says_what_it_is_about(tab, page)
    unset = "[...document.querySelectorAll('.math')].filter(e => !e.querySelector('mjx-container'))"
    assert tab.evaluate(f"{unset}.length") == 0
    assert tab.locator("mjx-merror").count() == 0
    hidden = "[...document.images].filter(i => !i.complete || !i.naturalWidth).map(i => i.src)"
    assert tab.evaluate(hidden) == []
    for width in WIDTHS.values():
        tab.set_viewport_size({"width": width, "height": 850})
        tab.wait_for_timeout(_SETTLE_MS)
        assert tab.evaluate("document.documentElement.scrollWidth - window.innerWidth") <= 0
        assert _violations(tab) == [], width
    assert watch.complaints == []


def test_a_page_opens_on_a_phone_from_a_server(site, server, open_page, page):
    tab, watch = open_page(f"{server}/{page}", width=WIDTHS["phone"])
    assert watch.complaints == []
    assert watch.off_site(server) == []
    assert tab.title()
    assert tab.evaluate("document.documentElement.scrollWidth - window.innerWidth") <= 0
    sent = [_sent(site / urlsplit(url).path.lstrip("/")) for url in set(watch.requests)]
    assert sum(sent) <= FIRST_VIEW


def test_pictures_say_what_they_show(site, page):
    """As a reviewer reads: whole sentences of some length, no file names, none twice."""
    from bs4 import BeautifulSoup

    soup = BeautifulSoup((site / page).read_text(encoding="utf-8"), "html.parser")
    texts = [image.get("alt", "") for image in soup.select("article img")]
    for text in texts:
        assert 40 <= len(text) <= 300, text
        assert not re.search(r"\.(svg|png|jpe?g)\b|^(image|figure|picture|plot) of\b", text, re.I)
        assert text[0].isupper(), text
        assert text.endswith("."), text
    assert len(texts) == len(set(texts))


def _violations(tab):
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(tab, options={"preload": False, "runOnly": list(RULES)})
    return [
        (violation["id"], node["target"], node["failureSummary"])
        for violation in found.response["violations"]
        for node in violation["nodes"]
    ]


def _sent(path):
    """Return how many bytes a static host sends: it compresses text and leaves fonts alone."""
    content = path.read_bytes()
    return len(content) if path.suffix in (".woff2", ".png") else len(gzip.compress(content))


def _says_what_it_is_about(tab, page):
    assert tab.title().strip(" —-")
    assert tab.locator("html[lang]").count() == 1
    assert tab.locator("h1").count() >= 1
    if page.startswith("book/"):
        description = tab.locator('meta[name="description"]')
        assert description.count() == 1
        assert 30 <= len(description.get_attribute("content")) <= 210
