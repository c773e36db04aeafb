"""How long is a tracker wrong after the road changes?

Section VI: a conformal policy "is sure to quickly exit regimes where its internal notion of
uncertainty is flawed". Episodes of pi_speed in the range of the training, then in a wider one, with
the threshold carried on from one to the next: how many scores in a row are missed before one is
covered, beside the longest run that the theory allows?
"""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.conformal import RunningMax, track_episodes
from cpl.conformal.sequence import step_sizes
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import (
    HORIZON,
    Setup,
    drive,
    drivers_of,
    evaluation_seeds,
    pairs_of,
    road_of,
)
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.needs import needs_of_pair
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Forecast
from cpl.settings.ranges import Count

__all__ = ["EXPERIMENT", "PROFILES", "Config", "longest_run"]


_TRAINING_TOP = 30.0  # [m/s] the speed range in which everything was trained


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The streams.

    Attributes:
        before: Episodes of a stream before the change.
        after: Episodes of it afterwards.
    """

    before: Count = 10
    after: Count = 4

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.episodes < max(self.before, self.after):
            raise ValueError(f"episodes must be at least {self.before}, got {self.episodes!r}")


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=1, blocks=1, vehicles_count=8,
        before=2, after=2,
    ),
    "book": Config(pairs=1, episodes=60, validation_episodes=1, blocks=1),
    "paper": Config(pairs=10, episodes=500, validation_episodes=1, blocks=1),
}  # fmt: skip


def longest_run(q: float, eta: float, *, alpha: float, delay: int, ends: int = 0) -> int:
    r"""Return how many scores in a row can be missed at the beginning of an episode.

    Each miss that is fed back lifts the threshold by at least $(1-\alpha)\eta$, and scores are at
    most 1. With a delay h the last h - 1 misses are still under way, and those at the end of an
    episode never arrive, so with m ends of episodes on the way at most

    $$ \Bigl\lceil \frac{1 - q}{(1 - \alpha)\,\eta} \Bigr\rceil + (m + 1)(h - 1) $$

    scores are missed in a row.

    Args:
        q: The threshold at the beginning [score].
        eta: The least step from then on [score].
        alpha: Miscoverage aimed at [-].
        delay: h [steps].
        ends: m [-].

    Examples:
        >>> longest_run(0.0, 0.1, alpha=0.1, delay=1)
        12
        >>> longest_run(0.0, 0.1, alpha=0.1, delay=3)
        14
    """
    needed = math.ceil(round((1.0 - q) / ((1.0 - alpha) * eta), 9))
    return max(needed, 0) + (ends + 1) * (delay - 1)


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Follow all streams of one pair.

    Returns:
        One row a stream: `pair`, `stream`, `q` and `eta` (threshold and step when the road
        changes), `exit` (scores missed in a row from then on), `exit_before` (the same counted
        from the beginning of the last episode before the change, for comparison), `allowed` (what
        the theory allows), `error_before` and `error_after` (error rates on both sides).
    """
    pair = shard.number("pair")
    drivers = drivers_of(inputs, pair)
    forecast = forecaster(inputs, "conformal", pair, calibrated=False)
    calm = _scores(config, _TRAINING_TOP, drivers, forecast)
    wide = _scores(config, config.top_speed_mps, drivers, forecast)
    streams = min(len(calm) // config.before, len(wide) // config.after)
    rows = []
    for k in range(streams):
        first = calm[k * config.before : (k + 1) * config.before]
        then = wide[k * config.after : (k + 1) * config.after]
        rows.append({"pair": pair, "stream": k, **_follow(config, first, then)})
    return pd.DataFrame(rows)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}", pair=pairs_of),
    needs=needs_of_pair,
    label="simulated",
    extent=("pairs", "first_pair"),
)


def _scores(config: Config, top: float, drivers: Drivers, forecast: Forecast) -> list[np.ndarray]:
    """Return the scores of each episode of pi_speed that has any."""
    steps = drive(
        road_of(config, top), drivers, Always([False]), evaluation_seeds(config.episodes),
        forecast=forecast, record=True,
    ).steps  # fmt: skip
    if steps is None:
        raise RuntimeError("no steps were recorded")
    later = steps.groupby("seed", sort=False)["l_tilde"].shift(-HORIZON)
    scores = (later - steps["l_hat"]).abs()
    found = [part.dropna().to_numpy() for _, part in scores.groupby(steps["seed"], sort=False)]
    return [part for part in found if len(part) >= config.delay]


def _follow(
    config: Config, first: list[np.ndarray], then: list[np.ndarray]
) -> dict[str, float | int]:
    """Track one stream and look at what happens when the road changes."""
    rule = RunningMax(c=config.share)
    tracks = track_episodes(
        [*first, *then], rule, alpha=config.alpha, delay=config.delay, carry=True
    )
    before, after = tracks[: len(first)], tracks[len(first) :]
    fed = np.concatenate([part[: len(part) - config.delay + 1] for part in first])
    q, eta = float(after[0].q[0]), float(step_sizes(fed, rule)[-1])
    missed = _missed_in_a_row(np.concatenate([track.err for track in after]))
    ends = np.searchsorted(np.cumsum([len(track.err) for track in after]), missed, side="right")
    return {
        "q": q,
        "eta": eta,
        "exit": missed,
        "exit_before": _missed_in_a_row(before[-1].err),
        "allowed": longest_run(q, eta, alpha=config.alpha, delay=config.delay, ends=int(ends)),
        "error_before": float(np.mean(np.concatenate([track.err for track in before]))),
        "error_after": float(np.mean(np.concatenate([track.err for track in after]))),
    }


def _missed_in_a_row(err: np.ndarray) -> int:
    """Count the misses before the first covered score."""
    covered = np.flatnonzero(~err)
    return int(covered[0]) if len(covered) else len(err)
