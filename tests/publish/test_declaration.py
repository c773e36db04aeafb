"""The parameters cell is read, not run, and an incomplete line is an error."""

import pytest

from cpl.publish.declaration import DeclarationError, read_parameters
from cpl.settings.ranges import Choice, Interval


def test_a_declaration_is_read_in_full():
    alpha, form, gaps = read_parameters(
        "alpha: float = 0.1  # [-] (0, 1]: miscoverage, see eq. (4): never confidence\n"
        "form: str = 'a'  # [-] {a, b}: which\n"
        "# form of the theorem\n"
        "gaps: tuple[float, ...] = (1, 2.5)  # [m/s2] any: gaps\n"
    )
    assert alpha.range == Interval(low=0, high=1, low_in=False, high_in=True)
    assert alpha.meaning == "miscoverage, see eq. (4): never confidence"
    assert form.range == Choice(("a", "b"))
    assert form.meaning == "which form of the theorem"
    assert (gaps.unit, gaps.range) == ("m/s2", None)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("alpha = 0.1  # [-] (0, 1): untyped", "name: type = default"),
        ("alpha: float  # [-] (0, 1): no default", "default"),
        ("alpha: complex = 1  # [-] any: unknown type", "type must be one of"),
        ("alpha: float = 0.1  # (0, 1): no unit", "comment must read"),
        ("alpha: float = 0.1  # [-] no range", "comment must read"),
        ("alpha: float = 0.1  # [-] (0, 1):", "comment must read"),
        ("alpha: float = 0.1", "comment must read"),
        ("alpha: float = 0.1  # [-] (1, 0): empty", "empty"),
        ("alpha: float = 0.1  # [-] (a, b): not numbers", "could not convert"),
        ("alpha: float = 2.0  # [-] (0, 1): outside", "must be a float in"),
        ("alpha: float = 1/3  # [-] (0, 1): computed", "malformed"),
        ("T: int = True  # [-] any: not an int", "must be an int"),
        ("form: str = 'c'  # [-] {a, b}: not a choice", "one of"),
        ("form: str = 'a'  # [-] {a, }: an empty choice", "empty"),
        ("sizes: tuple[int, ...] = ()  # [-] any: none", "one or more"),
        ("import os", "name: type = default"),
        ("print('run')", "name: type = default"),
        ("x.y: int = 1  # [-] any: not a name", "name: type = default"),
        ("a: int = 1  # [-] any: a\na: int = 2  # [-] any: a", "declared twice"),
        ("alpha: float = ", "not Python"),
    ],
)
def test_an_incomplete_line_is_refused_with_its_place(line, says):
    with pytest.raises(DeclarationError, match=says) as refusal:
        read_parameters(line, "theory.md")
    assert str(refusal.value).startswith("theory.md")
