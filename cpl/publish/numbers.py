"""The numbers that a chapter quotes: read from an execution, and compared with another's.

A number is compared as it is printed: what a page rounds to three digits has moved when the third
digit moved by more than rounding can explain, and not before.
"""

from __future__ import annotations

import ast
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal

__all__ = ["Moved", "compare", "quoted"]

_PREFIX = "application/papermill.record/text/plain"
_NUMBER = re.compile(r"[-+\u2212]?[0-9][0-9,]*(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?")


@dataclass(frozen=True, kw_only=True)
class Moved:
    """One quoted number in two executions.

    Attributes:
        name: What the chapter's text calls it.
        before: As printed in the first execution; empty if it is not there.
        after: As printed in the second.
        beyond: Whether it moved beyond its tolerance.
        change: The largest relative change of a number in it; None if it holds none, or they
            cannot be matched.
    """

    name: str
    before: str
    after: str
    beyond: bool
    change: float | None


def quoted(notebook: str) -> dict[str, str]:
    """Return what the cells of an executed notebook glued, by name, as the text shows it.

    Args:
        notebook: The notebook as JSON.

    Raises:
        ValueError: If it is not a notebook.
    """
    try:
        content = json.loads(notebook)
        outputs = [out for cell in content["cells"] for out in cell.get("outputs", ())]
        found: dict[str, str] = {}
        for out in outputs:
            name = out.get("metadata", {}).get("scrapbook", {}).get("name")
            if name is not None and _PREFIX in out.get("data", {}):
                text = out["data"][_PREFIX]
                joined = text if isinstance(text, str) else "".join(text)
                found[str(name)] = str(ast.literal_eval(joined))
    except (ValueError, SyntaxError, KeyError, TypeError, AttributeError) as error:
        msg = f"notebook must be an executed notebook: {error!r}"
        raise ValueError(msg) from error
    return found


def compare(
    before: Mapping[str, str], after: Mapping[str, str], *, rtol: float = 0.0
) -> list[Moved]:
    """Compare what two executions quote, number by number.

    Two numbers agree if they differ by no more than one unit of the last digit that is printed of
    either, or by the relative tolerance; text around them must be equal.

    Args:
        before: Name -> text, from `quoted`.
        after: The same of the other execution.
        rtol: Relative tolerance on top [-], >= 0.

    Returns:
        One entry for each name whose text differs, in the order of the first execution.

    Raises:
        ValueError: If the tolerance is negative or not finite.

    Examples:
        >>> [m.beyond for m in compare({"a": "0.103", "b": "12 %"}, {"a": "0.104", "b": "19 %"})]
        [False, True]
    """
    if not (math.isfinite(rtol) and rtol >= 0):
        msg = f"rtol must be finite and not negative, got {rtol!r}"
        raise ValueError(msg)
    names = dict.fromkeys((*before, *after))
    pairs = ((name, before.get(name, ""), after.get(name, "")) for name in names)
    return [_moved(name, old, new, rtol) for name, old, new in pairs if old != new]


def _moved(name: str, old: str, new: str, rtol: float) -> Moved:
    ours, theirs = _numbers(old), _numbers(new)
    alike = _NUMBER.sub("#", old) == _NUMBER.sub("#", new) and len(ours) == len(theirs) > 0
    if not alike:
        return Moved(name=name, before=old, after=new, beyond=True, change=None)
    pairs = list(zip(ours, theirs, strict=True))
    change = max(_relative(a, b) for (a, _), (b, _) in pairs)
    beyond = any(abs(a - b) > max(min(ua, ub), _share(rtol, a, b)) for (a, ua), (b, ub) in pairs)
    return Moved(name=name, before=old, after=new, beyond=beyond, change=change)


def _numbers(text: str) -> list[tuple[Decimal, Decimal]]:
    """Return each printed number, with one unit of its last printed digit."""
    found: list[tuple[Decimal, Decimal]] = []
    for match in _NUMBER.finditer(text):
        number = Decimal(match[0].replace(",", "").replace("\u2212", "-"))
        exponent = number.as_tuple().exponent
        # An integer is exact: a count that changed has changed.
        unit = Decimal(1).scaleb(exponent) if isinstance(exponent, int) and exponent else Decimal(0)
        found.append((number, unit))
    return found


def _share(rtol: float, a: Decimal, b: Decimal) -> Decimal:
    return Decimal(rtol) * max(abs(a), abs(b))


def _relative(a: Decimal, b: Decimal) -> float:
    largest = max(abs(a), abs(b))
    return float(abs(a - b) / largest) if largest else 0.0
