"""KITTI poses: the first three rows of a matrix a line, in the axes of a camera, without times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cpl.logs.errors import LogError, QuaternionError
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.info import stated
from cpl.logs.run import Run
from cpl.logs.sieve import QUATERNION
from cpl.logs.text import Layout, read_layout

__all__ = ["FORMAT"]

TOLERANCE = 1e-3  # [-] of a rotation's rows from length 1 and right angles
Array = NDArray[np.float64]


def _recognise(head: Head) -> Likeness:
    rows = [row.split() for row in head.rows[:100]]
    twelve = 0
    for row in rows:
        try:
            matrix = np.array([float(cell) for cell in row]).reshape(3, 4)
        except ValueError:
            continue
        with np.errstate(all="ignore"):
            off = np.abs(matrix[:, :3] @ matrix[:, :3].T - np.eye(3)).max()
        twelve += bool(off < 0.01)
    if rows and twelve > 0.9 * len(rows):
        return Likeness(0.95, "twelve numbers a line, of which nine are a rotation")
    if rows and twelve:
        return Likeness(0.45, f"only {twelve} of {len(rows)} lines are a rotation and a position")
    return Likeness(0.0, "its lines are not twelve numbers")


def _read(path: Path, options: Options) -> Run:
    axes = options.axes or "camera"
    notes = [f"a 3x4 matrix a line, axes {axes}; attitudes computed from the rotations"]
    if options.times is not None:
        notes.append(f"times from {options.times.name}")
    elif options.pose_rate_hz is not None:
        notes.append(f"times derived: {options.pose_rate_hz:g} Hz, because --pose-rate says so")
    notes.append("no twist and no confidence, because KITTI's poses have none")
    source = {"importer": "cpl.logs.formats.kitti", "axes": axes}
    info = stated({}, options.provenance, path, source, silent=options.silent)
    layout = Layout(
        importer="cpl.logs.formats.kitti",
        columns={f"m{at}": (at, 1.0) for at in range(12)},
        stamp=None,
        separator=None,
        width=12,
        derive=_posed,
        axes=None if options.axes else "camera",
    )
    return read_layout(path, options, layout, info, notes)


def _posed(read: dict[str, Array]) -> tuple[dict[str, Array], list[tuple[NDArray[np.bool],
                                            type[LogError], str]]]:  # fmt: skip
    """Return positions and attitudes of matrices, and which matrices hold no rotation."""
    matrix = np.stack([read[f"m{at}"] for at in range(12)], axis=1).reshape(-1, 3, 4)
    turn = matrix[:, :, :3]
    with np.errstate(all="ignore"):
        off = np.abs(turn @ turn.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        bad = ~((off < TOLERANCE) & (np.linalg.det(np.nan_to_num(turn)) > 0))
    turn = np.where(bad[:, None, None], np.eye(3), turn)
    columns: dict[str, Array] = dict(zip(("x_m", "y_m", "z_m"), matrix[:, :, 3].T, strict=True))
    columns |= dict(zip(QUATERNION, quaternion_of(turn).T, strict=True))
    return columns, [(bad, QuaternionError, "its first nine numbers are no rotation")]


def quaternion_of(turn: Array) -> Array:
    """Return unit quaternions x, y, z, w of rotation matrices, w not negative.

    Args:
        turn: Shape (T, 3, 3).

    >>> quaternion_of(np.array([[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]])).round(3).tolist()
    [[0.0, 0.0, 0.707, 0.707]]
    """
    # The eigenvector of this symmetric matrix is exact wherever the rotation is, whatever its axis.
    m = turn
    k = np.empty((len(m), 4, 4))
    for i in range(3):
        for j in range(3):
            k[:, i, j] = m[:, i, j] + m[:, j, i]
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    for i in range(3):
        k[:, i, i] -= trace
    k[:, 3, 3] = trace
    for i, (a, b) in enumerate(((2, 1), (0, 2), (1, 0))):
        k[:, i, 3] = k[:, 3, i] = m[:, a, b] - m[:, b, a]
    vectors = np.linalg.eigh(k)[1][:, :, -1]
    return vectors * np.where(vectors[:, 3:] < 0, -1.0, 1.0)


FORMAT = Format(
    name="kitti",
    title="KITTI poses: the 12 numbers of a 3x4 matrix a line",
    example="1.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0 0.0",
    lacks="no times: --times FILE, or --pose-rate 10. No twist, no confidence: absent",
    recognise=_recognise,
    read=_read,
    suffixes=(".txt",),
    options=("--times", "--pose-rate", "--axes"),
)
