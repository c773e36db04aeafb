"""The largest quantile that an eventually safe policy allows, over every score sequence."""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from cpl.conformal.bounds import eventually_safe_range, eventually_safe_range_sharp
from cpl.conformal.rational import Number, count, level, like, positive, rational
from cpl.conformal.search._grid import ALPHAS

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["HighestQuantile", "highest_quantile_eventually_safe", "sweep_eventually_safe"]


class HighestQuantile(NamedTuple):
    """The largest quantile of any run, and of any run that can go on for ever."""

    at_the_end: float | Fraction
    """Over all runs, also those that stop before their last block is complete [score]."""
    going_on: float | Fraction
    """Over the runs that can go on without breaking the assumption [score]."""


_Excursion = tuple[int, tuple[int, ...]]
"""A quantile, and the errors of the last steps (fewer than `K`) that were above the floor."""


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
