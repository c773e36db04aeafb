"""`cpl logs`: look into a robot's recordings, check them, convert them, draw them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from cpl.cli import UsageError

if TYPE_CHECKING:
    from cpl.logs import Run

__all__ = ["register", "run"]

SHOWN = 10  # faults that are shown one by one
ENDINGS = (".png", ".svg")


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "logs",
        help="look into, check, convert or draw a robot's log",
        description="Logs are MCAP of cpl; bags of ROS 1 and 2, CSV and netCDF 4 are read too.",
    )
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    info = actions.add_parser("info", help="what a log holds and where it comes from")
    check = actions.add_parser(
        "check",
        help="whether a log is whole",
        description="Exit status: 0 whole, 1 damaged but recovered, 2 unusable; the worst counts.",
    )
    for each in (info, check):
        each.add_argument("files", nargs="+", type=Path, metavar="FILE", help="a log, or a folder")
    convert = actions.add_parser(
        "convert",
        help="to MCAP or CSV",
        description="Exit status: 0 converted whole, 1 converted what could be recovered, 2 not.",
    )
    plot = actions.add_parser("plot", help="to SVG or PNG")
    for each, what in ((convert, ".mcap or .csv"), (plot, ".svg or .png")):
        each.add_argument("file", type=Path, metavar="FILE", help="a log")
        each.add_argument("out", type=Path, metavar="OUT", help=f"{what}; it must not exist yet")
    convert.add_argument("--rate", type=float, metavar="HZ", help="thin poses out to this rate")
    for each in (info, check, convert, plot):
        each.add_argument("--provenance", help="where a recording is from, if it does not say")
        each.add_argument("--axes", choices=("ros", "t265"), help="its axes, if it does not say")
        each.add_argument("--topic", help="the poses' topic, if a bag has several")


def run(args: argparse.Namespace) -> int:
    """Do what was asked for; the exit status says how sound the log is."""
    from cpl.logs import PROVENANCES, LogError

    if args.provenance is not None and args.provenance not in PROVENANCES:
        msg = f"--provenance must be one of {', '.join(PROVENANCES)}, got {args.provenance!r}"
        raise UsageError(msg)
    try:
        match args.action:
            case "info" | "check":
                show = _info if args.action == "info" else _verdict
                return max(_each(path, args, show) for path in _files(args.files))
            case "convert":
                return _convert(args)
            case _:
                return _plot(args)
    except LogError as error:
        return _refused(error)
    except OSError as error:
        what = f"{error.strerror}: {error.filename}" if error.filename else str(error)
        raise UsageError(what) from error


def _files(named: list[Path]) -> list[Path]:
    """Return the logs that were named, with those in named folders."""
    from cpl.logs.sources import recordings

    found = [path for each in named for path in (recordings(each) if each.is_dir() else [each])]
    if not found:
        raise UsageError(f"there is no log in {', '.join(map(str, named))}")
    return found


def _read(path: Path, args: argparse.Namespace) -> Run:
    from cpl.logs import read_run

    return read_run(path, provenance=args.provenance, axes=args.axes, topic=args.topic)


def _each(path: Path, args: argparse.Namespace, show) -> int:  # noqa: ANN001 - one of two below
    from cpl.logs import LogError

    try:
        log = _read(path, args)
    except LogError as error:
        return _refused(error)
    show(log)
    return int(not log.recovery.whole)


def _refused(error: Exception) -> int:
    """Say why a log is unusable. The class's name is the fault's."""
    name = type(error).__name__.removesuffix("Error")
    print(f"cpl logs: unusable ({name}): {error}", file=sys.stderr)
    return 2


def _verdict(log: Run) -> None:
    told = log.recovery
    print(f"{log.path.name}: {told}")
    for fault in told.faults[:SHOWN]:
        print(f"  {fault}")
    if len(told.faults) > SHOWN:
        print(f"  and {len(told.faults) - SHOWN} more")
    for note in told.notes:
        print(f"  note: {note}")


def _info(log: Run) -> None:
    from datetime import UTC, datetime

    from cpl.logs import CHANNELS
    from cpl.store import canonical_json

    _verdict(log)
    print(f"  provenance: {log.info.provenance}")
    print(f"  seed: {'none' if log.info.seed is None else log.info.seed}")
    if log.info.start_unix_ns:
        began = datetime.fromtimestamp(log.info.start_unix_ns / 1e9, tz=UTC)
        print(f"  began: {began:%Y-%m-%d %H:%M:%S} UTC")
    if log.recovery.rows > 1:
        rate = (log.recovery.rows - 1) / log.duration_s
        print(f"  rate: {rate:.1f} Hz in {len(log.segments())} stretches without a gap")
    print("  channels:")
    for each in CHANNELS:
        if each.topic in log.topics:
            fields = " ".join(f"{name}[{unit}]" for name, unit in each.units.items())
            frame = f" ({each.frame} frame)" if each.frame else ""
            print(f"    {each.topic}: {fields}{frame}")
    print(f"  not there: {' '.join(log.missing) or 'nothing is missing'}")
    for name, value in (("config", log.info.config), ("source", log.info.source)):
        if value:
            print(f"  {name}: {canonical_json(value)}")


def _convert(args: argparse.Namespace) -> int:
    from cpl.logs import save_run

    if args.out.suffix not in (".mcap", ".csv"):
        raise UsageError(f"OUT must end in .mcap or .csv, got {args.out.name!r}")
    _fresh(args.out)
    log = _read(args.file, args)
    if args.rate is not None:
        try:
            log = log.downsampled(args.rate)
        except ValueError as error:
            raise UsageError(str(error)) from error
    save_run(log, args.out)
    _verdict(log)
    print(f"{args.out}: {log.recovery.rows} rows")
    return int(not log.recovery.whole)


def _plot(args: argparse.Namespace) -> int:
    from io import BytesIO

    from cpl.store import atomic_write

    if args.out.suffix not in ENDINGS:
        raise UsageError(f"OUT must end in {' or '.join(ENDINGS)}, got {args.out.name!r}")
    _fresh(args.out)
    log = _read(args.file, args)
    from cpl.figures.logs import overview

    figure = overview(log.table, label=log.label)
    if args.out.suffix == ".svg":
        atomic_write(args.out, figure.svg())
    else:
        image = BytesIO()
        figure.savefig(image, format="png", dpi=150)
        atomic_write(args.out, image.getvalue())
    _verdict(log)
    print(args.out)
    return int(not log.recovery.whole)


def _fresh(out: Path) -> None:
    if out.exists():
        raise UsageError(f"{out} exists already; name another file")
