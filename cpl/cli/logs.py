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
    parser = subparsers.add_parser(
        "logs",
        help="look into, check, convert or draw a robot's recording",
        description="Reads runs of cpl, bags of ROS 1 and 2, MCAP of any program, TUM, KITTI, "
        "EuRoC, rs-convert, rostopic echo -p, CSV and netCDF; `cpl logs formats` shows how each "
        "begins.",
    )
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    info = actions.add_parser("info", help="what a recording holds and where it comes from")
    check = actions.add_parser(
        "check",
        help="whether a recording is whole",
        description="Exit status: 0 whole, 1 damaged but recovered, 2 unusable; the worst counts.",
    )
    for each in (info, check):
        each.add_argument(
            "files", nargs="+", type=Path, metavar="FILE", help="a recording, or a folder"
        )
    convert = actions.add_parser(
        "convert",
        help="to MCAP or CSV",
        description="Exit status: 0 converted whole, 1 converted what could be recovered, 2 not.",
    )
    plot = actions.add_parser("plot", help="to SVG or PNG")
    for each, what in ((convert, ".mcap or .csv"), (plot, ".svg or .png")):
        each.add_argument("file", type=Path, metavar="FILE", help="a recording")
        each.add_argument("out", type=Path, metavar="OUT", help=f"{what}; it must not exist yet")
    convert.add_argument("--rate", type=float, metavar="HZ", help="thin poses out to this rate")
    for each in (info, check, convert, plot):
        _add_options(each)
    actions.add_parser("formats", help="what is read, and how each format begins")
    actions.add_parser(
        "fetch",
        help="recordings of real machines, by pip and by hash",
        description="Fetches the packages evo and gtsam into _build/recordings and takes out data "
        "files only. They are under their makers' licences: use them, do not pass them on.",
    )


def _add_options(parser: argparse.ArgumentParser) -> None:
    """Add what a file may leave open, and its reader knows."""
    parser.add_argument("--provenance", help="where a recording is from, if it does not say")
    parser.add_argument("--axes", choices=("ros", "t265", "camera"), help="its axes, likewise")
    parser.add_argument("--topic", help="the poses' topic, if there are several")
    parser.add_argument("--format", metavar="NAME", help="its format, if its content does not tell")
    parser.add_argument("--quaternion", choices=("xyzw", "wxyz"), help="the order of attitudes")
    parser.add_argument("--unit", choices=("m", "cm", "mm"), help="the unit of positions")
    parser.add_argument("--times", type=Path, metavar="FILE", help="a time a line, for KITTI")
    parser.add_argument("--pose-rate", type=float, metavar="HZ", help="the rate of untimed poses")


def run(args: argparse.Namespace) -> int:
    """Do what was asked for; the exit status says how sound the log is."""
    from cpl.logs import PROVENANCES, LogError

    if args.action == "formats":
        return _formats()
    if args.action == "fetch":
        return _fetch()
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
        raise UsageError(_plain(what)) from error


def _plain(text: str) -> str:
    """Return a text that cannot steer a terminal."""
    from cpl.logs.errors import printable

    return printable(text)


def _say(text: str) -> None:
    print(_plain(text))


def _formats() -> int:
    """List what is read, with an example each."""
    from cpl.logs import formats

    for each in formats():
        print(f"{each.name}: {each.title}")
        for line in each.example.splitlines():
            print(f"    {line}")
        print(f"  {each.lacks}")
        if each.options:
            print(f"  options: {' '.join(each.options)}")
    return 0


def _fetch() -> int:
    """Fetch the recordings that the chapter on real machines is about."""
    from cpl.logs.fetch import PACKAGES, RecordingsError, fetch

    try:
        found = fetch()
    except (RecordingsError, OSError) as error:
        print(_plain(f"cpl logs: {error}"), file=sys.stderr)
        return 1
    for package in PACKAGES:
        print(f"{package.name} {package.version}: {', '.join(package.files)} ({package.licence})")
    print(f"{len(found)} files in {found[0].parent}")
    return 0


def _files(named: list[Path]) -> list[Path]:
    """Return the logs that were named, with those in named folders."""
    from cpl.logs.sources import recordings

    found = [path for each in named for path in (recordings(each) if each.is_dir() else [each])]
    if not found:
        raise UsageError(_plain(f"there is no log in {', '.join(map(str, named))}"))
    return found


def _read(path: Path, args: argparse.Namespace, *, silent: str | None = None) -> Run:
    from cpl.logs import read_run

    try:
        return read_run(
            path,
            provenance=args.provenance,
            silent=silent,
            axes=args.axes,
            topic=args.topic,
            quaternion=args.quaternion,
            unit=args.unit,
            times=args.times,
            pose_rate_hz=args.pose_rate,
            format=args.format,
        )
    except ValueError as error:
        from cpl.logs import LogError

        if isinstance(error, LogError):
            raise
        raise UsageError(str(error)) from error


def _each(path: Path, args: argparse.Namespace, show) -> int:  # noqa: ANN001 - one of two below
    from cpl.logs import LogError

    try:
        log = _read(path, args, silent="unstated")
    except LogError as error:
        return _refused(error)
    show(log)
    return int(not log.recovery.whole)


def _refused(error: Exception) -> int:
    """Say why a log is unusable. The class's name is the fault's."""
    name = type(error).__name__.removesuffix("Error")
    print(_plain(f"cpl logs: unusable ({name}): {error}"), file=sys.stderr)
    return 2


def _verdict(log: Run) -> None:
    told = log.recovery
    _say(f"{log.path.name}: {told}")
    _say(f"  plausible? {told.plausibility}")
    for fault in told.faults[:SHOWN]:
        _say(f"  {fault}")
    if len(told.faults) > SHOWN:
        _say(f"  and {len(told.faults) - SHOWN} more")
    for note in told.notes:
        _say(f"  note: {note}")


def _info(log: Run) -> None:
    from datetime import UTC, datetime

    from cpl.logs import CHANNELS
    from cpl.store import canonical_json

    _verdict(log)
    _say(f"  provenance: {log.info.provenance}")
    _say(f"  seed: {'none' if log.info.seed is None else log.info.seed}")
    if log.info.start_unix_ns:
        began = datetime.fromtimestamp(log.info.start_unix_ns / 1e9, tz=UTC)
        _say(f"  began: {began:%Y-%m-%d %H:%M:%S} UTC")
    if log.recovery.rows > 1:
        rate = (log.recovery.rows - 1) / log.duration_s
        _say(f"  rate: {rate:.1f} Hz in {len(log.segments())} stretches without a gap")
    print("  channels:")
    for each in CHANNELS:
        if each.topic in log.topics:
            fields = " ".join(f"{name}[{unit}]" for name, unit in each.units.items())
            frame = f" ({each.frame} frame)" if each.frame else ""
            print(f"    {each.topic}: {fields}{frame}")
    print(f"  not there: {' '.join(log.missing) or 'nothing is missing'}")
    for name, value in (("config", log.info.config), ("source", log.info.source)):
        if value:
            _say(f"  {name}: {canonical_json(value)}")


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
    _say(f"{args.out}: {log.recovery.rows} rows")
    return int(not log.recovery.whole)


def _plot(args: argparse.Namespace) -> int:
    from io import BytesIO

    from cpl.cli._out import write_out

    if args.out.suffix not in ENDINGS:
        raise UsageError(f"OUT must end in {' or '.join(ENDINGS)}, got {args.out.name!r}")
    _fresh(args.out)
    log = _read(args.file, args, silent="unstated")
    from cpl.figures.logs import overview

    figure = overview(log.table, label=log.label)
    if args.out.suffix == ".svg":
        write_out(args.out, figure.svg())
    else:
        image = BytesIO()
        figure.savefig(image, format="png", dpi=150)
        write_out(args.out, image.getvalue())
    _verdict(log)
    _say(str(args.out))
    return int(not log.recovery.whole)


def _fresh(out: Path) -> None:
    if out.exists():
        raise UsageError(_plain(f"{out} exists already; name another file"))
