"""How long episodes last when some are cut off by the clock: Kaplan-Meier, log-rank, the mean."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats as sp

__all__ = ["SurvivalCurve", "logrank", "restricted_mean", "survival"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SurvivalCurve:
    """The share of episodes that go on after a time.

    Attributes:
        time: Times at which it changes, ascending [s].
        alive: The share that goes on after each [-].
        low: Lower end of its pointwise interval.
        high: Upper end.
    """

    time: Floats
    alive: Floats
    low: Floats
    high: Floats


def survival(
    durations: ArrayLike, crashed: ArrayLike, *, confidence: float = 0.95
) -> SurvivalCurve:
    """Estimate the survival curve by Kaplan and Meier, with Greenwood's log-log intervals.

    Args:
        durations: How long each episode lasted [s], shape (n,).
        crashed: Whether it ended in a crash; else it was cut off (censored), shape (n,).
        confidence: Coverage of the pointwise intervals.

    Returns:
        The curve.

    Raises:
        ValueError: If the two are not vectors of one length, or empty.

    Examples:
        >>> curve = survival([1.0, 2.0, 2.0, 3.0], [True, True, False, False])
        >>> curve.time.tolist(), curve.alive.tolist()
        ([1.0, 2.0, 3.0], [0.75, 0.5, 0.5])
    """
    estimate = sp.ecdf(_censored(durations, crashed)).sf
    with warnings.catch_warnings():  # undefined at "all" and "none", which is dealt with below
        warnings.filterwarnings("ignore", "The confidence interval is undefined")
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = estimate.confidence_interval(confidence_level=confidence, method="log-log")
    alive = np.asarray(estimate.probabilities, np.float64)
    # The log-log interval of "all" or "none" is undefined; the estimate itself is then its end.
    low = np.nan_to_num(np.asarray(ends.low.probabilities), nan=-1.0)
    high = np.nan_to_num(np.asarray(ends.high.probabilities), nan=-1.0)
    return SurvivalCurve(
        time=np.asarray(estimate.quantiles, np.float64),
        alive=alive,
        low=np.where(low < 0, alive, low),
        high=np.where(high < 0, alive, high),
    )


def restricted_mean(durations: ArrayLike, crashed: ArrayLike, *, horizon: float) -> float:
    r"""Return the mean duration up to a horizon: the area under the survival curve.

    .. math:: \int_0^H S(t)\, dt

    Where every episode is cut off at the horizon itself, this is the plain mean.

    Args:
        durations: As in ``survival``.
        crashed: As in ``survival``.
        horizon: Where the area ends [s], > 0.

    Examples:
        >>> restricted_mean([1.0, 2.0, 4.0, 4.0], [True, True, False, False], horizon=4.0)
        2.75
    """
    if not horizon > 0:
        msg = f"horizon must be > 0 s, got {horizon!r}"
        raise ValueError(msg)
    curve = survival(durations, crashed)
    inside = curve.time < horizon
    edges = np.concatenate([[0.0], curve.time[inside], [horizon]])
    levels = np.concatenate([[1.0], curve.alive[inside]])
    return float(np.sum(np.diff(edges) * levels))


def logrank(
    first: tuple[ArrayLike, ArrayLike], second: tuple[ArrayLike, ArrayLike]
) -> tuple[float, float]:
    """Test whether two groups of episodes last equally long, over all times.

    Args:
        first: Durations and crashes of one group.
        second: Of the other.

    Returns:
        The statistic (negative if the first group crashes less than expected) and the two-sided
        p-value.

    Examples:
        >>> group = ([1.0, 2.0, 3.0], [True, True, False])
        >>> logrank(group, group)
        (0.0, 1.0)
    """
    result: Any = sp.logrank(_censored(*first), _censored(*second))
    return float(result.statistic), float(result.pvalue)


def _censored(durations: ArrayLike, crashed: ArrayLike) -> Any:  # noqa: ANN401 - SciPy's class
    times, ended = np.asarray(durations, np.float64), np.asarray(crashed)
    if times.ndim != 1 or times.size == 0 or ended.shape != times.shape:
        msg = f"durations and crashed must be vectors of one length, got {times.shape}"
        raise ValueError(msg)
    if ended.dtype != np.bool_ or not (np.isfinite(times) & (times >= 0)).all():
        msg = "crashed must be bool and durations finite and >= 0 s"
        raise ValueError(msg)
    return sp.CensoredData(uncensored=times[ended], right=times[~ended])
