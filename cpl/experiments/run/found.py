"""Which experiments there are, found by their folders: nothing is registered, nothing imported.

A module below `cpl.experiments` that binds `EXPERIMENT` is an experiment, and its file's name is
the experiment's. The other modules of a folder are what its experiments share.
"""

import re
from functools import lru_cache
from pathlib import Path

__all__ = ["module_of", "names"]

_ROOM = "cpl.experiments"
_MARK = re.compile(r"^EXPERIMENT\b", re.MULTILINE)


def names() -> tuple[str, ...]:
    """Return the names of all experiments, sorted.

    Examples:
        >>> "proximity" in names()
        True
    """
    return tuple(sorted(_found()))


def module_of(name: str) -> str:
    """Return the dotted name of an experiment's module.

    Raises:
        KeyError: If there is no such experiment.

    Examples:
        >>> module_of("proximity")
        'cpl.experiments.road.proximity'
    """
    return _found()[name]


@lru_cache(maxsize=1)
def _found() -> dict[str, str]:
    """Return the experiments' modules by name.

    Raises:
        ValueError: If two files have the same name.
    """
    top = Path(__file__).parents[1]
    found: dict[str, str] = {}
    for path in sorted(top.glob("*/*.py")):
        if not _MARK.search(path.read_text(encoding="utf-8")):
            continue
        module = f"{_ROOM}.{path.parent.name}.{path.stem}"
        if path.stem in found:
            msg = f"two experiments have one name: {found[path.stem]} and {module}"
            raise ValueError(msg)
        found[path.stem] = module
    return found
