"""How long episodes last when some are cut off by the clock: Kaplan and Meier's curve."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats as sp

__all__ = ["SurvivalCurve", "survival"]

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


def _censored(durations: ArrayLike, crashed: ArrayLike) -> Any:  # noqa: ANN401 - SciPy's class
    times, ended = np.asarray(durations, np.float64), np.asarray(crashed)
    if times.ndim != 1 or times.size == 0 or ended.shape != times.shape:
        msg = f"durations and crashed must be vectors of one length, got {times.shape}"
        raise ValueError(msg)
    if ended.dtype != np.bool_ or not (np.isfinite(times) & (times >= 0)).all():
        msg = "crashed must be bool and durations finite and >= 0 s"
        raise ValueError(msg)
    return sp.CensoredData(uncensored=times[ended], right=times[~ended])
