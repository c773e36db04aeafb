"""The chapters of Part I name checks that exist, and discuss the errata sent to them."""

import re

import pytest

from cpl.claims.errata import ERRATA, Erratum
from cpl.conformal.certificates import CERTIFICATES
from cpl.store import project_root

CHAPTERS = ("promise", "tracking", "theory", "stretching", "limits", "errata")
CODE = re.compile(r"cpl |\w\(")  # what else stands between backticks and has spaces


def text_of(chapter: str) -> str:
    return (project_root() / "book" / f"{chapter}.md").read_text(encoding="utf-8")


def errata_named_in(text: str) -> set[int]:
    """Numbers in phrases such as `erratum 3`, `errata 13 and 14`, `errata 2 to 8`."""
    named: set[int] = set()
    for phrase in re.findall(r"[Ee]rrat(?:um|a) ([\d, ]+(?:(?:and|to) \d+)?)", text):
        numbers = [int(number) for number in re.findall(r"\d+", phrase)]
        named |= set(range(numbers[0], numbers[-1] + 1)) if "to" in phrase else set(numbers)
    return named


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_every_certificate_that_a_chapter_names_exists(chapter):
    prose = re.sub(r"```\{code-cell\}.*?```", "", text_of(chapter), flags=re.DOTALL)
    phrases = re.findall(r"(?<![`}])`([a-z][^`\n]*? [^`\n]*)`(?!`)", prose)
    unknown = [phrase for phrase in phrases if phrase not in CERTIFICATES]
    assert [phrase for phrase in unknown if not CODE.search(phrase)] == []


@pytest.mark.parametrize("erratum", ERRATA, ids=lambda erratum: str(erratum.number))
def test_every_erratum_is_discussed_where_its_row_sends_the_reader(erratum: Erratum):
    text = text_of(erratum.chapter)
    numbered = re.search(rf"\({erratum.number}\)|number {erratum.number}\b", text)
    assert erratum.number in errata_named_in(text) or numbered
