"""Each rule of the contract finds the chapter that breaks it, and only that one."""

import nbformat
import pytest

from cpl.publish.chapters import Chapter
from cpl.publish.contract import unexplained_figures, violations

PARAMETERS = "```{code-cell} ipython3\n:tags: [parameters]\nn: int = 1  # [-] [0, 9]: number\n```\n"
PROSE = "This sentence is here so that the text is longer than the code beside it. " * 9 + "\n\n"


def cell(code, options=""):
    return f"```{{code-cell}} ipython3\n{options}{code}\n```\n"


def figure(alt):
    return f"---\nmystnb:\n  image:\n    alt: {alt}\n  figure:\n    name: fig-a\n---\n"


@pytest.fixture
def check(tmp_path, header):
    def run(body, start=f"# Title\n\n{PROSE}{PARAMETERS}"):
        path = tmp_path / "chapter.md"
        return violations(Chapter(name="chapter", path=path, text=header + start + body))

    return run


ALT = "A line that climbs from the lower left to the upper right corner."
DRAW = "from cpl.figures.theory import law\nlaw()"


@pytest.mark.parametrize(
    "body",
    [
        cell("total = 0\nfor k in range(3):\n    total += k"),
        cell("def mine():\n    return 1", ":tags: [exercise]\n"),
        cell(DRAW, figure(ALT)),
        cell("from cpl.figures.table import table\ntable([])"),
        cell("print(n)") * 11,
    ],
)
def test_a_chapter_that_keeps_to_the_contract_passes(check, body):
    assert check(body) == []


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (cell("print(n)") * 12, "13 code cells are more than 12"),
        (cell("x = 1\n" * 16), "16 lines in a cell are more than 15"),
        (cell("def f():\n    return 1"), "FunctionDef belongs into cpl"),
        (cell("class A:\n    pass"), "ClassDef belongs into cpl"),
        (cell("while n:\n    break"), "While belongs into cpl"),
        (cell("try:\n    n\nfinally:\n    n"), "Try belongs into cpl"),
        (cell("if n:\n    async def f():\n        pass"), "AsyncFunctionDef belongs"),
        (cell("n = 2"), "parameter n is assigned again"),
        (cell("for n in (1, 2):\n    pass"), "parameter n is assigned again"),
        (cell(DRAW), "a figure without alt text"),
        (cell(DRAW, figure("too short")), "the alt text has 9 characters"),
        (cell(DRAW, figure("x" * 301)), "the alt text has 301 characters"),
        (cell(DRAW, figure("x" * 60 + ".png")), "the alt text is a file name"),
        (cell(DRAW, figure(ALT)) * 2, "is used twice"),
        (cell("print(" + "1" * 90 + ")\n" * 2) * 8, "outweighs prose"),
    ],
)
def test_a_broken_rule_is_named(check, body, says):
    problems = check(body)
    assert any(says in problem for problem in problems), problems
    assert all(problem.startswith("chapter.md: ") for problem in problems)


def test_title_and_parameters_are_asked_for(check):
    assert "no title" in check("", start=PROSE + PARAMETERS)[0]
    assert "tagged parameters" in check("", start=f"# Title\n\n{PROSE}{cell('print(1)')}")[0]


def test_what_was_drawn_is_counted_in_the_outputs(tmp_path):
    chapter = Chapter(name="a", path=tmp_path / "a.md", text="")
    image = nbformat.v4.new_output("display_data", data={"image/svg+xml": "<svg/>"})
    drawn = nbformat.v4.new_code_cell("plot()", outputs=[image])
    notebook = nbformat.v4.new_notebook(cells=[drawn])
    assert unexplained_figures(chapter, notebook) == [
        "a.md: the figure of 'plot()' has no alt text"
    ]
    drawn.metadata["mystnb"] = {"image": {"alt": ALT}}
    assert unexplained_figures(chapter, notebook) == []
    drawn.outputs.append(image)
    assert "draws 2 figures" in unexplained_figures(chapter, notebook)[0]
