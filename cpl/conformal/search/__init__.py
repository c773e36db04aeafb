r"""Exhaustive search: the true extremes over every score sequence, in integers.

Only three things about a score matter: missed, covered, and whether the quantile lets one choose.
Below 0 every score is missed, at or above `B` every score is covered, in between the adversary
chooses. In units in which `alpha`, `1 - alpha` and `B / eta` are all whole, the quantile is an
integer in a bounded range, so there are finitely many states: this module visits all that can be
reached, and asks for each how many misses the next `W` steps can hold at most and at least. That
answer follows from the answer for `W - 1` at the two states that can come next.

Nothing here knows the bounds. The sweeps put the two side by side.
"""

from cpl.conformal.search._excursions import (
    HighestQuantile,
    highest_quantile_eventually_safe,
    sweep_eventually_safe,
)
from cpl.conformal.search._grid import ALPHAS, RATIOS
from cpl.conformal.search._trouble import TroubledExtremes, search_trouble
from cpl.conformal.search._windows import WindowExtremes, search_windows, sweep_windows

__all__ = [
    "ALPHAS",
    "RATIOS",
    "HighestQuantile",
    "TroubledExtremes",
    "WindowExtremes",
    "highest_quantile_eventually_safe",
    "search_trouble",
    "search_windows",
    "sweep_eventually_safe",
    "sweep_windows",
]
