"""What is there to be seen? A hall with painted walls, drawn from a seed.

A box: walls at x = +-half_x, y = +-half_y, floor at z = 0, ceiling at z = height. Each face carries
a grey texture made of smooth noise at several scales and of rectangles (posters, doors, tiles).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.settings.ranges import Positive, Settings, Share

__all__ = ["TEXELS_PER_M", "Room", "textures"]

TEXELS_PER_M = 32.0  # [1/m] so one texel is about one pixel at 2.3 m
SIZE = 512  # [texels] side of a face's texture, repeated beyond 16 m
FACES = 6  # -x, +x, -y, +y, floor, ceiling


@dataclass(frozen=True, kw_only=True)
class Room(Settings):
    """The hall.

    Args:
        half_x_m: Half the extent along x [m].
        half_y_m: Half the extent along y [m].
        height_m: Height of the ceiling [m].
        floor_half_width_m: |x| and |y| of the marked floor that runs are meant to stay on [m].
        richness: Contrast and number of patterns, 0 (bare) to 1 (rich) [-].
        bare: The share of faces' richness that the +x wall and the floor lose [-].
        light: Light level, 1 = bright [-].
    """

    half_x_m: Positive = 4.5
    half_y_m: Positive = 4.5
    height_m: Positive = 3.0
    floor_half_width_m: Positive = 3.0
    richness: Share = 1.0
    bare: Share = 0.5
    light: Positive = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        walls = min(self.half_x_m, self.half_y_m)
        if not self.floor_half_width_m < walls:
            raise ValueError(
                f"floor_half_width_m must be below the walls' distance {walls}, got"
                f" {self.floor_half_width_m}"
            )

    @property
    def box(self) -> NDArray[np.float64]:
        """half_x, half_y, height [m], as the kernels take them, shape (3,)."""
        return np.array([self.half_x_m, self.half_y_m, self.height_m])


def textures(room: Room, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint the six faces.

    Args:
        room: How rich.
        rng: Where the patterns come from.

    Returns:
        Reflectance 0 .. 255, shape (6, 512, 512).

    >>> textures(Room(), np.random.default_rng(0)).shape
    (6, 512, 512)
    """
    plain = (1, 4)  # the +x wall and the floor
    richness = [room.richness * (1 - room.bare * (face in plain)) for face in range(FACES)]
    return np.stack([_face(rng, value) for value in richness])


def _face(rng: np.random.Generator, richness: float) -> NDArray[np.uint8]:
    """Return one texture: mean grey, smooth noise at four scales, rectangles."""
    grey = np.full((SIZE, SIZE), 120.0)
    for cells, amplitude in ((8, 8.0), (32, 8.0), (96, 16.0), (220, 18.0)):
        grey += richness * amplitude * _smooth_noise(rng, cells)
    for _ in range(round(300 * richness)):
        x, y = rng.integers(0, SIZE, size=2)
        w, h = rng.integers(2, 16, size=2)
        grey[y : y + h, x : x + w] += rng.normal(0.0, 38.0 * richness)
    return np.clip(grey, 5, 250).astype(np.uint8)


def _smooth_noise(rng: np.random.Generator, cells: int) -> NDArray[np.float64]:
    """Return unit-variance value noise with `cells` cells a side, interpolated linearly."""
    lattice = rng.standard_normal((cells, cells))
    at = np.arange(SIZE) * cells / SIZE
    low = at.astype(int)
    high, share = (low + 1) % cells, at - low
    rows = lattice[low] * (1 - share)[:, None] + lattice[high] * share[:, None]
    return rows[:, low] * (1 - share) + rows[:, high] * share
