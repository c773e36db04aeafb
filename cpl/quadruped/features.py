"""What does the predictor see, and what is it asked? 47 numbers, and the error two steps later.

    47 = 5 x 3 past states + 5 x 3 past commands + 4 x 3 waypoints + 5 past SLAM errors

Paper: Section V-B. At step t the newest state and error are those of t, the newest command is that
of t - 1, because the command of t waits for the prediction.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.paths import Path

__all__ = ["FEATURES", "HORIZON", "PAST", "History", "dataset", "labels", "upcoming"]

PAST = 5  # [steps] of memory
AHEAD = 4  # [waypoints] the target and the next three
HORIZON = 2  # [steps] from the prediction to the predicted error

FEATURES: tuple[str, ...] = (
    *(f"{name}[t-{k}]" for k in range(PAST - 1, -1, -1) for name in ("x_m", "y_m", "yaw_rad")),
    *(f"{name}[t-{k}]" for k in range(PAST, 0, -1) for name in ("cmd_v_x", "cmd_v_y", "cmd_yaw")),
    *(f"waypoint_{name}[i+{k}]" for k in range(AHEAD) for name in ("x_m", "y_m", "yaw_rad")),
    *(f"slam_error[t-{k}]" for k in range(PAST - 1, -1, -1)),
)


class History:
    """The last five states, commands and errors of one run.

    Before five steps have passed, the first state stands for the missing ones, and the missing
    commands and errors are zero: a robot that stood still.

    >>> history = History()
    >>> history.observe((0.0, 0.0, 0.0), False)
    >>> history.features(upcoming(Path(name="line", waypoints=np.eye(3)), 0)).shape
    (47,)
    """

    def __init__(self) -> None:
        self._states: deque[tuple[float, float, float]] = deque(maxlen=PAST)
        self._errors: deque[float] = deque([0.0] * PAST, maxlen=PAST)
        self._commands: deque[tuple[float, float, float]] = deque(
            [(0.0, 0.0, 0.0)] * PAST, maxlen=PAST
        )

    def observe(self, pose: Sequence[float], slam_error: bool) -> None:
        """Remember the estimated pose (x [m], y [m], yaw [rad]) and the error of this step."""
        state = (float(pose[0]), float(pose[1]), float(pose[2]))
        self._states.extend([state] * (PAST if not self._states else 1))
        self._errors.append(float(slam_error))

    def sent(self, command: Sequence[float]) -> None:
        """Remember the command that went to the robot in this step."""
        self._commands.append((float(command[0]), float(command[1]), float(command[2])))

    def features(self, waypoints: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the 47 numbers.

        Args:
            waypoints: The target and the next three, shape (4, 3).

        Raises:
            ValueError: Nothing has been observed yet.
        """
        if not self._states:
            raise ValueError("features need at least one observe(), not 0")
        parts = (self._states, self._commands, waypoints, self._errors)
        return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])


def upcoming(path: Path, index: int) -> NDArray[np.float64]:
    """Return the target and the next three waypoints; the last one is repeated past the end.

    Args:
        path: The path.
        index: The target's index.

    Returns:
        x [m], y [m], heading [rad], shape (4, 3).
    """
    return path.waypoints[np.minimum(np.arange(index, index + AHEAD), len(path) - 1)]


def labels(slam_errors: Sequence[bool] | NDArray[Any]) -> NDArray[np.float64]:
    """Return l_t: whether there is a SLAM error at step t + 2.

    Args:
        slam_errors: Whether each step had an error (any non-zero code), shape (T,).

    Returns:
        0 or 1, shape (T - 2,): the last two steps have no label.

    >>> labels([False, False, True, False]).tolist()
    [1.0, 0.0]
    """
    return (np.asarray(slam_errors) != 0).astype(np.float64)[HORIZON:]


def dataset(
    rows: Iterable[Mapping[str, Any]], path: Path
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return features and labels of one logged run, as the predictor would have seen them live.

    Args:
        rows: The run's log rows, in order.
        path: The path that it followed.

    Returns:
        Features (T - 2, 47) and labels (T - 2,).
    """
    history, inputs, errors = History(), [], []
    for row in rows:
        history.observe((row["x_m"], row["y_m"], row["yaw_rad"]), row["slam_error"] != 0)
        inputs.append(history.features(upcoming(path, row["waypoint_index"])))
        history.sent((row["cmd_v_x_mps"], row["cmd_v_y_mps"], row["cmd_yaw_rate_radps"]))
        errors.append(row["slam_error"] != 0)
    return np.reshape(inputs, (-1, len(FEATURES)))[: max(len(errors) - HORIZON, 0)], labels(errors)
