"""What a log of scores says: is there anything to adapt to, and would any decision change?"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import Rule, track_episodes
from cpl.conformal.change import Alarms, alarms, bets_on_errors, bets_on_ranks, p_values
from cpl.rng import stream
from cpl.stats import Estimate, mean_interval, proportion
from cpl.stats.frozen import FrozenCoverage, frozen_coverage

__all__ = ["LogAnswer", "ask_log", "read_log"]

_LEVEL = 100.0
_WINDOWS = 4


@dataclass(frozen=True, kw_only=True)
class LogAnswer:
    """Whether a tracked threshold could matter, as far as a log can say.

    Attributes:
        verdict: "could matter", "does not matter" or "cannot be told".
        frozen: What a threshold frozen after the first quarter of the blocks covers later.
        tracked: Coverage of the tracked threshold on the same windows.
        errors: Alarms about the frozen threshold's coverage.
        ranks: Alarms about the scores' distribution, from the means of blocks.
        changed: Share of decisions that differ from those under the mean threshold; None without a
            forecast and a limit.
        shuffled: The same under the tracked threshold's values in random order.
        why: Sentences.
    """

    verdict: str
    frozen: FrozenCoverage
    tracked: NDArray[np.float64]
    errors: Alarms
    ranks: Alarms
    changed: Estimate | None
    shuffled: float | None
    why: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join([f"the quantile {self.verdict}", *(f"  {line}" for line in self.why)])


def read_log(path: Path | str) -> pd.DataFrame:
    """Read a CSV with a header: `score`, and if there are any `episode`, `forecast`, `limit`.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is no table, has no scores, or a cell is no finite number.
    """
    path = Path(path)
    try:
        table = pd.read_csv(path, comment="#", skipinitialspace=True)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name} must be a table with a header: {error}") from error
    table.columns = [str(name).strip() for name in table.columns]
    if "score" not in table:
        raise ValueError(f"{path.name} must have a column 'score', it has {list(table.columns)}")
    for name in ("score", "forecast", "limit"):
        if name in table:
            values = np.asarray(pd.to_numeric(table[name], errors="coerce"), np.float64)
            if not np.isfinite(values).all():
                line = int(np.argmin(np.isfinite(values))) + 2
                raise ValueError(f"{path.name}, line {line}: {name} must be a finite number")
            table[name] = values
    return table


def ask_log(
    log: pd.DataFrame, rule: Rule, *, alpha: float, delay: int = 1, seed: int = 0
) -> LogAnswer:
    """Ask a log whether a tracked threshold could matter.

    Without `episode` the log is cut into 40 blocks, which then are the units of chance. A decision
    is *cautious* where `forecast` plus threshold exceeds `limit`; what counts is not how often the
    tracked threshold is cautious but how often it decides otherwise than its own mean would.

    Args:
        log: From `read_log`.
        rule: What tracks.
        alpha: Miscoverage aimed at.
        delay: Steps until a score is known.
        seed: Of the coins that break ties and of the shuffling.

    Returns:
        *does not matter* if decisions are known and fewer than 1 % change (the interval's upper
        end), or if they are not known and no window of the frozen threshold covers other than
        it should and no alarm is raised; *could matter* if a window does and, where decisions are
        known, more than 1 % change; else *cannot be told*.

    Raises:
        ValueError: If there are fewer than 16 blocks, or a column does not fit.
    """
    scores = log["score"].to_numpy(np.float64)
    labels = _blocks(log, len(scores))
    count = len(np.unique(labels))
    if count < 4 * _WINDOWS:
        raise ValueError(f"the log must have at least {4 * _WINDOWS} episodes, got {count}")
    calibration = count // 4
    frozen = frozen_coverage(scores, labels, alpha=alpha, calibration=calibration, windows=_WINDOWS)
    cuts = np.flatnonzero(np.r_[True, labels[1:] != labels[:-1]])
    episodes = np.split(scores, cuts[1:])
    found = track_episodes(episodes, rule, alpha=alpha, delay=delay, carry=True)
    q = np.concatenate([part.q for part in found])
    block = np.cumsum(np.r_[True, labels[1:] != labels[:-1]]) - 1
    edges = [*frozen.first.tolist(), count]
    windows = [(block >= a) & (block < b) for a, b in pairwise(edges)]
    covered = (scores <= q).astype(np.float64)
    tracked = np.array([covered[inside].mean() for inside in windows], np.float64)
    later = block >= calibration
    errors = alarms(bets_on_errors(scores[later] > frozen.margin, alpha=alpha), level=_LEVEL)
    means = np.array([part.mean() for part in episodes])
    ranks = alarms(bets_on_ranks(p_values(means, seed=seed)), level=_LEVEL)
    changed, shuffled = _decisions(log, q, block, calibration, seed)
    return LogAnswer(
        verdict=_verdict(frozen, errors, changed),
        frozen=frozen,
        tracked=tracked,
        errors=errors,
        ranks=ranks,
        changed=changed,
        shuffled=shuffled,
        why=tuple(_why(frozen, tracked, errors, ranks, changed, shuffled)),
    )


_SAME = 0.01  # share of decisions below which none counts as changed


def _blocks(log: pd.DataFrame, n: int) -> NDArray[np.int64]:
    if "episode" not in log:
        return np.arange(n) * min(40, n) // max(n, 1)
    return pd.factorize(log["episode"])[0].astype(np.int64)


def _decisions(
    log: pd.DataFrame, q: NDArray[np.float64], block: NDArray[np.int64], first: int, seed: int
) -> tuple[Estimate | None, float | None]:
    if not {"forecast", "limit"} <= set(log):
        return None, None
    later = block >= first
    room = (log["limit"] - log["forecast"]).to_numpy(np.float64)[later]
    own, unit = q[later], block[later] - first
    finite = own[np.isfinite(own)]
    cautious, plain = own > room, (float(finite.mean()) if finite.size else 0.0) > room
    mixed = stream(seed, "matter", "shuffle").permutation(own) > room
    differs = cautious != plain
    by_unit = np.bincount(unit, differs) / np.bincount(unit)
    # Where nothing ever differs, units say nothing of how often something might.
    found = mean_interval(by_unit) if differs.any() else proportion(0, len(own))
    return found, float(np.mean(cautious != mixed))


def _verdict(frozen: FrozenCoverage, errors: Alarms, changed: Estimate | None) -> str:
    moved = frozen.can_pay or errors.first["ville"] is not None
    if changed is not None and changed.high < _SAME:
        return "does not matter"
    if not moved:
        return "does not matter" if changed is None else "cannot be told"
    if changed is None or changed.low > _SAME:
        return "could matter"
    return "cannot be told"


def _why(
    frozen: FrozenCoverage,
    tracked: NDArray[np.float64],
    errors: Alarms,
    ranks: Alarms,
    changed: Estimate | None,
    shuffled: float | None,
) -> list[str]:
    lines = [f"a threshold frozen early ({frozen.margin:.4g}, to cover {frozen.nominal:g}) covers:"]
    parts = zip(frozen.coverage, frozen.low, frozen.high, tracked, strict=True)
    for w, (share, low, high, own) in enumerate(parts, start=1):
        frozen_part = f"{share:.3f} ({low:.3f} to {high:.3f})"
        lines.append(f"  part {w} of {len(tracked)}: {frozen_part}; tracked {own:.3f}")
    lines.append(f"its misses, bet on: {_alarm(errors, 'scores after freezing')}")
    lines.append(f"the scores, bet on by episode: {_alarm(ranks, 'episodes')}")
    if changed is not None and shuffled is not None:
        lines.append(
            f"decisions other than under its mean: {changed.value:.2%} ({max(changed.low, 0):.2%} "
            f"to {changed.high:.2%}), other than under it shuffled: {shuffled:.2%}"
        )
    else:
        lines.append("decisions: not known (columns forecast and limit would tell)")
    return lines


def _alarm(found: Alarms, unit: str) -> str:
    ville, late = found.first["ville"], found.first["shiryaev_roberts"]
    ever = (
        f"alarm after {ville + 1} {unit} (a false one has a chance of {1 / found.level:g})"
        if ville is not None
        else f"no alarm (level {found.level:g})"
    )
    restarted = (
        f"; Shiryaev-Roberts after {late + 1} (a false one in {found.level:g} on average)"
        if late is not None
        else ""
    )
    return ever + restarted
