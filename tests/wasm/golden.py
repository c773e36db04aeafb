"""The golden fixtures as a job for the module: highway-env's resets, states and actions."""

import json
from dataclasses import fields

import numpy as np

from cpl.highway import State
from cpl.highway.options import make_config
from tests.wasm.job import Job, Roads

STAGES = ("small", "long", "fast", "medium", "paper", "large", "options")
INJECTED = ("injected", "crowded")


def load(folder, stage):
    with np.load(folder / f"{stage}.npz", allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    return arrays, json.loads((folder / f"{stage}.json").read_text())


def episodes(folder, stage, no_action=255):
    """A job that plays all episodes of a stage."""
    arrays, manifest = load(folder, stage)
    job, first = Job(), 0
    for number, group in enumerate(manifest["groups"]):
        sessions, steps = len(group["seeds"]), sum(group["lengths"])
        rows = sessions * (steps + len(group["lengths"]))
        taken = arrays["action"][first : first + rows].reshape(sessions, -1)
        actions = taken[taken != no_action].reshape(sessions, steps)
        collisions = "ego" if group["fast"] else "all"
        config = make_config(**group["options"], collisions=collisions)[0]
        roads, start = Roads(job, config, sessions), 0
        for episode, length in enumerate(group["lengths"]):
            label = f"{stage} {number}.{episode}"
            roads.reset(group["seeds"] if episode == 0 else None, f"{label} reset")
            for t in range(start, start + length):
                roads.step(actions[:, t], f"{label} step {t}")
            start += length
        first += rows
    return job


def injected(folder, stage):
    """A job that continues all injected states of a stage."""
    arrays, manifest = load(folder, stage)
    job, first, cars_before, cases_before = Job(), 0, 0, 0
    for number, group in enumerate(manifest["groups"]):
        cases, steps = group["cases"], group["steps"]
        cars = group["options"]["vehicles_count"] + 1
        config = make_config(**group["options"], collisions="all")[0]
        roads = Roads(job, config, cases)
        roads.reset(np.zeros(cases, np.int64), f"{stage} {number} reset")
        present = roads.engine.state()
        parts = {field.name: getattr(present, field.name) for field in fields(State)}
        for name in (name for name in arrays if name.startswith("state_")):
            once = len(arrays[name]) != len(arrays["state_x"])
            start, shape = (cases_before, (cases,)) if once else (cars_before, (cases, cars))
            values = arrays[name][start : start + int(np.prod(shape))].reshape(shape)
            field = name.removeprefix("state_")
            parts[field] = values.astype(parts[field].dtype)
        roads.inject(State(**parts))
        actions = arrays["action"][first : first + cases * steps].reshape(cases, steps)
        for t in range(steps):
            roads.step(actions[:, t], f"{stage} {number} step {t}")
        first += cases * steps
        cars_before += cases * cars
        cases_before += cases
    return job


def job_of(folder, stage):
    """The job of any stage."""
    return injected(folder, stage) if stage in INJECTED else episodes(folder, stage)
