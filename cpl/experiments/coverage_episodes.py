"""Does the tracked quantile cover 90 % on the road, in short windows, and when it matters?

The paper shows coverage in sliding windows of five steps along one rollout (Section IV, Figure 3).
Here: pooled over many episodes, with the quantile reset in each or carried on, under each base
policy and under the switch, in the range of training and beyond it; on all steps, near other cars,
and just before a crash. Paper: Figures 1 and 3.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import PI, Fixed, Rule, RunningMax, Track, fed_back, track, track_episodes
from cpl.experiments import base_policies, forecasts
from cpl.experiments._forecasts import forecaster, need_forecasts
from cpl.experiments._need import Inputs, Need
from cpl.experiments._policies import base_policy, need_base_policies
from cpl.experiments._shard import Shard
from cpl.highway.proximity import proximity
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Forecast, Rides, Tracking, drive
from cpl.policies.switch import Chooser, Switch, thresholds

__all__ = ["DRIVERS", "EXTENT", "LABEL", "PROFILES", "RTOL", "Config", "rules", "run_shard"]
__all__ += ["shards", "upstream"]

LABEL = "simulated"
EXTENT = ("pairs",)
RTOL = 1e-6
DRIVERS = ("safe", "speed", "switch")

_TEST = 20_000_000  # environment seeds of tests; training and validation lie below
_LENGTH, _HORIZON = 5, 3  # observations in a history; [steps] how far the forecast looks
_BEFORE, _AFTER = 10, 8  # [steps] of the pictures around a crash and around an encounter

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Config:
    """The rides and the trackers.

    Attributes:
        pairs: Pairs of base policies, each with its own forecaster.
        models: Profile that trained both.
        episodes: Test episodes of each pair, driver and range; the same environment seeds in all.
        top_speeds_mps: Upper ends of the speed ranges, that of the training first [m/s].
        q_safe: Threshold of the switch [-].
        alpha: Miscoverage aimed at [-].
        eta: Fixed step [score].
        c: Step as a share of the largest score so far [-].
        K_I: Gain of the integral [score].
        C_sat: Its saturation [-].
        window: Steps in a sliding window.
        near_m: A car this close makes a step dangerous [m].
    """

    pairs: int
    models: str = "paper"
    episodes: int
    top_speeds_mps: tuple[float, ...] = (30.0, 40.0)
    q_safe: float = 0.6
    alpha: float = 0.1
    eta: float = 0.1
    c: float = 0.1
    K_I: float = 0.1
    C_sat: float = 5.0
    window: int = 5
    near_m: float = 10.0

    def __post_init__(self) -> None:
        for name in ("pairs", "episodes", "window"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)!r}")
        if self.models not in base_policies.PROFILES.keys() & forecasts.PROFILES.keys():
            raise ValueError(f"models must be a profile of base_policies, got {self.models!r}")
        thresholds(self.q_safe)
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
    "smoke": Config(pairs=1, models="smoke", episodes=6),
    "book": Config(pairs=1, episodes=60),
    "paper": Config(pairs=10, episodes=500),
}


def shards(config: Config) -> list[Shard]:
    """One pair a shard."""
    return [Shard(f"pair-{pair}", {"pair": pair}) for pair in range(config.pairs)]


def upstream(config: Config, shard: Shard) -> list[Need]:
    """Ask for the pair's policies and forecasters."""
    pair = shard.number("pair")
    return [
        need_base_policies(base_policies.PROFILES[config.models], [pair]),
        need_forecasts(forecasts.PROFILES[config.models], [pair]),
    ]


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive one pair everywhere, and track its scores with every rule.

    Returns:
        One sum a row: `pair`, `driver`, `top_speed_mps`, `rule` (empty where none applies), `carry`
        (whether the quantile is carried on), `quantity`, `group` (`all`, `near`, `before crash`),
        `at` (a lag or a step), `value` (the sum) and `n` (what it was summed over). Quantities:
        `miss`, `q`, `window` (windows with at least 1 - alpha covered), `fed miss` and `q end`
        (the terms of the reset identity, over the scores that were fed back, and over episodes),
        `paired q` (out minus in, over steps that the same environment seed has in both ranges),
        `q by step`; around a `crash` and an `encounter` (the first car nearer than `near_m`) the
        `q`, `l_tilde`, `l_hat` and `speed`; and `crashed`, `speed`, `safe` over episodes and steps.
    """
    pair = shard.number("pair")
    drivers = Drivers(
        safe=base_policy(inputs, "safe", pair), speed=base_policy(inputs, "speed", pair)
    )
    guess = forecaster(inputs, "conformal", pair, calibrated=False)
    tables: list[pd.DataFrame] = []
    for name in DRIVERS:
        within: dict[str, Mapping[int, Floats]] = {}
        for top in config.top_speeds_mps:
            rides = _driven(config, name, drivers, guess, top)
            parts = [pd.DataFrame(_plain_rows(rides))]
            episodes = list(_episodes(rides))
            for rule_name, rule in rules(config).items():
                for carry in (False, True):
                    rows = _tracked(config, episodes, rule, carry)
                    parts.append(pd.DataFrame(rows).assign(rule=rule_name, carry=carry))
            issued = _issued(config, episodes)
            parts.append(pd.DataFrame(_around(config, episodes, issued)))
            if within:
                parts.append(pd.DataFrame(_paired(within["q"], issued)))
            else:
                within["q"] = issued
            joined = pd.concat(parts, ignore_index=True)
            tables.append(joined.assign(pair=pair, driver=name, top_speed_mps=top))
    table = pd.concat(tables, ignore_index=True)
    table = table.fillna({"rule": "", "carry": False, "group": "", "at": 0})
    names = ["pair", "driver", "top_speed_mps", "rule", "carry", "quantity", "group", "at", "value"]
    kinds = {"carry": bool, "at": int, "n": int, "value": float}
    return pd.DataFrame(table, columns=[*names, "n"]).astype(kinds)


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


def _driven(config: Config, name: str, drivers: Drivers, guess: Forecast, top: float) -> Rides:
    always: dict[str, Chooser] = {name: Always([name == "safe"]) for name in DRIVERS[:2]}
    base = base_policies.PROFILES[config.models]
    tracking = Tracking(rule=RunningMax(c=config.c), alpha=config.alpha, delay=_HORIZON)
    return drive(
        base_policies.road(replace(base, top_speed_mps=top), "speed"),
        drivers,
        always.get(name, Switch(config.q_safe)),
        _TEST + np.arange(config.episodes),
        forecast=guess,
        tracking=tracking if name == "switch" else None,
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


def _plain_rows(rides: Rides) -> Iterator[dict[str, object]]:
    told, n = rides.episodes, len(rides.episodes)
    steps = int(np.sum(told["steps"].to_numpy()))
    yield {"quantity": "crashed", "value": told["crashed"].sum(), "n": n}
    yield {"quantity": "steps", "value": steps, "n": n}
    yield {"quantity": "speed", "value": told["speed_sum"].sum(), "n": steps}
    yield {"quantity": "safe", "value": told["safe_steps"].sum(), "n": steps}


def _tracked(
    config: Config, episodes: list[_Episode], rule: Rule, carry: bool
) -> Iterator[dict[str, object]]:
    scores = [each.scores for each in episodes]
    tracks = track_episodes(
        scores, rule, alpha=config.alpha, carry=carry, delay=_HORIZON, bounds=(0.0, 1.0)
    )
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
    known = scores[: max(len(scores) - (_HORIZON - 1), 0)]
    return float(track(np.append(known, 0.0), rule, alpha=config.alpha).q[-1])


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


def _around(
    config: Config, episodes: list[_Episode], issued: Mapping[int, Floats]
) -> Iterator[dict[str, object]]:
    """Average what is known by step, and by the time to a crash or to an encounter."""
    first = _LENGTH - 1
    near = float(proximity(config.near_m))
    for at in range(first, max((len(each.l_tilde) for each in episodes), default=0)):
        values = [q[at - first] for q in issued.values() if at - first < len(q)]
        if values:
            yield _sum("q by step", np.array(values), at=at)
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
