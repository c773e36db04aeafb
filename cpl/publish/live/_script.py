"""Data as a classic script: a page opened from disk may load that, and nothing else."""

from __future__ import annotations

import json

__all__ = ["as_script"]


def as_script(name: str, value: object) -> str:
    """Return a script that puts a value where live figures look for it.

    Args:
        name: Under which name.
        value: Anything that JSON can say.

    Returns:
        The script's text.

    Raises:
        ValueError: If the value holds a number that JSON cannot say, such as an infinity.

    Examples:
        >>> print(as_script("answer", [42]))
        ((self.cplLive ??= {}).data ??= {})["answer"] = [42];
        <BLANKLINE>
    """
    content = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return f"((self.cplLive ??= {{}}).data ??= {{}})[{json.dumps(name)}] = {content};\n"
