"""Does the tracked quantile cover 90 % on the road, in short windows, and when it matters?

The paper shows coverage in sliding windows of five steps along one rollout (Section IV, Figure 3).
Here: pooled over many episodes, with the quantile reset in each or carried on, under each base
policy and under the switch, in the range of training and beyond it; on all steps, near other cars,
and just before a crash. Paper: Figures 1 and 3.

The paper does not say at which threshold its switch drove. Here it is the one at which each of the
two policies drives half of the time, found on validation seeds in the range of training, so that
both, and the changes between them, make up the steps on which coverage is counted.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import PI, Fixed, Rule, RunningMax, Track, fed_back, track, track_episodes
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained import base_policies
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.needs import needs_of_pair
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import base_policy
from cpl.highway import Config as Road
from cpl.highway.proximity import proximity
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Forecast, Rides, Tracking, drive
from cpl.policies.switch import Chooser, Switch
from cpl.settings.ranges import Count, Probability, Settings

__all__ = ["DRIVERS", "EXPERIMENT", "PROFILES", "Config", "rules"]

DRIVERS = ("safe", "speed", "switch")

_VALIDATION, _TEST = 10_000_000, 20_000_000  # first environment seeds; training lies below
_GRID = np.arange(1, 26) / 20  # thresholds that are tried
_LENGTH, _HORIZON = 5, 3  # observations in a history; [steps] how far the forecast looks
_BEFORE, _AFTER = 10, 8  # [steps] of the pictures around a crash and around an encounter

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The rides and the trackers.

    Attributes:
        pairs: Pairs of base policies, each with its own forecaster.
        models: Profile that trained both.
        episodes: Test episodes of each pair, driver and range; the same environment seeds in all.
        top_speeds_mps: Upper ends of the speed ranges, that of the training first [m/s].
        share: Share of decisions that pi_safe is to have under the switch, in the range of training
            and on validation seeds; its threshold is chosen by that [-].
        validation: Validation episodes for each threshold that is tried.
        streams: Streams that the episodes are dealt to where the quantile is carried on.
        alpha: Miscoverage aimed at [-].
        eta: Fixed step [score].
        c: Step as a share of the largest score so far [-].
        K_I: Gain of the integral [score].
        C_sat: Its saturation [-].
        window: Steps in a sliding window.
        near_m: A car this close makes a step dangerous [m].
        margin_mps: How much faster than in the range of training counts as outside [m/s].
    """

    pairs: Count
    models: Models = "paper"
    episodes: Count
    top_speeds_mps: tuple[float, ...] = (30.0, 40.0)
    share: Probability = 0.5
    validation: Count = 40
    streams: Count = 1
    alpha: Probability = 0.1
    eta: float = 0.1
    c: float = 0.1
    K_I: float = 0.1
    C_sat: float = 5.0
    window: Count = 5
    near_m: float = 10.0
    margin_mps: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        rules(self)


def rules(config: Config) -> dict[str, Rule]:
    """Return the trackers by name; the second is the book's default."""
    fixed, running = Fixed(eta=config.eta), RunningMax(c=config.c)
    return {
        "P, fixed": fixed,
        "P, running maximum": running,
        "PI, fixed": PI(fixed, K_I=config.K_I, C_sat=config.C_sat),
        "PI, running maximum": PI(running, K_I=config.K_I, C_sat=config.C_sat),
    }


PROFILES = {
    "smoke": Config(pairs=1, models="smoke", episodes=6, validation=2, streams=2),
    "book": Config(pairs=1, episodes=60),
    "paper": Config(pairs=10, episodes=500),
}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one pair everywhere, and track its scores with every rule.

    Returns:
        One sum a row: `pair`, `driver`, `top_speed_mps`, `rule` (empty where none applies), `carry`
        (whether the quantile is carried on), `quantity`, `group` (`all`, `near`, `before crash`),
        `at` (a lag or a step), `value` (the sum) and `n` (what it was summed over). Quantities:
        `miss`, `q`, `window` (windows with at least 1 - alpha covered), `fed miss` and `q end`
        (the terms of the reset identity, over the scores that were fed back, and over episodes),
        `paired q` (out minus in, over steps that the same environment seed has in both ranges),
        `q by step` and `miss by step`; around a `crash` and an `encounter` (the first car nearer
        than `near_m`) the `q`, `l_tilde`, `l_hat` and `speed`; `crashed`, `speed`, `safe` and
        `too fast` over episodes and steps; and the switch's `q_safe`. Where the quantile is carried
        on, the switch drove by the carried one.
    """
    pair = shard.number("pair")
    drivers = Drivers(
        safe=base_policy(inputs, "safe", pair), speed=base_policy(inputs, "speed", pair)
    )
    guess = forecaster(inputs, "conformal", pair, calibrated=False)
    q_safe = _chosen(config, drivers, guess)
    tables: list[pd.DataFrame] = []
    for name in DRIVERS:
        inside: Mapping[int, Floats] | None = None
        for top in config.top_speeds_mps:
            rides = _driven(config, name, drivers, guess, top, q_safe)
            parts = [pd.DataFrame(_plain_rows(config, rides, q_safe if name == "switch" else None))]
            episodes = carried = list(_episodes(rides))
            if name == "switch":
                again = _driven(config, name, drivers, guess, top, q_safe, carry=True)
                carried = list(_episodes(again))
            for rule_name, rule in rules(config).items():
                for carry in (False, True):
                    rows = _tracked(config, carried if carry else episodes, rule, carry)
                    parts.append(pd.DataFrame(rows).assign(rule=rule_name, carry=carry))
            issued = _issued(config, episodes)
            parts.append(pd.DataFrame(_by_step(episodes, issued)))
            parts.append(pd.DataFrame(_around(config, episodes, issued)))
            if inside is None:
                inside = issued
            else:
                parts.append(pd.DataFrame(_paired(inside, issued)))
            joined = pd.concat(parts, ignore_index=True)
            tables.append(joined.assign(pair=pair, driver=name, top_speed_mps=top))
    table = pd.concat(tables, ignore_index=True)
    table = table.fillna({"rule": "", "carry": False, "group": "", "at": 0})
    names = ["pair", "driver", "top_speed_mps", "rule", "carry", "quantity", "group", "at", "value"]
    kinds = {"carry": bool, "at": int, "n": int, "value": float}
    return pd.DataFrame(table, columns=[*names, "n"]).astype(kinds)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair-{pair}", pair="pairs"),
    needs=needs_of_pair,
    label="simulated",
    extent=("pairs",),
    rtol=1e-6,
)


class _Episode(NamedTuple):
    """One episode: l_tilde at 0 .. steps, speed there (NaN at 0), l_hat at 4 .. steps - 1."""

    seed: int
    crashed: bool
    l_tilde: Floats
    speed: Floats
    l_hat: Floats

    @property
    def scores(self) -> Floats:
        """|l_tilde - l_hat| of the forecasts that were checked, by the time they were made."""
        truth = self.l_tilde[_LENGTH - 1 + _HORIZON :]
        return np.abs(truth - self.l_hat[: len(truth)])


def _road(config: Config, top: float) -> Road:
    base = base_policies.PROFILES[config.models]
    return base_policies.road(replace(base, top_speed_mps=top), "speed")


def _tracking(config: Config, *, carry: bool) -> Tracking:
    return Tracking(
        rule=RunningMax(c=config.c),
        alpha=config.alpha,
        delay=_HORIZON,
        carry=carry,
        streams=config.streams,
    )


def _chosen(config: Config, drivers: Drivers, guess: Forecast) -> float:
    """The threshold at which pi_safe has its share of the decisions."""
    told = drive(
        _road(config, config.top_speeds_mps[0]),
        drivers,
        Switch(_GRID),
        _VALIDATION + np.arange(config.validation),
        settings=len(_GRID),
        forecast=guess,
        tracking=_tracking(config, carry=False),
    ).episodes
    safe, steps = (
        told[column].to_numpy(np.float64).reshape(len(_GRID), -1).sum(axis=1)
        for column in ("safe_steps", "steps")
    )
    return float(_GRID[np.argmin(np.abs(safe / steps - config.share))])


def _driven(
    config: Config,
    name: str,
    drivers: Drivers,
    guess: Forecast,
    top: float,
    q_safe: float,
    *,
    carry: bool = False,
) -> Rides:
    always: dict[str, Chooser] = {name: Always([name == "safe"]) for name in DRIVERS[:2]}
    return drive(
        _road(config, top),
        drivers,
        always.get(name, Switch(q_safe)),
        _TEST + np.arange(config.episodes),
        forecast=guess,
        tracking=_tracking(config, carry=carry) if name == "switch" else None,
        horizon=_HORIZON,
        length=_LENGTH,
        record=True,
    )


def _episodes(rides: Rides) -> Iterator[_Episode]:
    if rides.steps is None:
        return
    crashed = dict(zip(rides.episodes["seed"], rides.episodes["crashed"], strict=True))
    columns = {name: rides.steps[name].to_numpy() for name in ("l_tilde", "speed", "l_hat")}
    seeds, starts = np.unique(rides.steps["seed"].to_numpy(), return_index=True)
    for seed, first, last in zip(seeds.tolist(), starts, [*starts[1:], None], strict=True):
        l_tilde, speed, l_hat = (column[first:last] for column in columns.values())
        yield _Episode(seed, bool(crashed[seed]), l_tilde, speed, l_hat[_LENGTH - 1 : -1])


def _plain_rows(config: Config, rides: Rides, q_safe: float | None) -> Iterator[dict[str, object]]:
    told, n = rides.episodes, len(rides.episodes)
    steps = int(np.sum(told["steps"].to_numpy()))
    yield {"quantity": "crashed", "value": told["crashed"].sum(), "n": n}
    yield {"quantity": "steps", "value": steps, "n": n}
    yield {"quantity": "speed", "value": told["speed_sum"].sum(), "n": steps}
    yield {"quantity": "safe", "value": told["safe_steps"].sum(), "n": steps}
    if rides.steps is not None:
        speed = rides.steps["speed"].to_numpy()  # NaN before the first decision
        limit = config.top_speeds_mps[0] + config.margin_mps
        yield {"quantity": "too fast", "value": int(np.sum(speed > limit)), "n": steps}
    if q_safe is not None:
        yield {"quantity": "q_safe", "value": q_safe, "n": 1}


def _tracked(
    config: Config, episodes: list[_Episode], rule: Rule, carry: bool
) -> Iterator[dict[str, object]]:
    streams = config.streams if carry else 1
    dealt = [some for first in range(streams) if (some := episodes[first::streams])]
    how = {"alpha": config.alpha, "carry": carry, "delay": _HORIZON, "bounds": (0.0, 1.0)}
    tracks = [
        each for some in dealt for each in track_episodes([e.scores for e in some], rule, **how)
    ]
    episodes = [each for some in dealt for each in some]
    scores = [each.scores for each in episodes]
    q = np.concatenate([each.q for each in tracks])
    err = np.concatenate([each.err for each in tracks])
    for group, chosen in _groups(config, episodes).items():
        for quantity, values in (("miss", err), ("q", q)):
            yield _sum(quantity, values[chosen], group=group)
    yield _windows(config, tracks)
    known = fed_back([len(each) for each in scores], delay=_HORIZON)
    yield _sum("fed miss", err[known], group="all")
    if not carry:
        late = [_after(config, each, rule) for each in scores if len(each)]
        yield _sum("q end", np.array(late), group="all")


def _after(config: Config, scores: Floats, rule: Rule) -> float:
    """The quantile once all that is ever fed back in an episode has been."""
    with_next = np.append(scores, 0.0)  # whose own score is never known
    return float(track(with_next, rule, alpha=config.alpha, delay=_HORIZON).q[-1])


def _groups(config: Config, episodes: list[_Episode]) -> dict[str, NDArray[np.bool_]]:
    near = float(proximity(config.near_m))
    close, doomed = [np.zeros(0, np.bool_)], [np.zeros(0, np.bool_)]
    for each in episodes:
        truth = each.l_tilde[_LENGTH - 1 + _HORIZON :]
        close.append(truth > near)
        doomed.append(each.crashed & (np.arange(len(truth))[::-1] < _HORIZON))
    joined = {"near": np.concatenate(close), "before crash": np.concatenate(doomed)}
    return {"all": np.ones(len(joined["near"]), np.bool_), **joined}


def _windows(config: Config, tracks: Iterable[Track]) -> dict[str, object]:
    """Count the windows within an episode in which the coverage reaches 1 - alpha."""
    good, total = 0, 0
    allowed = int(np.floor(config.window * config.alpha + 1e-9))
    for each in tracks:
        if len(each.err) >= config.window:
            misses = np.convolve(each.err, np.ones(config.window, np.int64), "valid")
            good, total = good + int((misses <= allowed).sum()), total + len(misses)
    return {"quantity": "window", "group": "all", "value": good, "n": total}


def _issued(config: Config, episodes: list[_Episode]) -> dict[int, Floats]:
    """The default tracker's q at every step with a forecast, also those never checked."""
    rule, ends = RunningMax(c=config.c), np.zeros(_HORIZON)
    return {
        each.seed: track(
            np.concatenate([each.scores, ends]), rule, alpha=config.alpha, delay=_HORIZON
        ).q[: len(each.l_hat)]
        for each in episodes
    }


def _paired(inside: Mapping[int, Floats], outside: Mapping[int, Floats]) -> list[dict[str, object]]:
    """Compare q of the two ranges along the same environment seeds, while both still drive."""
    gaps = [
        float(np.mean(outside[seed][:common] - inside[seed][:common]))
        for seed in inside.keys() & outside.keys()
        if (common := min(len(inside[seed]), len(outside[seed])))
    ]
    return [_sum("paired q", np.array(sorted(gaps)), group="all")]


def _by_step(episodes: list[_Episode], issued: Mapping[int, Floats]) -> Iterator[dict[str, object]]:
    """Average the default tracker's q and its misses by the step in the episode."""
    first = _LENGTH - 1
    for at in range(first, max((len(each.l_tilde) for each in episodes), default=0)):
        values = [q[at - first] for q in issued.values() if at - first < len(q)]
        missed = [
            each.scores[at - first] > issued[each.seed][at - first]
            for each in episodes
            if at - first < len(each.scores)
        ]
        for quantity, found in (("q by step", values), ("miss by step", missed)):
            if found:
                yield _sum(quantity, np.array(found), at=at)


def _around(
    config: Config, episodes: list[_Episode], issued: Mapping[int, Floats]
) -> Iterator[dict[str, object]]:
    """Average what is known by the time to a crash or to an encounter."""
    first = _LENGTH - 1
    near = float(proximity(config.near_m))
    events: dict[str, list[tuple[_Episode, int]]] = {"crash": [], "encounter": []}
    for each in episodes:
        if each.crashed:
            events["crash"].append((each, len(each.l_tilde) - 1))
        close = np.flatnonzero(each.l_tilde[first + 1 :] > near)
        if len(close):
            events["encounter"].append((each, first + 1 + int(close[0])))
    for event, places in events.items():
        for at in range(-_BEFORE, _AFTER + 1):
            for name, start in (("q", first), ("l_hat", first), ("l_tilde", 0), ("speed", 0)):
                series = (
                    (issued[each.seed] if name == "q" else getattr(each, name), place + at - start)
                    for each, place in places
                )
                values = [s[k] for s, k in series if 0 <= k < len(s) and np.isfinite(s[k])]
                if values:
                    yield _sum(f"{event}: {name}", np.array(values), at=at)


def _sum(quantity: str, values: NDArray, *, group: str = "", at: int = 0) -> dict[str, object]:
    total = float(np.sum(values, dtype=np.float64))
    return {"quantity": quantity, "group": group, "at": at, "value": total, "n": len(values)}
