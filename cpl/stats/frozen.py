"""When can adapting pay? Look at the coverage of a margin that was frozen long ago."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats as sp

from cpl.stats.estimates import split_conformal_rank

__all__ = ["FrozenCoverage", "frozen_coverage"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FrozenCoverage:
    """What a frozen margin covered, window by window.

    Attributes:
        margin: The margin [score].
        nominal: What it was frozen to cover [-].
        first: The first block of each window, counted from the log's beginning.
        coverage: Share of each window's scores at or below the margin [-].
        low: Lower ends of intervals that hold together for all windows [-].
        high: Their upper ends.
    """

    margin: float
    nominal: float
    first: NDArray[np.int64]
    coverage: Floats
    low: Floats
    high: Floats

    @property
    def below(self) -> NDArray[np.bool_]:
        """Windows that cover too little: there adapting buys safety."""
        return self.high < self.nominal

    @property
    def above(self) -> NDArray[np.bool_]:
        """Windows that cover too much: there adapting buys what the margin costs."""
        return self.low > self.nominal

    @property
    def can_pay(self) -> bool:
        """Whether adapting can pay: some window is not covered as it was meant to be."""
        return bool((self.below | self.above).any())


def frozen_coverage(
    scores: ArrayLike,
    blocks: ArrayLike,
    *,
    alpha: float,
    calibration: int,
    windows: int,
    confidence: float = 0.95,
) -> FrozenCoverage:
    r"""Freeze the margin after the first blocks of a log, and follow what it covers from then on.

    $$ \hat c_w = \frac{1}{n_w} \sum_{t \in w} 1\{ s_t \le s_{(k)} \}, \qquad
       k = \lceil (1 - \alpha)(n + 1) \rceil $$

    While the scores stay as they were, all of these are near 1 - alpha and a tracked quantile has
    nothing to add to a constant. The intervals take blocks (episodes, runs) as the units of
    chance, for scores of one block resemble each other; they count the chance in the calibration
    as well, and hold for all windows together (Bonferroni).

    Args:
        scores: Any scores in the order of time, shape (T,).
        blocks: Which block each belongs to, shape (T,), in one piece each.
        alpha: Miscoverage that the margin is frozen to.
        calibration: Blocks that it is frozen after, >= 2.
        windows: Windows of about equally many blocks that the others are cut into, >= 1.
        confidence: Of all intervals together.

    Returns:
        Margin, windows, coverage and intervals.

    Raises:
        ValueError: If scores and blocks do not fit, a block is torn apart, or there are too few.

    Examples:
        Eight blocks of five scores; in the last two everything doubles:

        >>> scores = np.tile([1.0, 2.0, 3.0, 4.0, 5.0], 8) * np.repeat([1, 1, 1, 1, 1, 1, 2, 2], 5)
        >>> found = frozen_coverage(
        ...     scores, np.repeat(np.arange(8), 5), alpha=0.2, calibration=4, windows=2
        ... )
        >>> found.margin, found.coverage.tolist(), found.can_pay
        (5.0, [1.0, 0.4], True)
    """
    values, sums, sizes = _blocks(scores, blocks)
    if not (calibration >= 2 and windows >= 1 and len(sizes) - calibration >= 2 * windows):
        msg = (
            "calibration must be >= 2 and leave two blocks a window,"
            f" got {calibration!r} of {len(sizes)} blocks and {windows!r} windows"
        )
        raise ValueError(msg)
    known = values[: int(sizes[:calibration].sum())]
    rank = split_conformal_rank(known.size, alpha)
    if rank > known.size:
        raise ValueError(f"alpha must be at least 1 / (n + 1) for n = {known.size}, got {alpha!r}")
    margin = float(np.sort(known)[rank - 1])
    covered = np.add.reduceat(values <= margin, sums).astype(np.float64)
    cuts = np.linspace(calibration, len(sizes), windows + 1).round().astype(np.int64)
    own = _share(covered[:calibration], sizes[:calibration])
    level = 1 - (1 - confidence) / (2 * windows)
    share, reach = np.empty(windows), np.empty(windows)
    for w, (a, b) in enumerate(itertools.pairwise(cuts)):
        share[w], error = _share(covered[a:b], sizes[a:b])
        reach[w] = sp.t.ppf(level, min(b - a, calibration) - 1) * np.hypot(error, own[1])
    return FrozenCoverage(
        margin=margin,
        nominal=1 - alpha,
        first=cuts[:-1],
        coverage=share,
        low=np.maximum(share - reach, 0.0),
        high=np.minimum(share + reach, 1.0),
    )


def _blocks(scores: ArrayLike, blocks: ArrayLike) -> tuple[Floats, NDArray[np.int64], Floats]:
    values, labels = np.asarray(scores, np.float64), np.asarray(blocks)
    if values.ndim != 1 or values.shape != labels.shape or not np.isfinite(values).all():
        msg = f"scores must be finite and as many as blocks, got {values.shape} and {labels.shape}"
        raise ValueError(msg)
    begins = np.flatnonzero(np.r_[True, labels[1:] != labels[:-1]]) if labels.size else labels[:0]
    if len(np.unique(labels)) != len(begins):
        raise ValueError("blocks must be in one piece each, got one that comes back later")
    return values, begins, np.diff(np.r_[begins, values.size]).astype(np.float64)


def _share(covered: Floats, sizes: Floats) -> tuple[float, float]:
    """Return a ratio of sums over blocks, and its standard error over blocks."""
    count, total = len(sizes), sizes.sum()
    share = covered.sum() / total
    off = covered - share * sizes
    return float(share), float(np.sqrt(count / (count - 1) * (off**2).sum()) / total)
