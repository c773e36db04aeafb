"""What readers do: search, follow links, open the contents on a phone, change the light."""

from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import nbformat
import pytest

pytestmark = pytest.mark.browser


@pytest.mark.parametrize("how", ["from disk", "from a server"])
def test_search_finds_a_page_and_leads_there(site, server, open_page, how):
    base = site.as_uri() if how == "from disk" else server
    tab, watch = open_page(f"{base}/search.html?q=quantile")
    result = tab.locator("#search-results li a").first
    result.wait_for()
    tab.wait_for_load_state("networkidle")
    assert watch.complaints == []
    assert watch.off_site(base) == []
    result.click()
    assert "quantile" in tab.locator("main").inner_text().lower()


def test_the_search_field_of_a_page_is_reached_by_keyboard(site, open_page):
    tab, _ = open_page((site / "book" / "intro.html").as_uri())
    tab.keyboard.press("Control+k")
    tab.keyboard.type("tracker")
    tab.keyboard.press("Enter")
    tab.locator("#search-results li a").first.wait_for()


def test_the_contents_open_on_a_phone(site, open_page):
    tab, watch = open_page((site / "book" / "intro.html").as_uri(), width=390)
    tab.locator(".bd-header-article .primary-toggle").click()
    tab.locator("dialog[open] a.internal").last.wait_for(state="visible")
    tab.keyboard.press("Escape")
    assert watch.complaints == []


def test_a_reader_can_choose_dark_pages(site, open_page):
    tab, _ = open_page((site / "book" / "intro.html").as_uri())
    shades = {tab.evaluate("getComputedStyle(document.body).backgroundColor")}
    for _ in range(2):  # auto, light, dark
        tab.locator(".bd-header-article .theme-switch-button").click()
        tab.mouse.move(0, 0)
        shades.add(tab.evaluate("getComputedStyle(document.body).backgroundColor"))
    assert len(shades) == 2


@pytest.mark.parametrize("how", ["from disk", "from a server"])
def test_the_entrance_leads_to_the_front_page(site, server, chromium, how):
    tab = chromium.new_page()
    tab.goto(f"{site.as_uri() if how == 'from disk' else server}/index.html")
    tab.wait_for_url("**/book/*.html")
    assert tab.locator("article h1").first.is_visible()
    tab.close()


class _Links(HTMLParser):
    def __init__(self):
        super().__init__()
        self.addresses: list[str] = []
        self.loaded: list[str] = []
        self.ids: set[str] = set()

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.ids |= {values[key] for key in ("id", "name") if values.get(key)}
        address = values.get("href") or values.get("src")
        if address:
            (self.addresses if tag == "a" else self.loaded).append(address)


def read(path):
    links = _Links()
    links.feed(path.read_text(encoding="utf-8"))
    return links


def test_links_lead_somewhere_and_nothing_is_loaded_from_elsewhere(site):
    files = [path for path in site.rglob("*.html") if "_static" not in path.parts]
    parsed = {path.resolve(): read(path) for path in files}
    dangling = []
    for path, links in parsed.items():
        assert not [a for a in links.loaded if urlsplit(a).scheme in ("http", "https")]
        for address in links.addresses + links.loaded:
            parts = urlsplit(address)
            if parts.scheme:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            known = parsed[target].ids if target in parsed else None
            lost = known is not None and parts.fragment and unquote(parts.fragment) not in known
            if not target.exists() or lost:
                dangling.append((path.name, address))
    assert dangling == []


def test_the_notebooks_beside_the_pages_are_valid_and_executed(site):
    notebooks = list((site / "_sources").rglob("*.ipynb"))
    assert notebooks
    for path in notebooks:
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        code = [cell for cell in notebook.cells if cell.cell_type == "code"]
        assert all(cell.execution_count for cell in code if cell.source.strip())


def test_the_site_is_small(site):
    sizes = [path.stat().st_size for path in site.rglob("*") if path.is_file()]
    assert sum(sizes) <= 40e6
