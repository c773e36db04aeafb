"""What happens when something goes wrong? Every fault once, and what the guard did."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from cpl.logs import read_run
from cpl.robot.interfaces import RobotError
from cpl.robot.session import collection, perform

__all__ = ["WHAT_TO_DO", "drill"]

WHAT_TO_DO: dict[str, str] = {
    "dropped": "look for a loose plug; go wired if it was radio",
    "late": "find what else uses the link; go wired",
    "duplicated": "nothing: numbers and checksums sort it out",
    "corrupted": "replace the cable",
    "cut": "damp with the remote at once; then the cable",
    "firmware": "do not walk: its firmware speaks another protocol than SDK 3.8",
    "babble": "something else sends to this port: find it",
    "battery": "let it lie down, change the battery",
    "damped": "somebody had a reason: ask before you go on",
    "frozen": "unplug and replug the camera, start the bridge again",
    "jump": "go on if it was one; more light and texture if it happens again",
    "lost": "fasten the plug, start the bridge again",
    "failed": "light, texture, lens; then begin the run again",
    "storm": "slower gains, more light; the log is valid",
    "camera_late": "close what else uses the camera's computer",
    "camera_corrupted": "start the bridge again",
    "outside": "carry it back to the start; is the start where the path begins?",
}
"""What a person does, fault by fault."""

LENGTH_S = 4.0  # of each run
START_S, STOP_S = 1.5, 3.0  # of the fault


def drill(names: Iterable[str] | None = None, library: str = "wire") -> pd.DataFrame:
    """Let each fault happen for 1.5 s in the middle of a short run.

    Args:
        names: Of faults; all unless given.
        library: What speaks to the emulated robot.

    Returns:
        One row a fault: `fault`, `what` it is, `guard` (its reasons, most frequent first),
        `stopped_s` after how long the robot was first asked for zero (NaN if never), `outcome`,
        `fastest_mps` that ever reached the robot, `rows` in the log, `do` for the person.
    """
    from cpl.robot.emulator import FAULTS

    chosen = list(FAULTS if names is None else names)
    with tempfile.TemporaryDirectory() as folder:
        return pd.DataFrame([_suffer(name, Path(folder) / name, library) for name in chosen])


def _suffer(name: str, folder: Path, library: str) -> dict[str, object]:
    from cpl.robot.emulator import FAULTS, Fault, Ideal, LockStep

    plan = replace(collection(1)[0], max_s=LENGTH_S)
    # Standing takes two tenths of a second: the fault's clock starts then.
    fault = Fault(name=name, start_s=START_S + 0.2, stop_s=STOP_S + 0.2)
    robot = LockStep(Ideal(), [fault], library=library)
    robot.place(plan.course.start, plan.seed)
    outcome, reasons, rows, stopped_s = "not started", dict[str, int](), 0, float("nan")
    try:
        walked = perform(robot.robot, plan, folder)
        stopped_s = _stopped(read_run(walked.path).table, walked.outcome)
        outcome, reasons, rows = walked.outcome, walked.reasons, walked.rows
    except RobotError as error:
        outcome = str(error)
    finally:
        robot.close()
    reasons.pop("speed_clamp", None)
    speeds = [(each.velocity[0] ** 2 + each.velocity[1] ** 2) ** 0.5 for each in robot.seen]
    return {
        "fault": name,
        "what": FAULTS[name],
        "guard": ", ".join(sorted(reasons, key=lambda each: -reasons[each])) or "nothing to do",
        "stopped_s": stopped_s,
        "outcome": outcome,
        "fastest_mps": max(speeds, default=0.0),
        "rows": rows,
        "do": WHAT_TO_DO[name],
    }


def _stopped(table: pd.DataFrame, outcome: str) -> float:
    """Return how long after the fault the robot was first asked for zero [s]; NaN if never."""
    table = table.iloc[:-1] if outcome == "timeout" else table  # a run's end is zero anyway
    sent = table[["cmd_v_x_mps", "cmd_v_y_mps", "cmd_yaw_rate_radps"]].to_numpy(dtype=np.float64)
    t_s = table["t_s"].to_numpy(dtype=np.float64)
    still = t_s[(np.abs(sent).sum(axis=1) == 0) & (t_s >= START_S - 0.05)]
    return max(float(still[0]) - START_S, 0.0) if len(still) else float("nan")
