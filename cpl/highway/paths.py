"""Which arithmetic runs: the fast path, or the portable one that asks libm for every function.

A third one, "own", never asks libm and gives the same bits on every machine, in a browser too; it
is chosen by name only. Against highway-env it decides alike and differs in last bits
(`tests/highway/test_own.py` counts them).

The first two give the same bits where the self-check below passes: a small batch is driven through
both and compared with the digest that highway-env's own arithmetic (glibc, numpy's plain kernels)
gives. Where it fails, or where the processor has no fused multiply-add, the portable path runs: it
follows the machine's own libm, as highway-env does there.
"""

from __future__ import annotations

import hashlib
import os
import platform
from functools import cache
from typing import NamedTuple

import llvmlite.binding as llvm
import numpy as np

from cpl.highway.config import Config
from cpl.highway.draws import seed_many
from cpl.highway.exact import FAST, LIBM, OWN
from cpl.highway.layout import allocate, feature_table, settings_of, workspace
from cpl.highway.simulate import reset_range, step_range

__all__ = ["ENVIRONMENT_VARIABLE", "PATHS", "PathReport", "active_path", "path_report"]

ENVIRONMENT_VARIABLE = "CPL_HIGHWAY_PATH"
"""Set it to the name of a path to force it, to "auto" (or nothing) for the self-check."""

PATHS = {"fast": FAST, "portable": LIBM, "own": OWN}
"""The arithmetic behind each name."""

_DIGEST = "16965d526d180dc6d406b67d57608d54b006faef103eee44b01c2a449f29314a"
_CONFIG = Config(
    vehicles_count=20, vehicles_density=1.5, target_speeds=(20.0, 30.0, 40.0), lanes_count=3
)
_ENVS, _STEPS = 6, 12


class PathReport(NamedTuple):
    """The path that runs, one of `PATHS`, and a sentence that says why."""

    path: str
    reason: str


def active_path() -> str:
    """Name the path that engines run on unless told otherwise.

    Returns:
        One of `PATHS`.

    Raises:
        ValueError: If the environment variable asks for something else.
    """
    return path_report().path


def path_report() -> PathReport:
    """Choose the path, by the environment variable or else by the self-check (run once).

    Returns:
        The path and the reason.

    Raises:
        ValueError: If the environment variable asks for a path that does not exist.
    """
    wish = os.environ.get(ENVIRONMENT_VARIABLE, "auto") or "auto"
    if wish in PATHS:
        return PathReport(wish, f"forced by {ENVIRONMENT_VARIABLE}")
    if wish != "auto":
        raise ValueError(
            f"{ENVIRONMENT_VARIABLE} must be auto, fast, portable or own, got {wish!r}"
        )
    return _self_check()


@cache
def _self_check() -> PathReport:
    if not _has_fused_multiply_add():
        return PathReport("portable", "this processor has no fused multiply-add")
    if _drive(LIBM) != _DIGEST:
        return PathReport("portable", "this machine's libm rounds differently from glibc's")
    if _drive(FAST) != _DIGEST:
        return PathReport("portable", "the fast path does not reproduce the stored digest here")
    return PathReport("fast", "both paths reproduce the stored digest")


def _has_fused_multiply_add() -> bool:
    if platform.machine().lower() in ("x86_64", "amd64"):
        return bool(llvm.get_host_cpu_features().get("fma", False))
    return platform.machine().lower() in ("aarch64", "arm64")


def _drive(path: int) -> str:
    """Digest of a small batch's positions, headings, speeds and lanes after each of some steps."""
    digest = hashlib.sha256()
    memory, space = allocate(_CONFIG, _ENVS), workspace(_CONFIG)
    everyone = np.ones(_ENVS, np.bool_)
    seed_many(memory.generator, np.arange(_ENVS, dtype=np.uint64), everyone, -1)
    rows, columns = _CONFIG.observation_vehicles_count, len(_CONFIG.features)
    obs = np.zeros((_ENVS, rows, columns), np.float32)
    common = (*settings_of(_CONFIG), np.array(_CONFIG.target_speeds), *feature_table(_CONFIG))
    reset_range(0, _ENVS, space.nearest, *common, everyone, obs, *memory)
    results = (obs, np.empty(_ENVS), np.empty((_ENVS, 5)), np.empty((2, _ENVS), np.bool_))
    cars = _CONFIG.vehicles_count + 1
    for step in range(_STEPS):
        actions = (np.arange(_ENVS) * 3 + step * (step + 1) // 2) % 5
        step_range(0, _ENVS, *space, *common, actions, *results, path, *memory)
        digest.update((memory.cars[:, :4, :cars] + 0.0).tobytes())  # minus zero counts as zero
        digest.update(memory.codes[:, :2, :cars].tobytes())
        digest.update(obs.tobytes())
    return digest.hexdigest()
