"""The notation page names things as the code does: each code name is defined somewhere in `cpl`."""

import ast
import re

import pytest

from cpl.store import project_root

ROOT = project_root()


def names_in_the_table() -> list[str]:
    """Return the names in the table's column `code`, without indices and dots."""
    rows = [line for line in (ROOT / "book" / "notation.md").read_text().splitlines() if line]
    cells = [[part.strip() for part in re.split(r"(?<!\\)\|", row)[1:-1]] for row in rows]
    table = [row for row in cells if len(row) >= 4]
    head = table[0].index("code")
    quoted = [re.findall(r"`([^`]+)`", row[head]) for row in table[2:]]
    return [re.match(r"\w+", name)[0] for names in quoted for name in names]


def names_defined_in_cpl() -> set[str]:
    """Collect what cpl gives a name: functions, classes, arguments, variables, fields."""
    found: set[str] = set()
    for path in (ROOT / "cpl").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                found.add(node.name)
            elif isinstance(node, ast.arg):
                found.add(node.arg)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                found.add(node.id)
            elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                found.add(node.attr)
    return found


DEFINED = names_defined_in_cpl()


def test_the_table_names_what_the_theory_needs():
    assert {"alpha", "eta", "B", "W", "q", "err", "l", "l_tilde"} <= set(names_in_the_table())


@pytest.mark.parametrize("name", names_in_the_table())
def test_a_name_of_the_table_exists_in_the_code(name):
    assert name in DEFINED
