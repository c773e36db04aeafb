"""What made a page is written down, and nothing that was typed comes alive in it."""

import shlex

import pytest
from markdown_it import MarkdownIt

from cpl.publish.chapters import find_chapter
from cpl.publish.provenance import command, footer, record, source_state
from cpl.settings.words import settings
from cpl.store import project_root


def test_a_record_says_what_a_result_rests_on(project):
    root = project()
    made = record(find_chapter(root, "small"), {"alpha": 0.2}, root)
    assert made["parameters"]["alpha"] == 0.2
    assert made["parameters"]["T"] == 400
    assert made["chosen"] == {"alpha": 0.2}
    assert made["seeds"] == {"seed": 3}
    assert made["modules"] == ["cpl", "cpl.environ", "cpl.publish", "cpl.publish._glue"]
    assert made["source"] == {"commit": None, "dirty": None, "file": "book/small.md"}
    assert len(made["key"]) == len(made["fingerprint"]) == 64


def test_the_source_state_is_that_of_git():
    state = source_state(project_root())
    assert state["commit"] is None or len(state["commit"]) == 40


@pytest.mark.parametrize(
    "typed", [["alpha=0.2"], ["sizes=3,4", "form=corrected"], ["note=a b; rm -rf 'x'"], []]
)
def test_the_command_sets_the_same_parameters_again(project, typed):
    chapter = find_chapter(project(), "small")
    chosen = settings(chapter.parameters, typed)
    words = shlex.split(command(chapter, chosen))
    assert words[:3] == ["cpl", "run", "small"]
    assert settings(chapter.parameters, words[4::2]) == chosen


@pytest.mark.parametrize(
    "payload",
    [
        "<script>alert(1)</script>",
        "`<img src=x onerror=alert(1)>`",
        "``` {raw} html",
        "```` x ``` y `` z `",
        "[x](javascript:alert(1))",
        "{raw:html}`<b>`",
        "* - <b>new row</b>",
    ],
)
def test_text_that_was_typed_is_shown_as_text(project, payload):
    root = project()
    chapter = find_chapter(root, "small")
    made = record(chapter, {"note": payload}, root) | {"seconds": 1.0}
    tokens = MarkdownIt().parse(footer(chapter, made))
    kinds = {token.type for token in tokens}
    assert "html_block" not in kinds
    dropdown = next(token for token in tokens if "dropdown" in token.info)
    inline = [t for token in MarkdownIt().parse(dropdown.content) for t in token.children or []]
    assert not {"html_inline", "link_open", "image"} & {token.type for token in inline}
    (fence,) = [token for token in tokens if token.info == "bash"]
    assert payload in shlex.split(fence.content)[-1]
