"""`cpl verify`: compute published pieces again, as many as a budget allows, and compare."""

from __future__ import annotations

import argparse
import secrets
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cpl.cli import UsageError, project_root

if TYPE_CHECKING:
    from cpl.experiments.run.examine import Piece
    from cpl.experiments.run.result import Report

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "verify",
        help="compute published results again, within a budget, and compare",
        description="Results that fit into the budget are computed whole, the others are sampled "
        "by cost, with a fresh seed. Exit status 1 if anything differs: equal where discrete, else "
        "to tolerance.",
    )
    parser.add_argument("experiment", nargs="?", help="its name (default: all that is published)")
    parser.add_argument("--profile", default="paper", help="which one (default: paper)")
    parser.add_argument(
        "--budget", type=float, default=60.0, metavar="SECONDS", help="how long (default: 60)"
    )
    parser.add_argument("--seed", type=int, help="of the sample (default: a fresh one, printed)")
    parser.add_argument("--sample", type=int, help="pieces of each result, whatever they cost")
    parser.add_argument(
        "--record",
        action="store_true",
        help="go through the pieces that today's source has not computed, and write each "
        "agreement down; the same command goes on where the budget ended",
    )


def run(args: argparse.Namespace) -> int:
    """Verify one result or all, one line each, and say what share was looked at."""
    project_root()  # what is published is in the repository
    from cpl.store import DamagedResultError

    if not args.budget > 0:
        raise UsageError(f"--budget must be positive, got {args.budget!r}")
    if args.sample is not None and args.sample < 1:
        raise UsageError(f"sample must be positive, got {args.sample!r}")
    try:
        return _verified(args)
    except DamagedResultError as error:
        print(f"cpl verify: damaged: {error}", file=sys.stderr)
        return 1
    except (ValueError, FileNotFoundError) as error:
        raise UsageError(error) from error
    except KeyboardInterrupt:
        print("stopped; what agreed so far is noted with --record", file=sys.stderr)
        return 130


def _verified(args: argparse.Namespace) -> int:
    from cpl.experiments.run.examine import coverage, examine, results
    from cpl.experiments.run.publication import experiment, record_attested
    from cpl.store import data_path

    if args.experiment:
        experiment(args.experiment)  # a wrong name is told with the nearest right one
    every = results(args.experiment, args.profile)
    if not every:
        print(f"cpl verify: nothing is published in {data_path('results')}", file=sys.stderr)
        return 1
    chosen, seconds = _chosen(args, every)
    agreed, rows, seen = True, 0, set[tuple[str, str]]()
    for report, looked_at in examine(chosen, seconds, record=args.record):
        print(_line(report), flush=True)
        agreed &= report.agrees
        rows += looked_at
        seen |= {(report.experiment, name) for name in report.checked}
        if args.record and report.agrees and report.checked:
            record_attested(report.experiment, report.profile)
    print(coverage(every, rows))
    left = [each for each in chosen if (each.manifest.experiment, each.name) not in seen]
    _say_what_is_left(args, every, left)
    return 0 if agreed else 1


def _chosen(
    args: argparse.Namespace, every: Sequence[Sequence[Piece]]
) -> tuple[list[Piece], float]:
    """Return what to compute again, and for how long by the clock."""
    from cpl.experiments.run.examine import pending, plan

    if args.record and args.sample is None:
        return pending(every), args.budget
    seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    print(f"seed {seed}")
    if args.sample is not None:
        return _sampled(every, args.sample, seed), float("inf")
    return plan(every, args.budget, seed), 2 * args.budget  # a busy machine may take longer


def _say_what_is_left(
    args: argparse.Namespace, every: Sequence[Sequence[Piece]], left: Sequence[Piece]
) -> None:
    if left:
        seconds = sum(piece.seconds for piece in left)
        print(f"{len(left)} pieces left, about {seconds:.0f} s")
    dear = sum(piece.seconds > args.budget for pieces in every for piece in pieces)
    if dear and not args.record and args.sample is None:
        print(f"{dear} pieces cost more than {args.budget:g} s; a larger --budget reaches them")


def _sampled(every: Sequence[Sequence[Piece]], sample: int, seed: int) -> list[Piece]:
    """Draw so many pieces of each result."""
    from cpl.rng import stream

    chosen: list[Piece] = []
    for pieces in every:
        manifest = pieces[0].manifest
        rng = stream(seed, "verify", manifest.experiment, manifest.profile)
        drawn = rng.choice(len(pieces), size=min(sample, len(pieces)), replace=False)
        chosen += [pieces[k] for k in sorted(drawn.tolist())]
    return chosen


def _line(report: Report) -> str:
    verdict = "agrees" if report.agrees else "DIFFERS"
    if report.lacks and not report.checked:
        return f"{report.experiment}/{report.profile}: not run here: {report.lacks}"
    share = f"{len(report.checked)} of {report.of} shards"
    lines = [
        f"{report.experiment}/{report.profile}: {verdict} ({share}, {report.seconds:.1f} s)",
        *(f"  {difference}" for difference in report.differences),
    ]
    return "\n".join(lines)
