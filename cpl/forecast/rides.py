"""Forecasts along rides: made, checked a few steps later, scored, and tracked."""

import pandas as pd

from cpl.conformal import Rule, track_episodes
from cpl.forecast.persistence import persistence

__all__ = ["score_rides", "track_rides"]


def score_rides(steps: pd.DataFrame, *, by: list[str], horizon: int) -> pd.DataFrame:
    r"""Forecast l_tilde by persistence along every ride and score what was checked.

    $$ s_t = \lvert \tilde l_{t+h} - \hat l_{t+h \mid t} \rvert $$

    Args:
        steps: one row a step with `step` and `l_tilde`, in order of time within a ride.
        by: columns that tell rides apart.
        horizon: how far ahead h [steps], >= 1.

    Returns:
        One row a forecast that was checked: the columns of `by`, `step` (at which the forecast was
        made), `l_hat`, `l_tilde` (what then happened) and `score`, in [0, 1).

    Raises:
        ValueError: if `horizon` is below 1 or no ride is long enough for one forecast.

    >>> ride = pd.DataFrame({"ride": 0, "step": [0, 1, 2], "l_tilde": [0.2, 0.3, 0.5]})
    >>> score_rides(ride, by=["ride"], horizon=2)["score"].round(3).tolist()
    [0.3]
    """
    checked: list[pd.DataFrame] = []
    for _, ride in steps.groupby(by, sort=False):
        l_hat, l_tilde = persistence(ride["l_tilde"].to_numpy(), horizon=horizon)
        made = ride[[*by, "step"]].iloc[: len(l_hat)].reset_index(drop=True)
        checked.append(made.assign(l_hat=l_hat, l_tilde=l_tilde, score=abs(l_tilde - l_hat)))
    if not any(len(ride) for ride in checked):
        raise ValueError(f"horizon must be shorter than some ride, got {horizon!r}")
    return pd.concat(checked, ignore_index=True)


def track_rides(
    scored: pd.DataFrame, rule: Rule, *, by: list[str], alpha: float, delay: int, carry: bool
) -> pd.DataFrame:
    """Track the scores' quantile along the rides, one after the other.

    Args:
        scored: what `score_rides` returns.
        rule: how large the tracker's steps are.
        by: columns that tell rides apart.
        alpha: miscoverage aimed at [-], in (0, 1).
        delay: after how many steps a score is known [steps], >= 1; the horizon of the forecast.
        carry: whether a ride begins with the threshold that the one before ended with.

    Returns:
        The table with `q`, the threshold that the score met, and `err`, whether it was missed.

    Raises:
        ValueError: as `cpl.conformal.track_episodes` does.

    >>> from cpl.conformal import Fixed
    >>> scored = pd.DataFrame({"ride": [0, 0, 1], "score": [0.3, 0.3, 0.3]})
    >>> rule, how = Fixed(eta=0.1), {"by": ["ride"], "alpha": 0.5, "delay": 1}
    >>> track_rides(scored, rule, carry=True, **how)["q"].round(2).tolist()
    [0.0, 0.05, 0.1]
    >>> track_rides(scored, rule, carry=False, **how)["q"].round(2).tolist()
    [0.0, 0.05, 0.0]
    """
    rides = [ride["score"].to_numpy() for _, ride in scored.groupby(by, sort=False)]
    tracks = track_episodes(rides, rule, alpha=alpha, delay=delay, carry=carry)
    q = [threshold for t in tracks for threshold in t.q.tolist()]
    err = [missed for t in tracks for missed in t.err.tolist()]
    return scored.assign(q=q, err=err)
