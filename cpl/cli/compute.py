"""`cpl compute`: compute an experiment, in parallel, resuming where it was stopped."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from cpl.cli import UsageError

if TYPE_CHECKING:
    from cpl.experiments.run.result import Result

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "compute",
        help="compute experiments, resuming where it was stopped",
        description="Finished pieces are kept at once: after Ctrl-C the same command goes on.",
    )
    parser.add_argument(
        "experiment",
        nargs="+",
        help="its name (`cpl status` lists them); several share one pool",
    )
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
    """Compute, and show where the results come from."""
    from cpl.experiments.run.execute import run_jobs
    from cpl.experiments.run.job import job
    from cpl.experiments.run.settings import parsed
    from cpl.sweep import CodeMismatchError, WorkersLostError

    try:
        jobs = [job(name, args.profile) for name in dict.fromkeys(args.experiment)]
        jobs = [job(one.name, args.profile, parsed(one.config, args.settings)) for one in jobs]
    except ValueError as error:
        raise UsageError(error) from error
    if args.publish and any(one.profile != args.profile for one in jobs):
        msg = "--publish goes with an unchanged profile; leave --set away"
        raise UsageError(msg)
    try:
        for one, result in run_jobs(
            jobs, workers=args.workers, cluster=args.cluster, quiet=args.quiet
        ):
            if len(jobs) > 1:
                print(f"{one.name}:")
            _show(result, publish=args.publish)
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130
    except (WorkersLostError, CodeMismatchError, ImportError, OSError) as error:
        print(f"cpl compute: {error}", file=sys.stderr)
        return 1
    return 0


def _show(result: Result | Exception, *, publish: bool) -> None:
    """Print a result's settings and digest, and write it to the published layer if asked."""
    from cpl.experiments.run.publication import publish_result
    from cpl.experiments.run.settings import spelled

    if isinstance(result, Exception):
        raise result
    print(spelled(result.config))
    made = result.provenance
    print(f"{len(result.table)} rows in {len(made.shards)} shards, {made.seconds:.1f} s of work")
    print(f"content {made.content}")
    if publish:
        manifest = publish_result(result)
        print(f"published as {manifest.experiment}/{manifest.profile}, made {manifest.made}")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        msg = f"must be a positive integer, got {text!r}"
        raise argparse.ArgumentTypeError(msg)
    return int(text)
