"""Where is the robot to go? Waypoints of the paper's three closed shapes and of its zig-zags.

A path is a polyline cut into legs of equal pieces; each waypoint carries the heading of the leg
that arrives at it, so the camera looks where the robot goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["SHAPES", "Path", "hexagon", "polyline", "rectangle", "shape", "triangle", "zigzag"]

SPACING_M = 0.25  # [m] between waypoints; the paper states none (contradiction 3)
KEYPOINT_RANGE_M = 2.0  # [m] keypoints are uniform in [-2, 2] m (Section V-B)


@dataclass(frozen=True, kw_only=True)
class Path:
    """A named sequence of waypoints.

    Args:
        name: What tables call it.
        waypoints: x [m], y [m] and heading [rad] in the world frame, shape (N, 3), N >= 2.
    """

    name: str
    waypoints: NDArray[np.float64]

    def __post_init__(self) -> None:
        points = np.array(self.waypoints, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise ValueError(f"waypoints must have shape (N, 3) with N >= 2, not {points.shape}")
        if not np.isfinite(points).all():
            raise ValueError(f"waypoints must be finite, not {points.tolist()}")
        points.flags.writeable = False
        object.__setattr__(self, "waypoints", points)

    def __len__(self) -> int:
        return len(self.waypoints)

    @property
    def length_m(self) -> float:
        """The distance along the path [m]."""
        return float(np.linalg.norm(np.diff(self.waypoints[:, :2], axis=0), axis=1).sum())

    @property
    def start(self) -> tuple[float, float, float]:
        """The pose at which a run begins: x [m], y [m], heading [rad]."""
        x, y, heading = self.waypoints[0].tolist()
        return x, y, heading


def polyline(
    vertices: Sequence[tuple[float, float]] | NDArray[np.float64],
    *,
    spacing_m: float = SPACING_M,
    name: str = "polyline",
) -> Path:
    """Cut the legs between vertices into pieces of at most `spacing_m`.

    Args:
        vertices: Corners in the world frame [m], at least two, no two in a row equal.
        spacing_m: The longest distance between two waypoints [m], above 0.
        name: The path's name.

    Returns:
        The path from the first vertex to the last.

    Raises:
        ValueError: Too few vertices, a leg without length, a spacing that is not positive.

    >>> polyline([(0, 0), (1, 0), (1, 1)], spacing_m=0.5).waypoints.round(2).tolist()[1:4]
    [[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.5, 1.57]]
    """
    corners = np.asarray(vertices, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1:] != (2,) or len(corners) < 2:
        raise ValueError(f"vertices must have shape (N, 2) with N >= 2, not {corners.shape}")
    if not spacing_m > 0:
        raise ValueError(f"spacing_m must be above 0, not {spacing_m}")
    legs = [_leg(a, b, spacing_m) for a, b in pairwise(corners)]
    first = np.array([[*corners[0], legs[0][0, 2]]])
    return Path(name=name, waypoints=np.concatenate([first, *legs]))


def triangle(side_m: float = 2.4, *, spacing_m: float = SPACING_M) -> Path:
    """Return a closed equilateral triangle about the origin: the paper's easy path.

    Args:
        side_m: Length of a side [m].
        spacing_m: The longest distance between two waypoints [m].

    >>> round(triangle(3.0).length_m, 6)
    9.0
    """
    return _polygon(3, side_m, spacing_m, "triangle")


def rectangle(length_m: float = 2.4, width_m: float = 1.6, *, spacing_m: float = SPACING_M) -> Path:
    """Return a closed rectangle about the origin: the paper's path of medium difficulty.

    Args:
        length_m: Extent along x [m].
        width_m: Extent along y [m].
        spacing_m: The longest distance between two waypoints [m].

    >>> rectangle(2.0, 1.0).length_m
    6.0
    """
    x, y = _positive("length_m", length_m) / 2, _positive("width_m", width_m) / 2
    corners = [(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)]
    return polyline(corners, spacing_m=spacing_m, name="rectangle")


def hexagon(side_m: float = 1.3, *, spacing_m: float = SPACING_M) -> Path:
    """Return a closed regular hexagon about the origin: the paper's hard path.

    Args:
        side_m: Length of a side [m].
        spacing_m: The longest distance between two waypoints [m].

    >>> round(hexagon(1.0).length_m, 6)
    6.0
    """
    return _polygon(6, side_m, spacing_m, "hexagon")


SHAPES = {"triangle": triangle, "rectangle": rectangle, "hexagon": hexagon}


def shape(name: str) -> Path:
    """Return one of the paper's three closed paths in its default size.

    Args:
        name: `triangle` (easy), `rectangle` (medium) or `hexagon` (hard).

    Raises:
        ValueError: No such shape.
    """
    if name not in SHAPES:
        raise ValueError(f"name must be one of {sorted(SHAPES)}, not {name!r}")
    return SHAPES[name]()


def zigzag(
    rng: np.random.Generator,
    *,
    keypoints: int = 4,
    spacing_m: float = SPACING_M,
    min_leg_m: float = 0.5,
) -> Path:
    """Draw a training path: from the origin through keypoints uniform in [-2, 2] m.

    Paper: Section V-B, "linearly interpolating two keypoints ... to create a zig-zag". Two points
    make a line, not a zig-zag (contradiction 4). The ruling here: each pair of successive keypoints
    is interpolated linearly, and there are four of them unless told otherwise, which gives runs of
    about 13 s. `keypoints=1` is the literal line.

    Args:
        rng: Where the keypoints come from.
        keypoints: How many are drawn, at least 1.
        spacing_m: The longest distance between two waypoints [m].
        min_leg_m: A keypoint nearer than this to the one before is drawn again [m].

    Returns:
        A path that begins at the origin and has `keypoints` legs.

    Raises:
        ValueError: No keypoint, or a leg length that the square cannot hold.
    """
    if keypoints < 1:
        raise ValueError(f"keypoints must be at least 1, not {keypoints}")
    if not 0 < min_leg_m <= KEYPOINT_RANGE_M:
        raise ValueError(f"min_leg_m must be in (0, {KEYPOINT_RANGE_M}], not {min_leg_m}")
    vertices = [np.zeros(2)]
    while len(vertices) <= keypoints:
        candidate = rng.uniform(-KEYPOINT_RANGE_M, KEYPOINT_RANGE_M, size=2)
        if np.linalg.norm(candidate - vertices[-1]) >= min_leg_m:
            vertices.append(candidate)
    return polyline(np.array(vertices), spacing_m=spacing_m, name="zigzag")


def _leg(a: NDArray[np.float64], b: NDArray[np.float64], spacing_m: float) -> NDArray[np.float64]:
    """Return the waypoints of one leg, without its first point."""
    delta = b - a
    length = float(np.hypot(*delta))
    if not length > 0:
        raise ValueError(f"vertices must differ from one to the next, not {a.tolist()} twice")
    share = np.arange(1, (pieces := int(np.ceil(length / spacing_m - 1e-9))) + 1) / pieces
    heading = np.full(pieces, np.arctan2(delta[1], delta[0]))
    return np.column_stack([(1 - share[:, None]) * a + share[:, None] * b, heading])


def _polygon(corners: int, side_m: float, spacing_m: float, name: str) -> Path:
    """Return a closed regular polygon whose first leg runs along +x below the origin."""
    radius = _positive("side_m", side_m) / (2 * np.sin(np.pi / corners))
    angle = -np.pi / 2 - np.pi / corners + 2 * np.pi * np.arange(corners + 1) / corners
    vertices = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices[-1] = vertices[0]
    return polyline(vertices, spacing_m=spacing_m, name=name)


def _positive(name: str, value: float) -> float:
    if not value > 0:
        raise ValueError(f"{name} must be above 0, not {value}")
    return value
