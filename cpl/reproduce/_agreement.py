"""Do two layers of results say the same? Piece by piece, and claim by claim."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    import pandas as pd

    from cpl.claims.row import Row
    from cpl.experiments.run.job import Job
    from cpl.experiments.run.result import Result

__all__ = ["Claim", "Number", "Pieces", "agree", "claims_again", "pieces_again"]

Number = tuple[float | None, float | None, float | None]
"""A value with the ends of its interval, as far as there are."""

_PUBLISHED = "paper"


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """The pieces of an experiment that are published and were computed again.

    Attributes:
        shards: Their names; none if nothing was published with these settings.
        differing: One line for each that did not give the same table.
    """

    shards: tuple[str, ...]
    differing: tuple[str, ...]

    @property
    def compared(self) -> int:
        """How many there are."""
        return len(self.shards)

    @property
    def agree(self) -> bool:
        """Whether there are any, and all of them gave the same."""
        return bool(self.shards) and not self.differing


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim as published and as found again.

    Attributes:
        row: Its number in the ledger.
        claim: What is claimed.
        published: Our published number with its interval.
        again: The same from this reproduction.
        verdict_published: The published verdict.
        verdict_again: The verdict from this reproduction; empty if one seed cannot decide.
        whole: Whether it rests on the same seeds as the published one.
        agrees: For the same seeds, whether verdict and number are the same; else whether the
            intervals meet, and None where there is nothing to compare.
        reason: Why there is nothing to compare, if so.
    """

    row: int
    claim: str
    published: Number
    again: Number
    verdict_published: str
    verdict_again: str
    whole: bool
    agrees: bool | None
    reason: str = ""


def pieces_again(task: Job, result: Result) -> Pieces:
    """Compare each piece of a result with the published piece of the same name and settings."""
    from cpl.store import read_published, same_table

    try:
        table, manifest = read_published(task.name, _PUBLISHED)
    except FileNotFoundError:
        return Pieces(shards=(), differing=())
    if task.spec.without_extent(manifest.parameters) != task.parameters:
        return Pieces(shards=(), differing=())
    extent = frozenset(task.spec.extent)
    there = {shard.name: shard for shard in manifest.shards}
    both = [shard for shard in result.provenance.shards if shard.name in there]
    differing: list[str] = []
    for mine in both:
        other = there[mine.name]
        again = result.table.iloc[mine.first_row : mine.first_row + mine.rows]
        stored = table.iloc[other.first_row : other.first_row + other.rows]
        difference = same_table(
            _told_apart(again, extent), _told_apart(stored, extent), rtol=task.spec.rtol
        )
        if difference:
            differing.append(f"{mine.name}: {difference}")
    return Pieces(shards=tuple(shard.name for shard in both), differing=tuple(differing))


def claims_again(results: Path, whole: Collection[str]) -> list[Claim]:
    """Apply the ledger's rules to another layer, and compare with the published one.

    Args:
        results: The other layer.
        whole: Experiments that it holds with the same seeds as published.

    Returns:
        One entry for each claim that is decided from published results and whose results are there.
    """
    from cpl.claims import attempts
    from cpl.experiments.run.job import experiment

    published, _ = attempts()
    again, undecided = attempts(root=results)
    found = {row.row: row for row in again if row.computed_from}
    claims: list[Claim] = []
    for row in published:
        if row.value is None or not row.computed_from:
            continue
        origins = {name.partition("/")[0] for name in row.computed_from}
        same = origins <= set(whole)
        timed = any(experiment(name).rtol >= 1 for name in origins)
        if row.row in undecided:
            claims.append(_claim(row, None, same, undecided[row.row]))
        elif row.row in found and found[row.row].value is not None:
            claims.append(_claim(row, found[row.row], same, "", timed=timed))
    return claims


def agree(published: Row, again: Row, *, same_seeds: bool, timed: bool = False) -> bool | None:
    """Say whether two findings agree; None if there is nothing to compare.

    With the same seeds verdict and number are the same; of times, which are never the same, the
    verdict alone counts. With fewer seeds the intervals meet; a number
    that has no interval of its own is one draw, which may lie anywhere.
    """
    if published.value is None or again.value is None:
        return published.verdict == again.verdict
    if same_seeds:
        near = math.isclose(published.value, again.value, rel_tol=1e-3, abs_tol=1e-9)
        return (near or timed) and published.verdict == again.verdict
    if again.low is None or again.high is None or math.isnan(again.low) or math.isnan(again.high):
        return None
    low = published.value if published.low is None else published.low
    high = published.value if published.high is None else published.high
    slack = 1e-6 * max(abs(published.value), abs(again.value))
    return again.low <= high + slack and low <= again.high + slack


def _told_apart(table: pd.DataFrame, extent: Collection[str]) -> pd.DataFrame:
    """Return a piece's rows, its models without the settings that only count shards.

    A model says of which run it is a part; a run with fewer seeds trains the same one.
    """
    from cpl.store import decode_model, encode_model

    def bare(value: object) -> object:
        if not isinstance(value, bytes) or not value:
            return value
        model = decode_model(value)
        return encode_model(model.arrays, _without(model.config, extent))

    rows = table.reset_index(drop=True)
    words = [str(name) for name in rows.columns if rows[name].dtype == object]
    columns = [name for name in words if any(isinstance(value, bytes) for value in rows[name])]
    return rows.assign(**{name: rows[name].map(bare) for name in columns})


def _without(config: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    return {
        key: _without(cast("Mapping[str, Any]", value), names)
        if isinstance(value, Mapping)
        else value
        for key, value in config.items()
        if key not in names
    }


def _claim(row: Row, again: Row | None, same: bool, reason: str, *, timed: bool = False) -> Claim:
    agrees = None if again is None else agree(row, again, same_seeds=same, timed=timed)
    if agrees is None and not reason:
        reason = "one training seed has no interval"
    return Claim(
        row=row.row,
        claim=row.claim,
        published=_number(row),
        again=(None, None, None) if again is None else _number(again),
        verdict_published=row.verdict,
        verdict_again="" if again is None else again.verdict,
        whole=same,
        agrees=agrees,
        reason=reason,
    )


def _number(row: Row) -> Number:
    return tuple(  # type: ignore[return-value]
        None if value is None or not math.isfinite(value) else value
        for value in (row.value, row.low, row.high)
    )
