r"""Exhaustive search: the true extremes over every score sequence, in integers.

Only three things about a score matter: missed, covered, and whether the quantile lets one choose.
Below 0 every score is missed, at or above `B` every score is covered, in between the adversary
chooses. In units in which `alpha`, `1 - alpha` and `B / eta` are all whole, the quantile is an
integer in a bounded range, so there are finitely many states: this module visits all that can be
reached, and asks for each how many misses the next `W` steps can hold at most and at least. That
answer follows from the answer for `W - 1` at the two states that can come next.

Nothing here knows the bounds. The sweeps put the two side by side.
"""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cpl.conformal.bounds import (
    attained_for_certain,
    eventually_safe_range,
    eventually_safe_range_sharp,
    max_errors,
    max_errors_from_start,
    min_errors,
    min_errors_from_start,
)
from cpl.conformal.rational import Number, count, level, like, positive, rational

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "ALPHAS",
    "RATIOS",
    "HighestQuantile",
    "WindowExtremes",
    "highest_quantile_eventually_safe",
    "search_windows",
    "sweep_eventually_safe",
    "sweep_windows",
]

ALPHAS: tuple[Fraction, ...] = tuple(
    Fraction(*parts)
    for parts in (
        *((1, 20), (1, 10), (1, 8), (1, 6), (1, 5), (1, 4), (3, 10), (1, 3)),
        *((2, 5), (1, 2), (3, 5), (3, 4), (9, 10)),
    )
)
"""The levels of the standard sweep."""

RATIOS: tuple[Fraction, ...] = tuple(
    Fraction(*parts)
    for parts in (
        *((1, 4), (1, 3), (1, 2), (17, 20), (1, 1), (4, 3), (3, 2)),
        *((2, 1), (5, 2), (3, 1), (4, 1), (5, 1), (15, 2), (10, 1)),
    )
)
"""The values of `B / eta` of the standard sweep; 10 is the paper's."""


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


class HighestQuantile(NamedTuple):
    """The largest quantile of any run, and of any run that can go on for ever."""

    at_the_end: float | Fraction
    """Over all runs, also those that stop before their last block is complete [score]."""
    going_on: float | Fraction
    """Over the runs that can go on without breaking the assumption [score]."""


_Excursion = tuple[int, tuple[int, ...]]
"""A quantile, and the errors of the last steps (fewer than `K`) that were above the floor."""


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


def highest_quantile_eventually_safe(
    alpha: Number, eta: Number, q_floor: Number, *, K: int, misses: int
) -> HighestQuantile:
    """Search for the largest quantile that an eventually safe policy allows, for `q_1 = 0`.

    Scores are `>= 0` without an upper limit, so every step may be missed, unless the last `K`
    steps (this one included) were all at or above the floor and would hold more than `misses`.

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        q_floor: the floor, the paper's q^safe of Assumption 1, >= 0 [score].
        K: block length [steps].
        misses: number of misses allowed in a block, less than `alpha K`.

    Raises:
        ValueError: if `misses >= alpha K`, which is no eventually safe policy.

    Examples:
        By hand, floor 1 and K = 1: a miss at 9/10 leads to 9/5, and above 1 nothing is missed.
        With K = 2 a second miss at 9/5 would lead to 27/10. But the block of two steps above the
        floor that it begins has a miss, which is not allowed: the run must end before.

        >>> tenth = Fraction(1, 10)
        >>> print(*highest_quantile_eventually_safe(tenth, 1, 1, K=1, misses=0))
        9/5 9/5
        >>> print(*highest_quantile_eventually_safe(tenth, 1, 1, K=2, misses=0))
        27/10 9/5
    """
    a, floor = level(alpha), rational(q_floor, "q_floor") / positive(eta, "eta")
    block, allowed = count(K, "K"), count(misses, "misses", least=0)
    if allowed >= a * block:
        msg = f"misses must be < alpha K = {a * block}, got {misses!r}"
        raise ValueError(msg)
    scale = math.lcm(a.denominator, floor.denominator)
    down, height = int(a * scale), int(floor * scale)

    def moves(state: _Excursion) -> Iterator[_Excursion]:
        q, above = state
        for err in (0, 1) if q >= 0 else (1,):
            run = (*above, err) if q >= height else ()
            if len(run) < block or sum(run) <= allowed:
                yield q + err * scale - down, run[1:] if len(run) == block else run

    after = _graph((0, ()), moves)
    unit = positive(eta, "eta") / scale
    return HighestQuantile(
        at_the_end=like(max(q for q, _ in after) * unit, alpha, eta, q_floor),
        going_on=like(max(q for q, _ in _endless(after)) * unit, alpha, eta, q_floor),
    )


def sweep_eventually_safe(
    alphas: Iterable[Number] = ALPHAS,
    floors: Iterable[Number] = (0, Fraction(1, 2), 1, Fraction(5, 3), 3),
    *,
    K_max: int = 6,
) -> pd.DataFrame:
    """Compare the highest quantile under an eventually safe policy with its two bounds.

    Args:
        alphas: miscoverage levels.
        floors: values of `q_floor / eta`.
        K_max: block lengths 1, ..., `K_max` are compared, each with every number of misses below
            `alpha K` [steps].

    Returns:
        One row a setting: `alpha`, `floor`, `K`, `misses`; what was found (`at_the_end`,
        `going_on`); the bounds (`high`, `high_going_on`); and whether both hold (`holds`).

    Examples:
        >>> bool(sweep_eventually_safe([0.25], [1], K_max=3).holds.all())
        True
    """
    import pandas as pd

    wanted = [rational(floor, "floors") for floor in floors]
    rows: list[dict[str, object]] = []
    for alpha in map(level, alphas):
        for floor in wanted:
            for K in range(1, count(K_max, "K_max") + 1):
                high = eventually_safe_range(alpha, 1, floor, K=K).high
                sharp = eventually_safe_range_sharp(alpha, 1, floor, K=K).high
                for misses in range(math.ceil(alpha * K)):
                    top = highest_quantile_eventually_safe(alpha, 1, floor, K=K, misses=misses)
                    rows.append(
                        {
                            "alpha": alpha,
                            "floor": floor,
                            "K": K,
                            "misses": misses,
                            "at_the_end": top.at_the_end,
                            "going_on": top.going_on,
                            "high": high,
                            "high_going_on": sharp,
                            "holds": top.at_the_end < high and top.going_on < sharp,
                        }
                    )
    return pd.DataFrame(rows)


def _graph(
    start: _Excursion, moves: Callable[[_Excursion], Iterator[_Excursion]]
) -> dict[_Excursion, list[_Excursion]]:
    """Return all states that can be reached, each with the states that can come next."""
    after: dict[_Excursion, list[_Excursion]] = {}
    todo = [start]
    while todo:
        state = todo.pop()
        if state not in after:
            after[state] = list(moves(state))
            todo.extend(after[state])
    return after


def _endless(after: dict[_Excursion, list[_Excursion]]) -> set[_Excursion]:
    """Return the states from which one can go on for ever."""
    alive = set(after)
    while dead := {state for state in alive if alive.isdisjoint(after[state])}:
        alive -= dead
    return alive


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
