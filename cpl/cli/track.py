"""`cpl track`: track the scores of a forecaster of one's own."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from cpl.cli import UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cpl.conformal import Rule
    from cpl.forecast.scores import Scores

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "track",
        help="track a file of scores: threshold, coverage, and the bound that holds",
        description="A score says how wrong a forecast was, in the order in which the forecasts "
        "were made: a CSV with one number a line, or a column of a larger table.",
    )
    parser.add_argument("scores", type=Path, help="table of scores, plain or compressed")
    parser.add_argument("--alpha", type=float, default=0.1, help="miscoverage aimed at (0.1)")
    parser.add_argument("--column", help="the column, by name or by number from 1")
    parser.add_argument(
        "--missing", choices=("refuse", "carry", "drop"), default="refuse",
        help="a blank cell: refuse the file (default), carry the last score, or drop the step",
    )  # fmt: skip
    parser.add_argument(
        "--delimiter", choices=("tab", "semicolon", "comma", "blanks"),
        help="what stands between cells, where it is not recognised",
    )  # fmt: skip
    parser.add_argument("--decimal", choices=(".", ","), help="the decimal mark, likewise")
    parser.add_argument(
        "--rule", choices=("fixed", "running_max"), default="running_max",
        help="step: fixed, or a share of the largest score so far (default, as in the paper)",
    )  # fmt: skip
    parser.add_argument("--eta", type=float, help="the fixed step, in units of the score")
    parser.add_argument("--share", type=float, default=0.1, help="the share (0.1)")
    parser.add_argument(
        "--method", metavar="MEMBER",
        help="a member of the family with its plain settings in place of --rule: fixed, aci, "
        "dtaci, pid, kt, ... (a wrong name lists all)",
    )  # fmt: skip
    parser.add_argument(
        "--scale", type=float, default=1.0, help="size of the scores, for --method (1)"
    )
    parser.add_argument("--delay", type=int, default=1, help="steps until a score is known (1)")
    parser.add_argument("--out", type=Path, help="write t, score, q and err as CSV")


def run(args: argparse.Namespace) -> int:
    """Track, and print what was found."""
    from cpl.cli._out import write_out
    from cpl.forecast.audit import audit
    from cpl.forecast.scores import open_scores

    try:
        rule = _rule(args)
        read = open_scores(
            args.scores,
            args.column,
            missing=args.missing,
            delimiter=args.delimiter,
            decimal=args.decimal,
        )
        found = audit(read.values, rule, alpha=args.alpha, delay=args.delay)
    except OSError as error:
        raise UsageError(f"{error.strerror}: {args.scores}") from error
    except ValueError as error:
        raise UsageError(error) from error
    if args.out is not None:
        write_out(args.out, found.table.to_csv(index=False), inputs=[args.scores])
    _say_what_was_read(read, args.missing)
    T = len(found.table)
    print(f"steps            {T}")
    print(f"misses           {found.errors}")
    print(f"coverage         {found.coverage:.4f}  (aimed at {1 - found.alpha:g})")
    print(f"threshold now    {found.table['q'].iloc[-1]:.6g}")
    if found.bound is None:
        print(f"bound            none: {found.unbounded}")
        _say_what_would_do(read.values, args)
    elif found.bound >= T:
        print(f"bound            none that says anything yet: in {T} steps all could be misses")
        _say_what_would_do(read.values, args)
    else:
        least = 1 - found.bound / T
        print(f"bound            at most {found.bound} misses in {T} steps, whatever the scores,")
        print(f"                 if none exceeds {found.largest:g}: coverage >= {least:.4f}")
    if args.out is not None:
        print(args.out, file=sys.stderr)
    return 0


def _say_what_was_read(read: Scores, missing: str) -> None:
    """Say on stderr what was recognised, so that a wrong guess is seen."""
    if read.clock is not None:
        told = f"tracking {read.column!r}; {read.clock!r} only counts or tells the time"
        print(told, file=sys.stderr)
    if read.decimal == ",":
        print("a comma is the decimal mark", file=sys.stderr)
    if read.missing:
        done = {"carry": "the last score was carried on", "drop": "their steps were left out"}
        print(f"{read.missing} scores are missing: {done[missing]}", file=sys.stderr)


def _say_what_would_do(scores: NDArray[np.float64], args: argparse.Namespace) -> None:
    """Name the settings that give a bound for these scores, or say that none does."""
    from cpl.conformal import Fixed
    from cpl.forecast.audit import audit

    top = float(scores.max())
    if scores.min() < 0:
        print("                 absolute values, or a shift that makes them positive, would do")
        return
    steps = [float(f"{share * top:.2g}") for share in (0.05, 0.1, 0.2, 0.5, 1.0)] if top else []
    tried = [(audit(scores, Fixed(eta=eta), alpha=args.alpha, delay=args.delay), eta)
             for eta in steps]  # fmt: skip
    bounds = [(found.bound, eta) for found, eta in tried if found.bound is not None]
    most, eta = min(bounds, default=(len(scores), 0.0))
    if most >= len(scores):
        print("                 no fixed step bounds so few scores either: more of them would do")
    else:
        print(f"                 --rule fixed --eta {eta:g} would promise at most {most} misses")


def _rule(args: argparse.Namespace) -> Rule:
    from cpl.conformal import Fixed, RunningMax

    if args.method is not None:
        return _member(args)
    if args.rule == "fixed":
        if args.eta is None:
            msg = "--rule fixed needs --eta, the step in units of the score"
            raise UsageError(msg)
        return Fixed(eta=args.eta)
    if args.eta is not None:
        msg = "--eta goes with --rule fixed; a running maximum takes --share"
        raise UsageError(msg)
    return RunningMax(c=args.share)


def _member(args: argparse.Namespace) -> Rule:
    from cpl.conformal.family import MEMBERS

    if args.method not in MEMBERS:
        raise UsageError(f"--method must be one of {', '.join(MEMBERS)}, got {args.method!r}")
    if not args.scale > 0:
        raise UsageError(f"--scale must be > 0, got {args.scale!r}")
    return MEMBERS[args.method].make(args.scale)
