"""`cpl matter`: does a tracked quantile matter, to a log or to a policy of one's own?"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from cpl.cli import UsageError

if TYPE_CHECKING:
    from cpl.conformal import Rule

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "matter",
        help="does a tracked quantile matter, to a log or a policy of your own?",
        description="A log is a CSV with a column score, and if there are any: episode (the units "
        "of chance), forecast and limit (cautious where forecast + threshold > limit). A module "
        "(a name or a .py file) defines make(), act(observation, q), score(before, action, after), "
        "harm(info, terminated) and pace(reward, info) and is played with the tracked threshold, "
        "the same shuffled, its mean, another stream's, a moving average and constants. The "
        "book's own systems: " + ", ".join(_BOOK) + ".",
    )
    parser.add_argument("what", metavar="FILE|MODULE|SYSTEM", help="what is asked")
    parser.add_argument("--alpha", type=float, default=0.1, help="miscoverage aimed at (0.1)")
    parser.add_argument("--delay", type=int, default=1, help="of a log: steps until a score (1)")
    parser.add_argument("--method", default="running_max", help="what tracks (running_max)")
    parser.add_argument("--scale", type=float, default=1.0, help="size of the scores (1)")
    parser.add_argument("--margin", type=float, default=0.03, help="harm one would act on (0.03)")
    parser.add_argument("--streams", type=int, default=20, help="of a module: streams (20)")
    parser.add_argument("--episodes", type=int, default=10, help="of a module: of each (10)")
    parser.add_argument("--seed", type=int, default=0, help="of everything (0)")


_BOOK = (
    "switch", "gate", "gate-in", "gate-noise", "gate-in-turn", "walks-usual", "walks-larger",
)  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Ask, and print the answer."""
    try:
        print(_answer(args))
    except (ValueError, OSError) as error:
        raise UsageError(error) from error
    return 0


def _answer(args: argparse.Namespace) -> object:
    from cpl.policies.matter import (
        SYSTEMS,
        WALKS,
        Playable,
        ask_log,
        ask_system,
        ask_walks,
        judge,
        play,
        read_log,
    )  # fmt: skip

    if args.what in SYSTEMS:
        return ask_system(args.what, margin=args.margin)
    if args.what in WALKS:
        return ask_walks(args.what)
    rule = _rule(args.method, args.scale)
    path = Path(args.what)
    if path.suffix == ".py" or not path.suffix:
        system = Playable.of(_module(args.what))
        outcomes = play(
            system, rule, alpha=args.alpha,
            streams=args.streams, episodes=args.episodes, seed=args.seed,
        )  # fmt: skip
        return judge(outcomes, margin=args.margin)
    return ask_log(read_log(path), rule, alpha=args.alpha, delay=args.delay, seed=args.seed)


def _rule(method: str, scale: float) -> Rule:
    from cpl.conformal.family import MEMBERS

    if method not in MEMBERS:
        raise UsageError(f"--method must be one of {', '.join(MEMBERS)}, got {method!r}")
    if not scale > 0:
        raise UsageError(f"--scale must be > 0, got {scale!r}")
    return MEMBERS[method].make(scale)


def _module(name: str) -> ModuleType:
    path = Path(name)
    if path.suffix != ".py":
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name != name.partition(".")[0]:
                raise
            raise UsageError(
                f"{name!r} is neither a log (.csv), a .py file, a module nor one of the book's "
                f"systems ({', '.join(_BOOK)})"
            ) from error
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise UsageError(f"no such file: {name}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
