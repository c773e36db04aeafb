"""`cpl robot`: check, rehearse, run, replay; draw a key; train on what was collected."""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cpl.cli import UsageError
from cpl.environ import kept_path

if TYPE_CHECKING:
    from cpl.quadruped import Predictor
    from cpl.robot import Plan
    from cpl.robot.live import Hardware

__all__ = ["register", "run"]

CONFIRMATION = "the robot may move"
UNANSWERED = "the robot does not answer"  # one of `cpl.robot.packets.TRIPS`


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "robot",
        help="rehearse on emulators, or run on a Go1 with a T265",
        description="Nothing here has driven a physical robot: read the chapter `run_it` first.",
    )
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    _rehearse(actions.add_parser("rehearse", help="the whole procedure on emulators"))
    check = actions.add_parser("check", help="the pre-flight list; stops where an item fails")
    check.add_argument("--emulator", action="store_true", help="an emulator in the robot's place")
    walk = actions.add_parser("run", help="walk, on hardware, after an explicit confirmation")
    walk.add_argument("what", choices=("collect", "evaluate"), help="which runs")
    walk.add_argument("--first", type=int, default=0, metavar="N", help="begin with the Nth run")
    walk.add_argument("--runs", type=int, default=1, metavar="N", help="how many runs (1)")
    walk.add_argument("--repeats", type=int, default=3, metavar="N", help="evaluation repeats (3)")
    walk.add_argument(
        "--numbered", action="store_true", help="where a log exists, write NAME.2 beside it"
    )
    walk.add_argument("--predictor", type=Path, metavar="FILE", help="what `train` wrote")
    for each in (check, walk):
        _where(each)
    key = actions.add_parser("key", help="draw a key for a watchdog or a bridge that runs apart")
    key.add_argument("file", type=Path, metavar="FILE", help="where to: a new file, mode 600")
    train = actions.add_parser("train", help="train the predictor on collected logs")
    train.add_argument("folder", type=Path, metavar="FOLDER", help="logs of the training runs")
    train.add_argument("predictor", type=Path, metavar="FILE", help="where to: a new .safetensors")
    train.add_argument("--seed", type=int, default=0)
    replay = actions.add_parser("replay", help="send a log through the loop again and compare")
    replay.add_argument("file", type=Path, metavar="FILE", help="a log of `rehearse` or `run`")


def _rehearse(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, metavar="DIR", help="a new folder (in _build/robot)")
    parser.add_argument("--trajectories", type=int, default=43, metavar="N", help="training runs")
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="evaluation repeats")
    parser.add_argument("--seconds", type=float, default=8.0, help="of the real-time run; 0: none")
    parser.add_argument("--watchdog", choices=("laptop", "robot"), default="laptop")
    parser.add_argument("--library", choices=("auto", "sdk", "wire"), default="auto")
    parser.add_argument("--camera-python", metavar="PYTHON", help="whose pyrealsense2 to use")
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="NAME@START:STOP",
        help="let something go wrong in the real-time run [s]; `--fault list` names them",
    )
    parser.add_argument("--seed", type=int, default=0)


def _where(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, metavar="DIR", help="where logs go (_build/robot)")
    parser.add_argument("--robot", metavar="HOST:PORT", help="the Go1 (192.168.123.161:8082)")
    parser.add_argument("--local-port", type=int, metavar="PORT", help="to send from (8080)")
    parser.add_argument("--watchdog-at", metavar="HOST:PORT", help="a watchdog on the robot")
    parser.add_argument(
        "--key-file", type=Path, metavar="FILE", help="what it, or that bridge, shares (mode 600)"
    )
    parser.add_argument("--camera-python", metavar="PYTHON", help="Python 3.10 with pyrealsense2")
    parser.add_argument("--camera-port", type=int, metavar="PORT", help="a bridge sends poses here")
    parser.add_argument("--fence", type=float, default=3.0, metavar="M", help="|x|, |y| allowed")
    parser.add_argument("--v-max", type=float, default=1.0, metavar="M/S", help="top speed")


def run(args: argparse.Namespace) -> int:
    """Do what was asked for."""
    from cpl.robot import RobotError

    doing = {
        "rehearse": _do_rehearse,
        "check": _do_check,
        "run": _do_run,
        "key": _do_key,
        "train": _do_train,
        "replay": _do_replay,
    }
    try:
        return doing[args.action](args)
    except RobotError as error:
        print(f"cpl robot {args.action}: {error}", file=sys.stderr)
        return 1
    except ValueError as error:
        raise UsageError(str(error)) from error


def _do_rehearse(args: argparse.Namespace) -> int:
    from cpl.robot.emulator import FAULTS
    from cpl.robot.rehearsal import Rehearsal, rehearse

    if "list" in args.fault:
        print("\n".join(f"{name:18}{what}" for name, what in FAULTS.items()))
        return 0
    rehearsal = Rehearsal(
        trajectories=args.trajectories,
        repeats=args.repeats,
        seconds=args.seconds,
        placement=args.watchdog,
        faults=tuple(args.fault),
        library=args.library,
        camera_python=args.camera_python,
        seed=args.seed,
    )
    folder = args.out or _new_folder("rehearsal")
    _analyse(rehearse(rehearsal, folder, _say))
    return 0


def _do_check(args: argparse.Namespace) -> int:
    from cpl.robot import evaluation
    from cpl.robot.checklist import QUESTIONS, before, connected, watchdog_trips
    from cpl.robot.live import Emulated, emulated, hardware

    course = evaluation(1)[0].course
    config, folder = _hardware(args, args.emulator), args.out or _new_folder("check")
    physical = not (args.emulator or config.provenance.startswith("simulated"))
    if physical:
        _confirm(config)  # it will stand up
    if not _passed(before(folder, hardware=physical, camera_python=config.camera_python)):
        return 1
    if args.emulator:
        with emulated(Emulated(start=course.start, guard=config.guard), folder) as stage:
            fine = _passed(connected(stage.robot, course, config.guard))
            return int(not (fine and _passed([watchdog_trips(stage.robot)])))
    with hardware(config, folder) as robot:
        fine = _passed(connected(robot, course, config.guard))
        fine = fine and _passed([watchdog_trips(robot)])
    if fine:
        print("What no program can see; `cpl robot run` asks it:")
        print("\n".join(f"[??] {question}" for question in QUESTIONS))
    return int(not fine)


def _do_run(args: argparse.Namespace) -> int:
    from cpl.quadruped import decode_predictor
    from cpl.robot import collection, evaluation
    from cpl.robot.session import log_path, numbered

    plans = collection() if args.what == "collect" else evaluation(args.repeats)
    if not 0 <= args.first < len(plans) or args.runs < 1:
        raise UsageError(f"--first must be in [0, {len(plans) - 1}], not {args.first}")
    if args.what == "evaluate" and args.predictor is None:
        raise UsageError("--predictor must name what `cpl robot train` wrote")
    predictor = None if args.predictor is None else decode_predictor(args.predictor.read_bytes())[0]
    folder, config = args.out or _new_folder(args.what), _hardware(args)
    chosen = plans[args.first : args.first + args.runs]
    if args.numbered:
        chosen = [numbered(folder, plan) for plan in chosen]
    for plan in chosen:
        log_path(folder, plan)  # none of them costs a log
    _confirm(config)
    for plan in chosen:
        if not _one(plan, folder, config, predictor, args):
            return 1
    _analyse(folder)
    return 0


def _one(
    plan: Plan,
    folder: Path,
    config: Hardware,
    predictor: Predictor | None,
    args: argparse.Namespace,
) -> bool:
    """Make one run: list, questions, walk. Each run has a watchdog of its own."""
    from cpl.robot import View, perform, urgent
    from cpl.robot.checklist import QUESTIONS, before, connected
    from cpl.robot.keyboard import Operator
    from cpl.robot.live import hardware

    physical = not config.provenance.startswith("simulated")
    print(f"\n{plan.name}: {plan.shape}, gain {plan.kp_min} to {plan.kp_max}, {plan.policy}")
    if not _passed(before(folder, hardware=physical, camera_python=config.camera_python)):
        return False
    if not all(_asked(question) for question in QUESTIONS):
        print("not confirmed: nothing moves", file=sys.stderr)
        return False
    with Operator() as operator, hardware(config, folder / "processes", operator) as robot:
        if not _passed(connected(robot, plan.course, config.guard)):
            return False
        state = robot.base.state
        view = View(plan.course, (plan.kp_min, plan.kp_max), lambda: getattr(state(), "battery", 0))
        print("Walking. Ctrl-C or Enter stops it.")
        with urgent():
            walked = perform(
                robot, plan, folder, predictor=predictor, config=config.guard, watch=view
            )
        if getattr(state(), "tripped", "") == UNANSWERED:
            print("The robot does not answer: it is asked for zero until it does, for a minute.")
            print("Damp it with the remote.")
    print(f"{walked.path}: {walked.outcome} after {walked.duration_s:.1f} s, {walked.rows} rows")
    return walked.outcome in ("arrived", "timeout")


def _do_key(args: argparse.Namespace) -> int:
    from cpl.robot.seal import make_key_file

    make_key_file(args.file)
    print(f"{args.file}: give it to both ends (scp -p), and to nobody else")
    return 0


def _do_train(args: argparse.Namespace) -> int:
    from cpl.robot.rehearsal import train_on

    if args.predictor.exists() or args.predictor.suffix != ".safetensors":
        raise UsageError(f"FILE must be new and end in .safetensors, not {args.predictor}")
    rows, positive = train_on(args.folder, args.predictor, args.seed)
    print(f"{rows} rows, {positive:.1%} of them before a SLAM error\n{args.predictor}")
    return 0


def _do_replay(args: argparse.Namespace) -> int:
    from cpl.logs import read_run
    from cpl.quadruped import Path as Course
    from cpl.robot import View, replay, replayed

    log = read_run(args.file)
    print(f"{log.path.name}: {log.info.label}; {log.recovery}")
    rows = replay(log)
    first = next(rows)
    said = log.info.config
    course = Course(name=str(said.get("shape", "path")), waypoints=said["waypoints"])
    view = View(course, (said["kp_min"], said["kp_max"]))
    again = [first, *rows]
    for row in again:
        view(row)
    parted = replayed(log, again)
    print(f"{len(again) - len(parted)} of {len(again)} steps give the logged command and gain")
    if len(parted):
        print(parted.head(10).to_string(index=False))
    return int(bool(len(parted)))


def _hardware(args: argparse.Namespace, emulated: bool = False) -> Hardware:
    from cpl.robot import GO1, LOCAL_PORT, SUPERVISOR, GuardConfig, address, is_loopback
    from cpl.robot.live import Hardware
    from cpl.robot.seal import key_of_file, new_key

    robot = GO1 if args.robot is None else address(args.robot)
    emulator = is_loopback(robot[0])
    port = args.local_port if args.local_port is not None else 0 if emulator else LOCAL_PORT
    python = args.camera_python
    if python is None and args.camera_port is None and not emulator:
        python = "python3.10"
    key = None if args.key_file is None else key_of_file(args.key_file)
    if key is None and emulated:
        key = new_key()  # its processes are all of this run
    if key is None and (args.watchdog_at or python is None):
        what = "--watchdog-at" if args.watchdog_at else "poses from a bridge that runs already"
        raise UsageError(f"{what}: --key-file must name what `cpl robot key` wrote, for both ends")
    return Hardware(
        robot=robot,
        local_port=port,
        watchdog=None if args.watchdog_at is None else address(args.watchdog_at),
        key=key,
        camera_python=python,
        camera_port=args.camera_port or 0,
        guard=GuardConfig(
            supervisor=replace(SUPERVISOR, v_max_mps=args.v_max, fence_half_width_m=args.fence)
        ),
        provenance="simulated-kinematic" if emulator else "real-Go1",
    )


def _passed(items) -> bool:  # noqa: ANN001 - items of the checklist
    fine = True
    for item in items:
        print(item, file=sys.stdout if item.ok else sys.stderr, flush=True)
        fine = fine and item.ok
    return fine


def _confirm(config: Hardware) -> None:
    """Let a person at a keyboard say that the robot may move; nobody else can."""
    what = "an emulator" if config.provenance.startswith("simulated") else "a physical robot"
    if not sys.stdin.isatty():
        raise UsageError("run must be confirmed by a person at a terminal, and there is none")
    print(f"This moves {what} at {config.robot[0]}:{config.robot[1]}.")
    if input(f"Type '{CONFIRMATION}' to go on: ").strip().lower() != CONFIRMATION:
        raise UsageError("not confirmed: nothing moves")


def _asked(question: str) -> bool:
    return input(f"{question} [y/N] ").strip().lower() in ("y", "yes")


def _analyse(folder: Path) -> None:
    """Say how to open the analysis chapter on these logs."""
    there = folder.resolve()
    root = Path(__file__).resolve().parents[2]
    shown = there.relative_to(root) if there.is_relative_to(root) else there
    print(f"\ncpl run logs --set folder={shown}")


def _new_folder(kind: str) -> Path:
    stamp = time.strftime("%Y%m%d-%H%M%S")
    return kept_path("robot", f"{kind}-{stamp}-{os.getpid()}")


def _say(text: str) -> None:
    print(text, flush=True)
