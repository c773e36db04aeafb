"""`cpl compute`: compute an experiment, in parallel, resuming where it was stopped."""

from __future__ import annotations

import argparse
import sys

from cpl.cli import UsageError

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "compute",
        help="compute an experiment, resuming where it was stopped",
        description="Finished pieces are kept at once: after Ctrl-C the same command goes on.",
    )
    parser.add_argument("experiment", help="its name; `cpl status` lists them")
    parser.add_argument("--profile", default="book", help="smoke, book (default) or paper")
    parser.add_argument(
        "--set",
        dest="settings",
        metavar="NAME=VALUE",
        action="extend",
        nargs="+",
        default=[],
        help="settings that differ from the profile's",
    )
    parser.add_argument("--workers", type=_count, help="processes (default: one a core)")
    parser.add_argument("--cluster", metavar="ADDRESS", help="dask scheduler, tcp://HOST:PORT")
    parser.add_argument("--publish", action="store_true", help="write the result to data/results/")
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def run(args: argparse.Namespace) -> int:
    """Compute, and show where the result comes from."""
    from cpl.experiments.run.publication import job, publish_result, run_job
    from cpl.experiments.run.settings import parsed, spelled
    from cpl.sweep import CodeMismatchError, WorkersLostError

    try:
        plan = job(args.experiment, args.profile)
        plan = job(args.experiment, args.profile, parsed(plan.config, args.settings))
    except ValueError as error:
        raise UsageError(error) from error
    if args.publish and plan.profile != args.profile:
        msg = "--publish goes with an unchanged profile; leave --set away"
        raise UsageError(msg)
    try:
        result = run_job(plan, workers=args.workers, cluster=args.cluster, quiet=args.quiet)
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130
    except (WorkersLostError, CodeMismatchError, ImportError, OSError) as error:
        print(f"cpl compute: {error}", file=sys.stderr)
        return 1
    provenance = result.provenance
    print(spelled(result.config))
    shards, seconds = len(provenance.shards), provenance.seconds
    print(f"{len(result.table)} rows in {shards} shards, {seconds:.1f} s of work")
    print(f"content {provenance.content}")
    if args.publish:
        manifest = publish_result(result)
        print(f"published as {manifest.experiment}/{manifest.profile}, made {manifest.made}")
    return 0


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        msg = f"must be a positive integer, got {text!r}"
        raise argparse.ArgumentTypeError(msg)
    return int(text)
