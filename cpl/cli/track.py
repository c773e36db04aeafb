"""`cpl track`: track the scores of a forecaster of one's own."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from cpl.cli import UsageError

if TYPE_CHECKING:
    from cpl.conformal import Rule

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "track",
        help="track a file of scores: threshold, coverage, and the bound that holds",
        description="A score says how wrong a forecast was, in the order in which the forecasts "
        "were made: a CSV with one number a line, or a column of a larger table.",
    )
    parser.add_argument("scores", type=Path, help="CSV of scores")
    parser.add_argument("--alpha", type=float, default=0.1, help="miscoverage aimed at (0.1)")
    parser.add_argument("--column", help="name of the column, if there are several")
    parser.add_argument(
        "--rule", choices=("fixed", "running_max"), default="running_max",
        help="step: fixed, or a share of the largest score so far (default, as in the paper)",
    )  # fmt: skip
    parser.add_argument("--eta", type=float, help="the fixed step, in units of the score")
    parser.add_argument("--share", type=float, default=0.1, help="the share (0.1)")
    parser.add_argument("--delay", type=int, default=1, help="steps until a score is known (1)")
    parser.add_argument("--out", type=Path, help="write t, score, q and err as CSV")


def run(args: argparse.Namespace) -> int:
    """Track, and print what was found."""
    from cpl.forecast.audit import audit, read_scores
    from cpl.store import atomic_write

    try:
        rule = _rule(args)
        found = audit(
            read_scores(args.scores, args.column), rule, alpha=args.alpha, delay=args.delay
        )
    except (ValueError, OSError) as error:
        raise UsageError(error) from error
    T = len(found.table)
    print(f"steps            {T}")
    print(f"misses           {found.errors}")
    print(f"coverage         {found.coverage:.4f}  (aimed at {1 - found.alpha:g})")
    print(f"threshold now    {found.table['q'].iloc[-1]:.6g}")
    if found.bound is None:
        print("bound            none is known for this rule, delay and range of scores")
    elif found.bound >= T:
        print(f"bound            none that says anything yet: in {T} steps all could be misses")
    else:
        least = 1 - found.bound / T
        print(f"bound            at most {found.bound} misses in {T} steps, whatever the scores,")
        print(f"                 if none exceeds {found.largest:g}: coverage >= {least:.4f}")
    if args.out is not None:
        atomic_write(args.out, found.table.to_csv(index=False))
        print(args.out, file=sys.stderr)
    return 0


def _rule(args: argparse.Namespace) -> Rule:
    from cpl.conformal import Fixed, RunningMax

    if args.rule == "fixed":
        if args.eta is None:
            msg = "--rule fixed needs --eta, the step in units of the score"
            raise UsageError(msg)
        return Fixed(eta=args.eta)
    if args.eta is not None:
        msg = "--eta goes with --rule fixed; a running maximum takes --share"
        raise UsageError(msg)
    return RunningMax(c=args.share)
