"""Verdicts on pages come from the ledger: badges, tables, the line under a title."""

import json
import re
import subprocess
import sys

import pytest

from cpl.claims import committed, ledger, own, table
from cpl.publish.live._facts import ledger_file
from cpl.store import project_root

CONF = """
import sys
sys.path.insert(0, {ext!r})
extensions = ["myst_parser", "reading", "badges"]
exclude_patterns = ["out"]
"""


@pytest.fixture(scope="module")
def papers():
    return ledger()


@pytest.fixture(scope="module")
def facts():
    """What the book is built with; the rules read every published table."""
    return ledger_file()


@pytest.fixture
def site(tmp_path, facts):
    """Build a few pages with the book's extensions; return their texts, or what was complained."""

    def build(*, rows=None, **pages):
        (tmp_path / "conf.py").write_text(CONF.format(ext=str(project_root() / "book" / "_ext")))
        (tmp_path / "_toc.yml").write_text("parts: []\n")
        place = tmp_path / "book" / "_static" / "live" / "data" / "ledger.json"
        place.parent.mkdir(parents=True)
        if rows != []:
            place.write_bytes(facts if rows is None else ledger_file(rows))
        for name, text in pages.items():
            (tmp_path / "book" / f"{name}.md").write_text(text)
        names = "\n".join(f"book/{name}" for name in pages)
        (tmp_path / "index.md").write_text(f"# Front\n\n```{{toctree}}\n{names}\n```\n")
        words = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
        done = subprocess.run(
            [*words, str(tmp_path), str(tmp_path / "out")],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            return done.stderr
        return {name: (tmp_path / "out" / "book" / f"{name}.html").read_text() for name in pages}

    return build


def words(html):
    return " ".join(re.sub("<[^>]*>", " ", html).split())


def test_the_file_holds_the_books_own_claims_beside_the_papers(facts):
    told = json.loads(facts)
    assert [row["row"] for row in told["rows"]] == list(range(1, len(committed()) + 1))
    assert sum(told["counts"].values()) == len(ledger())


def test_a_badge_says_what_the_ledger_says_and_links_there(site, papers):
    holds = f"# What holds\n\n{table(1, 51)}\n"
    pages = site(holds=holds, promise="# A promise\n\nSo it is: {claim}`1` and {claim}`51`.\n")
    first, last = papers[0], own()[0]
    assert f"claim 1 {first.verdict} and ✓ claim 51 {last.verdict} ." in words(pages["promise"])
    assert 'href="holds.html#claim-1"' in pages["promise"]
    assert 'id="claim-1"' in pages["holds"]
    assert pages["holds"].count('<span class="verdict verdict-0">') == 2
    opening = re.search(r'<p class="book-claims">.*?</p>', pages["promise"], re.DOTALL)[0]
    rows = [row.row for row in papers if row.chapter == "promise"]
    assert [int(n) for n in re.findall(r"#claim-(\d+)", opening)] == rows
    assert "book-claims" not in pages["holds"]


def test_flags_stay_beside_the_badge(site, papers):
    row = next(row for row in papers if "paper inconsistent" in row.flags)
    pages = site(holds=f"# What holds\n\n{table(row.row)}\n")
    assert f"{row.verdict} (paper inconsistent)" in words(pages["holds"])


def test_a_typed_or_outdated_verdict_fails_the_build(site):
    typed = str(table(1)).replace("holds |", "does not hold |")
    said = site(holds=f"# What holds\n\n{typed}\n")
    assert "claim 1 is shown as 'does not hold', the ledger says 'holds'" in said


def test_a_claim_that_does_not_exist_fails_the_build(site):
    assert "there is no claim '99' in the ledger" in site(holds="# H\n\n{claim}`99`\n")


def test_without_a_ledger_a_claim_is_named(site):
    pages = site(rows=[], page="# Alone\n\nSee {claim}`7`.\n")
    assert "See claim 7 ." in words(pages["page"])


def test_a_page_that_stands_alone_has_badges_without_links(site, papers):
    pages = site(rows=[1, 7], promise="# A promise\n\nSee {claim}`7`.\n")
    assert f"claim 7 {papers[6].verdict} ." in words(pages["promise"])
    opening = re.search(r'<p class="book-claims">.*?</p>', pages["promise"], re.DOTALL)[0]
    assert f"no. 1: {papers[0].verdict}" in words(opening)
    assert "href" not in opening
