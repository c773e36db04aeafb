"""A plugin of pytest: leave out what rests on an optional library that is not here, and count it.

    pytest -p tests.fresh.lacking

A test file, or a module with examples, rests on what it or any `cpl` module below it imports. In
the book's own environment nothing lacks and nothing is left out.
"""

from collections import Counter
from importlib.util import find_spec

from cpl.optional import EXTRAS
from cpl.store import external_imports

__all__ = ["pytest_ignore_collect", "pytest_terminal_summary"]

# What `make venv` brings; the rest lacks there as well, and its tests know.
EXPECTED = {name for name, (_, extra) in EXTRAS.items() if extra not in ("browser", "legged")}
LEFT_OUT: Counter[str] = Counter()


def pytest_ignore_collect(collection_path):
    if collection_path.suffix != ".py":
        return None
    needs = external_imports(collection_path) & EXPECTED
    lacks = sorted(name for name in needs if find_spec(name) is None)
    LEFT_OUT.update(lacks[:1])
    return True if lacks else None


def pytest_terminal_summary(terminalreporter):
    for name, count in sorted(LEFT_OUT.items()):
        terminalreporter.write_line(f"left out: {count} files that rest on {name}, which lacks")
