"""A Chromium, and the built book from disk and from a server."""

import functools
import os
import shutil
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from cpl.store import project_root

SITE = Path(os.environ.get("CPL_SITE", project_root() / "_build" / "html"))
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
)


def pages() -> list[str]:
    """Return the book's pages, relative to the site; empty if the book is not built."""
    found = [path.relative_to(SITE).as_posix() for path in SITE.rglob("*.html")]
    return sorted(p for p in found if not p.startswith("_static/") and p != "index.html")


def pytest_generate_tests(metafunc):
    if "page" in metafunc.fixturenames:
        metafunc.parametrize("page", pages() or ["the book is not built: run make book"])


@dataclass
class Watch:
    """What a tab complained about and whom it asked."""

    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def off_site(self, origin: str) -> list[str]:
        own = (origin, "data:", "blob:")
        return [url for url in self.requests if not url.startswith(own)]


@pytest.fixture(scope="session")
def site() -> Path:
    assert (SITE / "index.html").is_file(), "the book is not built: run make book"
    return SITE


@pytest.fixture(scope="session")
def chromium():
    from playwright.sync_api import sync_playwright

    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    assert path, "no Chromium found: install the package chromium, or set CHROMIUM to its path"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def open_page(chromium):
    """Open addresses in a new window of a given scheme and width, and watch what happens."""
    contexts = []

    def open_(address: str, *, scheme: str = "light", width: int = 1280):
        context = chromium.new_context(
            color_scheme=scheme, viewport={"width": width, "height": 850}, reduced_motion="reduce"
        )
        contexts.append(context)
        tab, watch = context.new_page(), Watch()
        tab.on(
            "console",
            lambda m: watch.complaints.append(m.text) if m.type in ("error", "warning") else None,
        )
        tab.on("pageerror", lambda error: watch.complaints.append(str(error)))
        tab.on("request", lambda request: watch.requests.append(request.url))
        tab.goto(address, wait_until="load")
        tab.evaluate("() => window.MathJax?.startup?.promise")
        return tab, watch

    yield open_
    for context in contexts:
        context.close()


@pytest.fixture
def figure(site, open_page):
    """Open a page from disk and return its live figure, once it stands."""

    def open_(page: str, **how):
        tab, watch = open_page((site / page).as_uri(), **how)
        stage = tab.locator("figure.live[data-ready] .live-stage").first
        stage.wait_for()
        assert watch.complaints == []
        return tab, stage

    return open_


@pytest.fixture(scope="session")
def server(site) -> Iterator[str]:
    """Serve the site on this machine; return its address."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_args):
            pass

    handler = functools.partial(Quiet, directory=str(site))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        thread = threading.Thread(target=http.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{http.server_port}"
        http.shutdown()
        thread.join()
