"""Which published pieces are computed again within a budget, and what came of it.

Results that fit into two thirds of the budget as a whole are computed whole, the cheapest first.
What is left of it goes to a sample of all other pieces, each the likelier the less it costs. The
draw is seeded anew each time, so that nobody can know beforehand which pieces will be looked at.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from cpl.experiments.run.attestation import Attestation
from cpl.experiments.run.costs import piece_seconds
from cpl.experiments.run.found import names
from cpl.experiments.run.publication import verify_pieces
from cpl.experiments.run.result import Report
from cpl.rng import stream
from cpl.store import DamagedResultError, Manifest, manifests, read_manifest

__all__ = ["Coverage", "Piece", "coverage", "examine", "pending", "plan", "results"]

_WHOLE = 2 / 3  # of the budget


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A published piece, and what it should cost.

    Attributes:
        manifest: Of the result that it belongs to.
        name: Of its shard.
        rows: Published rows in it.
        seconds: Processor time it took.
    """

    manifest: Manifest
    name: str
    rows: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """How many of the published rows were computed again.

    Attributes:
        rows: Published rows.
        now: Those computed again in this run.
        ever: Those that were computed again at any time, and agreed.
        today: Those of them computed by the source as it is now.
    """

    rows: int
    now: int
    ever: int
    today: int

    def __str__(self) -> str:
        def share(count: int) -> str:
            return f"{count:,} ({count / max(self.rows, 1):.1%})"

        return (
            f"of {self.rows:,} published rows re-executed now {share(self.now)}, "
            f"ever {share(self.ever)}, with today's source {share(self.today)}"
        )


def results(name: str | None = None, profile: str = "paper") -> list[list[Piece]]:
    """Return the pieces of each published result, or of one.

    Raises:
        FileNotFoundError: If nothing is published under that name.
        cpl.store.DamagedResultError: If a manifest cannot be read.
    """
    chosen = manifests() if name is None else [read_manifest(name, profile)]
    return [_pieces(manifest) for manifest in chosen]


def plan(every: Sequence[Sequence[Piece]], budget: float, seed: int) -> list[Piece]:
    """Choose what is computed again: cheap results whole, then a sample by cost.

    Args:
        every: From `results`.
        budget: Seconds in all.
        seed: Of the sample.

    Returns:
        The pieces, those of one result together.
    """
    chosen, spent, rest = list[Piece](), 0.0, list[Piece]()
    for pieces in sorted(every, key=_total):
        if spent + _total(pieces) <= (budget if len(every) == 1 else _WHOLE * budget):
            chosen += pieces
            spent += _total(pieces)
        else:
            rest += pieces
    rng = stream(seed, "verify")
    # The smallest of exponentials with these means is each piece with probability ~ 1 / cost.
    order = rng.exponential(size=len(rest)) * [max(piece.seconds, 1e-3) for piece in rest]
    for k in order.argsort().tolist():
        if spent + rest[k].seconds <= budget:
            chosen.append(rest[k])
            spent += rest[k].seconds
    cheap = {_place(pieces[0]): k for k, pieces in enumerate(sorted(every, key=_total)) if pieces}
    return sorted(chosen, key=lambda piece: cheap[_place(piece)])


def pending(every: Sequence[Sequence[Piece]]) -> list[Piece]:
    """Return the pieces that today's source has not computed again, cheap results first."""
    attested = Attestation()
    return [
        piece
        for pieces in sorted(every, key=_total)
        for done in [attested.today(pieces[0].manifest)]
        for piece in pieces
        if piece.name not in done
    ]


def examine(
    chosen: Sequence[Piece], budget: float, *, record: bool = False
) -> Iterator[tuple[Report, int]]:
    """Compute pieces again and compare, until the clock says that the budget is spent.

    Args:
        chosen: What, those of one result together.
        budget: Seconds by the clock; the piece that runs then is finished.
        record: Whether to write each agreement down at once.

    Yields:
        A report for each result, and how many published rows it looked at.
    """
    begun = time.monotonic()
    for _, group in groupby(chosen, key=_place):
        pieces = list(group)
        done: list[Piece] = []
        reports: list[Report] = []
        lacks = ""
        for piece in pieces:
            if time.monotonic() - begun >= budget:
                break
            told = piece.manifest
            try:
                report = verify_pieces(told.experiment, told.profile, [piece.name])
            except ImportError as error:  # a peer that only a bench asks for
                lacks = str(error)
                break
            done.append(piece)
            reports.append(report)
            if record and report.agrees:
                Attestation().add(told, [piece.name])
        if done or lacks:
            report = _joined(reports, done, pieces[0].manifest)
            yield replace(report, lacks=lacks), sum(piece.rows for piece in done)


def coverage(every: Sequence[Sequence[Piece]], now: int) -> Coverage:
    """Say how many of the published rows were computed again, now and ever."""
    attested = Attestation()
    rows = ever = today = 0
    for pieces in every:
        seen, fresh = (known(pieces[0].manifest) for known in (attested.ever, attested.today))
        rows += sum(piece.rows for piece in pieces)
        ever += sum(piece.rows for piece in pieces if piece.name in seen)
        today += sum(piece.rows for piece in pieces if piece.name in fresh)
    return Coverage(rows=rows, now=now, ever=ever, today=today)


def _pieces(manifest: Manifest) -> list[Piece]:
    if manifest.experiment not in names():
        raise DamagedResultError(f"nothing computes the published result {manifest.experiment!r}")
    cost = piece_seconds(manifest)
    return [
        Piece(manifest=manifest, name=one.name, rows=one.rows, seconds=cost[one.name])
        for one in manifest.shards
    ]


def _total(pieces: Sequence[Piece]) -> float:
    return sum(piece.seconds for piece in pieces)


def _place(piece: Piece) -> tuple[str, str]:
    return piece.manifest.experiment, piece.manifest.profile


def _joined(reports: Sequence[Report], pieces: Sequence[Piece], told: Manifest) -> Report:
    return Report(
        experiment=told.experiment,
        profile=told.profile,
        checked=tuple(piece.name for piece in pieces),
        of=len(told.shards),
        differences=tuple(line for report in reports for line in report.differences),
        seconds=sum(report.seconds for report in reports),
    )
