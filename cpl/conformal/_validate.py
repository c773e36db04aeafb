"""What the trackers accept, said once: every refusal is a ``ValueError`` with name and value."""

import operator
from numbers import Real
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Bounds",
    "as_bounds",
    "as_choice",
    "as_integer",
    "as_number",
    "as_positive",
    "as_probability",
    "as_score",
    "as_scores",
    "as_share",
]

Bounds: TypeAlias = tuple[float, float]


def as_number(name: str, value: object) -> float:
    """Return a finite real number as a float; a ``bool`` or a string is none."""
    if not isinstance(value, Real) or isinstance(value, bool | np.bool_):
        msg = f"{name} must be a real number, got {value!r}"
        raise ValueError(msg)
    try:
        number = float(value)
    except OverflowError:
        number = float("inf")
    if number - number != 0.0:  # NaN and the infinities
        msg = f"{name} must be finite, got {value!r}"
        raise ValueError(msg)
    return number


def as_positive(name: str, value: object, *, or_zero: bool = False) -> float:
    """Return a finite number above zero (or zero itself where that is allowed)."""
    number = as_number(name, value)
    if number < 0.0 or (number == 0.0 and not or_zero):
        msg = f"{name} must be {'>= 0' if or_zero else '> 0'}, got {value!r}"
        raise ValueError(msg)
    return number


def as_probability(name: str, value: object) -> float:
    """Return a number strictly between 0 and 1."""
    number = as_number(name, value)
    if not 0.0 < number < 1.0:
        msg = f"{name} must lie strictly between 0 and 1, got {value!r}"
        raise ValueError(msg)
    return number


def as_share(name: str, value: object, *, below: float | None = None) -> float:
    """Return a number in [0, 1], or in [0, ``below``)."""
    number = as_number(name, value)
    if not 0.0 <= number <= 1.0 or (below is not None and number >= below):
        msg = (
            f"{name} must lie in [0, {1 if below is None else f'{below:g}'}{')' if below else ']'}"
        )
        raise ValueError(f"{msg}, got {value!r}")
    return number


def as_choice(name: str, value: object, choices: tuple[str, ...]) -> str:
    """Return one of some words."""
    if not isinstance(value, str) or value not in choices:
        msg = f"{name} must be one of {', '.join(choices)}, got {value!r}"
        raise ValueError(msg)
    return value


def as_integer(name: str, value: object, *, minimum: int) -> int:
    """Return an integer >= ``minimum``; ``True``, ``2.0`` and ``"2"`` are none."""
    if isinstance(value, bool | np.bool_):
        msg = f"{name} must be an integer, got {value!r}"
        raise ValueError(msg)
    try:
        integer = operator.index(cast("int", value))
    except TypeError:
        msg = f"{name} must be an integer, got {value!r}"
        raise ValueError(msg) from None
    if integer < minimum:
        msg = f"{name} must be >= {minimum}, got {value!r}"
        raise ValueError(msg)
    return integer


def as_bounds(value: object) -> Bounds | None:
    """Return a declared range ``(low, high)`` of the scores, low < high, or None."""
    if value is None:
        return None
    try:
        low, high = cast("tuple[object, object]", value)
    except (TypeError, ValueError):
        msg = f"bounds must be a pair (low, high) or None, got {value!r}"
        raise ValueError(msg) from None
    pair = as_number("bounds[0]", low), as_number("bounds[1]", high)
    if not pair[0] < pair[1]:
        msg = f"bounds must have low < high, got {value!r}"
        raise ValueError(msg)
    return pair


def as_score(value: object, bounds: Bounds | None) -> float:
    """Return one score as a float, finite and within the declared range."""
    score = as_number("score", value)
    if bounds is not None and not bounds[0] <= score <= bounds[1]:
        msg = f"score must lie in the declared bounds {bounds}, got {value!r}"
        raise ValueError(msg)
    return score


def as_scores(
    values: ArrayLike, *, ndim: int, bounds: Bounds | None = None, name: str = "scores"
) -> NDArray[np.float64]:
    """Return scores as a C-contiguous float64 array, finite and within the declared range.

    Integers and narrower floats are converted (an integer above 2**53 is rounded); booleans,
    complex numbers, objects, strings, dates and masked arrays are refused, for each of them has
    a conversion that would hide a mistake. No scores at all are fine: an episode may end before
    its first one.
    """
    array = _as_array(values, name)
    if array.ndim != ndim:
        msg = f"{name} must have {ndim} dimension(s), got shape {array.shape}"
        raise ValueError(msg)
    # A read-only array (pandas hands those out) would make numba compile every kernel anew.
    scores = np.require(array, np.float64, ["C", "A", "W"])
    good = np.isfinite(scores)
    if not good.all():
        raise ValueError(_first_bad(name, scores, good, "must be finite"))
    if bounds is not None:
        good = (bounds[0] <= scores) & (scores <= bounds[1])
        if not good.all():
            must = f"must lie in the declared bounds {bounds}"
            raise ValueError(_first_bad(name, scores, good, must))
    return scores


def _as_array(values: ArrayLike, name: str) -> NDArray[Any]:
    if isinstance(values, np.ma.MaskedArray):
        msg = f"{name} must not be masked, got a MaskedArray"
        raise ValueError(msg)
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        msg = f"{name} must be a rectangular array of numbers, got {values!r:.80}"
        raise ValueError(msg) from error
    if array.dtype.kind not in "iuf" or array.dtype.itemsize > 8:
        msg = f"{name} must hold integers or floats of at most 64 bits, got dtype {array.dtype}"
        raise ValueError(msg)
    return array


def _first_bad(name: str, scores: NDArray[np.float64], good: NDArray[np.bool_], must: str) -> str:
    index = tuple(int(k) for k in np.argwhere(~good)[0])
    where = ", ".join(map(str, index))
    return f"{name} {must}, got {name}[{where}] = {float(scores[index])!r}"
