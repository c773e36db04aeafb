"""`cpl verify`: re-execute a seeded sample of what is published, and compare."""

from __future__ import annotations

import argparse
import sys

from cpl.cli import UsageError, project_root

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "verify",
        help="re-execute a sample of the published results and compare",
        description="Exit status 1 if anything differs: equal where discrete, else to tolerance.",
    )
    parser.add_argument("experiment", nargs="?", help="its name (default: all that is published)")
    parser.add_argument("--profile", default="paper", help="which one (default: paper)")
    parser.add_argument("--sample", type=int, default=2, help="shards of each (default: 2)")
    parser.add_argument("--seed", type=int, default=0, help="which ones (default: 0)")
    parser.add_argument(
        "--record", action="store_true", help="write down that it agreed, with today's code"
    )


def run(args: argparse.Namespace) -> int:
    """Verify one experiment or all, one line each."""
    project_root()  # what is published is in the repository
    from cpl.experiments.run.publication import verify
    from cpl.store import DamagedResultError, data_path, manifests

    try:
        chosen = (
            [(args.experiment, args.profile)]
            if args.experiment
            else [(m.experiment, m.profile) for m in manifests()]
        )
    except DamagedResultError as error:
        print(f"cpl verify: {error}", file=sys.stderr)
        return 1
    if not chosen:
        print(f"cpl verify: nothing is published in {data_path('results')}", file=sys.stderr)
        return 1
    agreed = True
    for name, profile in chosen:
        try:
            report = verify(name, profile, sample=args.sample, seed=args.seed, record=args.record)
        except DamagedResultError as error:
            print(f"{name}/{profile}: damaged: {error}")
            agreed = False
            continue
        except (ValueError, FileNotFoundError) as error:
            raise UsageError(error) from error
        verdict = "agrees" if report.agrees else "DIFFERS"
        share = f"{len(report.checked)} of {report.of} shards"
        print(f"{name}/{profile}: {verdict} ({share}, {report.seconds:.1f} s)")
        for difference in report.differences:
            print(f"  {difference}")
        agreed = agreed and report.agrees
    return 0 if agreed else 1
