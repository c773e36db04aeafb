"""What does a person type?

Each module of this folder is one subcommand and has two functions:

- `register(subparsers)` adds its parser (name, one line of help, arguments);
- `run(args) -> int` does the work and returns the exit status.

A module is imported only when its command is typed, and imports what is heavy inside `run`, so that
an answer or a refusal takes less than a second. Exit status: 0 done, 1 it failed, 2 what was typed
makes no sense (the message on stderr names what is wrong and what it may be), 130 interrupted,
141 whoever read the output has left.
"""

from __future__ import annotations

import argparse
import os
import pkgutil
import platform
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from cpl.environ import in_checkout, one_thread, spell_paths
from cpl.optional import explain, look_all

__all__ = ["UsageError", "main", "project_root"]


class UsageError(Exception):
    """What was typed makes no sense: the message goes to stderr, the exit status is 2."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command that was typed.

    Args:
        argv: The words after `cpl`; those of the process unless given.

    Returns:
        The exit status.
    """
    if argv is None:
        spell_paths()
    words = list(sys.argv[1:] if argv is None else argv)
    parser = _parser(words)
    args = parser.parse_args(words)
    if args.command is None and not args.version:
        parser.error("the following arguments are required: COMMAND")
    one_thread()
    try:
        if args.version:
            status = _tell_version(args.long)
        else:
            status = import_module(f"{__name__}.{args.command}").run(args)
        sys.stdout.flush()  # a reader that has left is noticed here, not when Python goes
    except ImportError as error:
        lacks = explain(error)
        if lacks is None:
            raise
        print(f"cpl {args.command}: {lacks}", file=sys.stderr)
        return 2
    except UsageError as refusal:
        print(f"cpl {args.command}: {refusal}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # `cpl params | head -1`: the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except OSError as error:  # a full disk, a folder that cannot be written
        what = f"{error.strerror}: {error.filename}" if error.filename else str(error)
        print(f"cpl {args.command}: {what}", file=sys.stderr)
        return 1
    return status


def project_root() -> Path:
    """Return what `cpl.store.project_root` returns, without importing the store and its pandas.

    Raises:
        UsageError: The package is not in a checkout, so that there is no book and no `data/`.
    """
    root = Path(__file__).resolve().parents[2]
    if not in_checkout():
        raise UsageError(
            f"there is no book and no data/ in {root}: chapters, published results and claims are "
            "in the repository; clone it, and there `make venv` brings this command"
        )
    return root


def _tell_version(long: bool) -> int:
    """Look the version up only when it is asked for; the long answer tries every library."""
    from importlib.metadata import version

    print(f"cpl {version('cpl')}")
    if long:
        print(f"Python {platform.python_version()}, {sys.executable}")
        for library in look_all():
            print(library)
    return 0


def _parser(words: list[str]) -> argparse.ArgumentParser:
    """Return the parser with the command that was typed, or with all of them for `cpl --help`."""
    parser = argparse.ArgumentParser(
        prog="cpl",
        description="Run, build and check the executable book on conformal policy learning.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="store_true", help="show the version and exit")
    parser.add_argument(
        "--long", action="store_true", help="with --version: and which optional libraries work"
    )
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND")
    names = _commands()
    for name in words[:1] if words[:1] and words[0] in names else names:
        import_module(f"{__name__}.{name}").register(subparsers)
    return parser


def _commands() -> list[str]:
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))
