"""The settings of the standard sweeps."""

from fractions import Fraction

__all__ = ["ALPHAS", "RATIOS"]

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
