"""The most and the fewest misses in any window, over every score sequence."""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cpl.conformal.bounds import (
    attained_for_certain,
    max_errors,
    max_errors_from_start,
    min_errors,
    min_errors_from_start,
)
from cpl.conformal.rational import Number, count, level, positive, rational
from cpl.conformal.search._grid import ALPHAS, RATIOS

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["WindowExtremes", "search_windows", "sweep_windows"]


@dataclass(frozen=True, kw_only=True)
class WindowExtremes:
    """The most and the fewest misses that any score sequence can put into `W` steps."""

    alpha: Fraction
    """Miscoverage level."""
    ratio: Fraction
    """`B / eta`: how many steps of size `eta` it is from 0 to the largest score."""
    delay: int
    """Feedback delay [steps]."""
    states: int
    """Number of states that can be reached."""
    most: tuple[int, ...]
    """Entry `W - 1`: the most misses in any `W` consecutive steps."""
    least: tuple[int, ...]
    """Entry `W - 1`: the fewest misses in any `W` consecutive steps."""
    most_from_start: tuple[int, ...]
    """Entry `W - 1`: the most misses in the first `W` steps."""
    least_from_start: tuple[int, ...]
    """Entry `W - 1`: the fewest misses in the first `W` steps."""


class _Units(NamedTuple):
    """The tracker in whole numbers: a miss adds `up`, a cover takes `down`, `B` is at `top`."""

    up: int
    down: int
    top: int
    waiting: int  # errors under way: delay - 1


def search_windows(
    alpha: Number, eta: Number, B: Number, W_max: int, *, delay: int = 1
) -> WindowExtremes:
    """Search all score sequences for the extreme numbers of misses, for `q_1 = 0`.

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        B: largest score > 0 [score].
        W_max: longest window [steps].
        delay: feedback delay >= 1 [steps]; the work doubles with each step of it.

    Returns:
        The extremes for `W = 1, ..., W_max`.

    Examples:
        By hand, alpha = 1/2 and B = eta: from -1/2, two misses lead to 1/2 and one more to 1.

        >>> search_windows(0.5, 1, 1, 4).most
        (1, 2, 3, 3)
        >>> search_windows(0.1, 0.1, 1, 40).most[-1], search_windows(0.1, 0.1, 1, 40).states
        (14, 110)
    """
    a, ratio = level(alpha), positive(B, "B") / positive(eta, "eta")
    scale = math.lcm(a.denominator, ratio.denominator)
    down = int(a * scale)
    units = _Units(scale - down, down, int(ratio * scale), count(delay, "delay") - 1)
    reached = _reachable(units)
    steps = count(W_max, "W_max")
    most, most_first = _extreme(units, reached, steps, sign=1)
    least, least_first = _extreme(units, reached, steps, sign=-1)
    return WindowExtremes(
        alpha=a,
        ratio=ratio,
        delay=delay,
        states=int(reached.sum()),
        most=most,
        least=least,
        most_from_start=most_first,
        least_from_start=least_first,
    )


def sweep_windows(
    alphas: Iterable[Number] = ALPHAS,
    ratios: Iterable[Number] = RATIOS,
    *,
    W_max: int = 80,
    delays: Iterable[int] = (1,),
) -> pd.DataFrame:
    """Compare the search with the bounds, setting by setting.

    Args:
        alphas: miscoverage levels.
        ratios: values of `B / eta`.
        W_max: windows 1, ..., `W_max` are compared [steps].
        delays: feedback delays [steps].

    Returns:
        One row a setting: `alpha`, `ratio`, `delay`, `W`; the extremes found (`most`, `least`, and
        the two `_from_start`); `holds`, whether all four lie within their bounds; `attained`,
        whether all four equal them; `promised`, whether `bounds.attained_for_certain` says so;
        `most_printed`, the most misses in the `W + 1` terms of the paper's sum, and
        `printed_holds`, whether those obey the paper's theorem.

    Examples:
        >>> table = sweep_windows([0.1], [10], W_max=40)
        >>> bool(table.holds.all()), bool(table.attained.all()), bool(table.printed_holds.all())
        (True, True, True)
        >>> bool(sweep_windows([0.1], [0.85], W_max=1).printed_holds.all())
        False
    """
    import pandas as pd

    wanted = [rational(ratio, "ratios") for ratio in ratios]
    rows = [
        row
        for delay in delays
        for alpha in alphas
        for ratio in wanted
        for row in _compare(search_windows(alpha, 1, ratio, W_max + 1, delay=delay))
    ]
    return pd.DataFrame(rows)


def _reachable(units: _Units) -> NDArray[np.bool_]:
    """Return which states (errors under way, quantile) occur once feedback has begun to arrive."""
    low, size = _box(units)
    up, down, top, waiting = units
    mask = (1 << waiting) - 1
    reached = np.zeros((mask + 1, size), dtype=np.bool_)
    # After the first steps, in which q = 0 lets the adversary choose, any errors are under way.
    todo = [(bits, 0) for bits in range(mask + 1)]
    seen = set(todo)
    while todo:
        bits, q = todo.pop()
        reached[bits, q - low] = True
        for err in (0, 1):
            if (q >= top) if err else (q < 0):
                continue
            queue = bits << 1 | err
            state = (queue & mask, q + (up if queue >> waiting else -down))
            if state not in seen:
                seen.add(state)
                todo.append(state)
    return reached


def _extreme(
    units: _Units, reached: NDArray[np.bool_], steps: int, *, sign: int
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the most (`sign=1`) or fewest (`-1`) misses of any window, and of the first ones."""
    low, size = _box(units)
    up, down, top, waiting = units
    mask = (1 << waiting) - 1
    q = np.arange(low, low + size)
    # States outside the reachable ones are computed along and never looked at: clip their index.
    after = {
        0: np.clip(np.arange(size) - down, 0, size - 1),
        1: np.clip(np.arange(size) + up, 0, size - 1),
    }
    impossible = -sign * (1 << 40)
    best = np.maximum if sign > 0 else np.minimum
    pick = max if sign > 0 else min
    value = np.zeros((mask + 1, size), dtype=np.int64)
    early = [[0] * (1 << stage) for stage in range(waiting)]
    overall: list[int] = []
    first: list[int] = []
    for _ in range(steps):
        longer = np.empty_like(value)
        for bits in range(mask + 1):
            options = [
                np.where(
                    (q >= 0) if err == 0 else (q < top),
                    err + value[queue & mask][after[queue >> waiting]],
                    impossible,
                )
                for err, queue in ((0, bits << 1), (1, bits << 1 | 1))
            ]
            longer[bits] = best(*options)
        # The first steps, before any feedback: q = 0, so both moves are open.
        stages = [*early, value[:, -low].tolist()]
        early = [
            [
                pick(stages[stage + 1][bits << 1], 1 + stages[stage + 1][bits << 1 | 1])
                for bits in range(1 << stage)
            ]
            for stage in range(waiting)
        ]
        value = longer
        anywhere = [int(pick(value[reached].tolist())), *(pick(stage) for stage in early)]
        overall.append(pick(anywhere))
        first.append(early[0][0] if waiting else int(value[0, -low]))
    return tuple(overall), tuple(first)


def _box(units: _Units) -> tuple[int, int]:
    """Return the lowest quantile that any state can have, and the number of quantiles."""
    delay = units.waiting + 1
    low = -delay * units.down
    return low, units.top + delay * units.up - low


def _compare(found: WindowExtremes) -> Iterable[dict[str, object]]:
    """Put what was found beside the bounds, for all windows but the longest."""
    setting = (found.alpha, 1, found.ratio)
    promised = attained_for_certain(*setting, delay=found.delay)
    for W in range(1, len(found.most)):
        most, least = found.most[W - 1], found.least[W - 1]
        first = found.most_from_start[W - 1], found.least_from_start[W - 1]
        upper = [
            max_errors(*setting, W, delay=found.delay) - most,
            max_errors_from_start(*setting, W, delay=found.delay) - first[0],
        ]
        lower = [
            least - min_errors(*setting, W, delay=found.delay),
            first[1] - min_errors_from_start(*setting, W, delay=found.delay),
        ]
        yield {
            "alpha": found.alpha,
            "ratio": found.ratio,
            "delay": found.delay,
            "W": W,
            "most": most,
            "least": least,
            "most_from_start": first[0],
            "least_from_start": first[1],
            "holds": min(upper + lower) >= 0,
            "attained": max(upper + lower) == 0,
            "promised": promised,
            "most_printed": found.most[W],
            "printed_holds": found.most[W] <= found.alpha * W + found.ratio + 1,
        }
