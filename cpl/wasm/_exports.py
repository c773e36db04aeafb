"""The functions that the module offers: thin views of a block's arrays around the kernels.

Importing this module compiles nothing; `cpl.wasm.lower` does. Numbers of a block's words are in
`BLOCK`, for those who fill it.
"""

from typing import Any

import numpy as np
from numba import njit, types

from cpl.conformal._kernels import follow
from cpl.highway.distances import proximities_range
from cpl.highway.draws import seed_many
from cpl.highway.engine import NOISE_KEY as _NOISE_KEY
from cpl.highway.exact import OWN
from cpl.highway.simulate import refresh_range, reset_range, step_range
from cpl.wasm import gate, ride
from cpl.wasm._memory import bools, floats, longs, singles, unsigned, words

__all__ = ["BLOCK", "EXPORTS", "NETWORKS", "RIDE"]

BLOCK = (
    "envs", "stride", "levels_count", "columns", "rows", "lanes",
    "counts", "numbers", "levels", "features", "ranges",
    "cars", "codes", "time", "steps", "speed_index", "generator", "noise_generator", "ready",
    "reals", "integers", "last", "pairs", "nearest", "corners",
    "actions", "obs", "reward", "terms", "ended", "chosen", "seeds",
)  # fmt: skip
"""What the words of a road's block mean: six counts, then addresses."""
_WORDS = len(BLOCK)
_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy", "forceinline": True}
_INNER: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}


@njit(**_INNER)
def road_seed(block: int, key: int) -> None:
    """Seed the generators of the chosen roads: key -1 the roads' own, else the noise's."""
    b = words(block, (_WORDS,))
    n = np.int64(b[0])
    chosen, seeds = bools(b[30], (n,)), unsigned(b[31], (n,))
    if key < 0:
        seed_many(unsigned(b[16], (n, 6)), seeds, chosen, np.int64(-1))
    else:
        seed_many(unsigned(b[17], (n, 6)), seeds, chosen, np.int64(key))


@njit(**_INNER)
def road_reset(block: int) -> None:
    """Begin episodes on the chosen roads and observe them."""
    b = words(block, (_WORDS,))
    n, stride, levels = np.int64(b[0]), np.int64(b[1]), np.int64(b[2])
    columns, rows = np.int64(b[3]), np.int64(b[4])
    reset_range(
        0, n, longs(b[23], (rows,)),
        longs(b[6], (15,)), floats(b[7], (28,)), floats(b[8], (levels,)),
        longs(b[9], (columns,)), floats(b[10], (columns, 3)),
        bools(b[30], (n,)), singles(b[26], (n, rows, columns)),
        floats(b[11], (n, 12, stride)), longs(b[12], (n, 5, stride)), floats(b[13], (n,)),
        longs(b[14], (n,)), longs(b[15], (n,)), unsigned(b[16], (n, 6)), unsigned(b[17], (n, 6)),
        bools(b[18], (n,)),
    )  # fmt: skip


@njit(**_INNER)
def road_step(block: int) -> None:
    """Take a decision on every road."""
    b = words(block, (_WORDS,))
    n, stride, levels = np.int64(b[0]), np.int64(b[1]), np.int64(b[2])
    columns, rows, lanes = np.int64(b[3]), np.int64(b[4]), np.int64(b[5])
    step_range(
        0, n, floats(b[19], (16, stride)), longs(b[20], (7, stride)), longs(b[21], (lanes,)),
        longs(b[22], (4 * stride,)), longs(b[23], (rows,)), floats(b[24], (2, 8)),
        longs(b[6], (15,)), floats(b[7], (28,)), floats(b[8], (levels,)),
        longs(b[9], (columns,)), floats(b[10], (columns, 3)),
        longs(b[25], (n,)), singles(b[26], (n, rows, columns)), floats(b[27], (n,)),
        floats(b[28], (n, 5)), bools(b[29], (2, n)), OWN,
        floats(b[11], (n, 12, stride)), longs(b[12], (n, 5, stride)), floats(b[13], (n,)),
        longs(b[14], (n,)), longs(b[15], (n,)), unsigned(b[16], (n, 6)), unsigned(b[17], (n, 6)),
        bools(b[18], (n,)),
    )  # fmt: skip


def road_refresh(block: int) -> None:
    """Rebuild what follows from a state that was written into the block's arrays."""
    b = words(block, (_WORDS,))
    n, stride = np.int64(b[0]), np.int64(b[1])
    refresh_range(
        0, n, OWN, longs(b[6], (15,)), floats(b[7], (28,)),
        floats(b[11], (n, 12, stride)), longs(b[12], (n, 5, stride)), floats(b[13], (n,)),
        longs(b[14], (n,)), longs(b[15], (n,)), unsigned(b[16], (n, 6)), unsigned(b[17], (n, 6)),
        bools(b[18], (n,)),
    )  # fmt: skip


NETWORKS = ("forecaster", "safe", "speed")
RIDE = (
    "road", "counts", "numbers", "rings", "history", "work", "width", "near",
    *(f"{name}_{part}" for name in NETWORKS for part in ("layers", "sizes", "numbers", "count",
    "output")),
    "gate",
)  # fmt: skip
"""What the words of a ride's block mean: its road's block, its arrays, and three networks."""
_RIDE_WORDS = len(RIDE)
_GATE_WORDS = len(gate.GATE)
_COUNTS, _NUMBERS = len(ride.COUNTS), len(ride.NUMBERS)


@njit(**_OPTIONS)
def _network(r: np.ndarray, first: int) -> tuple:
    sizes = longs(r[first + 1], (np.int64(r[first]),))
    return sizes, singles(r[first + 2], (np.int64(r[first + 3]),)), np.int64(r[first + 4])


@njit(**_OPTIONS)
def _gate(r: np.ndarray) -> tuple:
    """A gate's arrays, `gate.GATE`, by their addresses."""
    a = words(r[23], (_GATE_WORDS,))
    return (
        floats(a[0], (5,)), floats(a[1], (15,)), floats(a[2], (2, 2, 2)), floats(a[3], (2,)),
        floats(a[4], (1, 5)), floats(a[5], (1, 2)), longs(a[6], (1,)),
        floats(a[7], (1, 3, 8, 3, 2)), longs(a[8], (1, 3, 8)), floats(a[9], (1, 8, 2)),
        longs(a[10], (1, 8)), longs(a[11], (1,)), floats(a[12], (1, 3, 3)),
        floats(a[13], (1, 8, 5)), floats(a[14], (8, 15, 2)), floats(a[15], (1, 5)),
        floats(a[16], (1, 5)),
        floats(a[17], (1, 5, 2)), floats(a[18], (1, 8, 3, 2)), longs(a[19], (1, 8)),
        floats(a[20], (1, 3)), bools(a[21], (1, 3)), floats(a[22], (1,)), bools(a[23], (8,)),
        longs(a[24], (8,)),
    )  # fmt: skip


@njit(**_OPTIONS)
def _near(b: np.ndarray, r: np.ndarray) -> float:
    near = floats(r[7], (np.int64(1),))
    cars = floats(b[11], (np.int64(1), 12, np.int64(b[1])))
    proximities_range(cars, longs(b[6], (15,))[0], near)
    return near[0]


def ride_begin(block: int, forget: int) -> None:
    """Begin an episode with the seed in the road's block; the tracker is kept unless forgotten."""
    r = words(block, (_RIDE_WORDS,))
    b = words(r[0], (_WORDS,))
    road_seed(r[0], -1)
    road_seed(r[0], _NOISE_KEY)
    road_reset(r[0])
    size = np.int64(b[3]) * np.int64(b[4])
    i = longs(r[1], (_COUNTS,))
    x = floats(b[11], (12 * np.int64(b[1]),))
    history = singles(r[4], (i[2] * size,))
    ride.begin(i, floats(r[2], (_NUMBERS,)), history, _near(b, r), x[0], forget != 0)
    gate.begin(_gate(r), forget != 0)


@njit(**_INNER)
def ride_decide(block: int) -> None:
    """Forecast and choose; the action stands in the counts."""
    r = words(block, (_RIDE_WORDS,))
    b = words(r[0], (_WORDS,))
    size = np.int64(b[3]) * np.int64(b[4])
    i = longs(r[1], (_COUNTS,))
    ride.decide(
        i, floats(r[2], (_NUMBERS,)), floats(r[3], (3, i[4] + 1)),
        singles(r[4], (i[2] * size,)), singles(b[26], (size,)),
        _network(r, 8), _network(r, 13), _network(r, 18), singles(r[5], (2, np.int64(r[6]))),
        _gate(r), floats(b[8], (1, np.int64(b[2]))),
    )  # fmt: skip


@njit(**_INNER)
def ride_act(block: int) -> None:
    """Take the action that stands in the counts, and learn from what follows."""
    r = words(block, (_RIDE_WORDS,))
    b = words(r[0], (_WORDS,))
    i = longs(r[1], (_COUNTS,))
    longs(b[25], (1,))[0] = i[16]
    road_step(r[0])
    ended, terms = bools(b[29], (2,)), floats(b[28], (5,))
    ride.learn(
        i, floats(r[2], (_NUMBERS,)), floats(r[3], (3, i[4] + 1)),
        floats(b[11], (12 * np.int64(b[1]),)), longs(b[6], (15,))[0], _near(b, r),
        terms[4], terms[0] > 0.0, ended[1],
    )  # fmt: skip


def ride_run(block: int) -> None:
    """Drive to the end of an episode that was begun."""
    r = words(block, (_RIDE_WORDS,))
    i = longs(r[1], (_COUNTS,))
    while i[13] == 0:
        ride_decide(block)
        ride_act(block)


def track(block: int, setting: int) -> None:
    """Follow a stream.

    The block has scores and their count, steps and their count, the ends of episodes and their
    count, q and the delay; the setting alpha and q0, and takes the state after the last event.
    """
    b = words(block, (8,))
    n, steps, ends = np.int64(b[1]), np.int64(b[3]), np.int64(b[5])
    s = floats(setting, (3,))
    stride = np.int64(1 if steps > 1 else 0)
    s[2] = follow(
        floats(b[0], (n,)),
        floats(b[2], (steps,)),
        stride,  # pyright: ignore[reportArgumentType]
        longs(b[4], (ends,)),
        np.int64(b[7]),  # pyright: ignore[reportArgumentType]
        s[0],
        s[1],
        floats(b[6], (n,)),
    )


EXPORTS = {
    "road_seed": (road_seed, types.void(types.int32, types.int32)),
    "road_reset": (road_reset, types.void(types.int32)),
    "road_step": (road_step, types.void(types.int32)),
    "road_refresh": (road_refresh, types.void(types.int32)),
    "track": (track, types.void(types.int32, types.int32)),
    "ride_begin": (ride_begin, types.void(types.int32, types.int32)),
    "ride_decide": (ride_decide, types.void(types.int32)),
    "ride_act": (ride_act, types.void(types.int32)),
    "ride_run": (ride_run, types.void(types.int32)),
}
"""Functions by name, with their signatures."""
