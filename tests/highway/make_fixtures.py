"""Make the golden fixtures: what highway-env does, step by step, in libm's arithmetic.

    python tests/highway/make_fixtures.py [--jobs 2] [--out DIR] [--stages small long ...]

numpy's AVX-512 kernels differ from libm in the last bit of arcsin, arctan, tan, exp and power, so
they are switched off (the script starts itself again with NPY_DISABLE_CPU_FEATURES set) and the
fixtures hold on any processor whose libm rounds as this one's. A stage is a pair of files, NAME.npz
(no pickles) and NAME.json (its plan, the versions and the flags), both written in one piece; a
stage that exists is left alone unless it is named.
"""

from __future__ import annotations

import argparse
import importlib.util
import io
import json
import os
import platform
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

HERE = Path(__file__).resolve().parent
FIXTURES = HERE / "fixtures"


def main() -> None:
    oracle = load_oracle()
    if os.environ.get("NPY_DISABLE_CPU_FEATURES") != oracle.LIBM_FLAGS:
        environ = os.environ | {"NPY_DISABLE_CPU_FEATURES": oracle.LIBM_FLAGS}
        os.execve(sys.executable, [sys.executable, *sys.argv], environ)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=FIXTURES)
    parser.add_argument("--stages", nargs="*", choices=[*oracle.INJECTED, *oracle.STAGES])
    arguments = parser.parse_args()
    stages = arguments.stages or [
        name
        for name in (*oracle.INJECTED, *oracle.STAGES)
        if not (arguments.out / f"{name}.json").exists()
    ]
    arguments.out.mkdir(exist_ok=True)
    with ProcessPoolExecutor(arguments.jobs, mp_context=get_context("spawn")) as pool:
        for stage in stages:
            make = make_injected if stage in oracle.INJECTED else make_episodes
            arrays, plan = make(oracle, stage, pool)
            write_stage(arguments.out, stage, arrays, plan, oracle.LIBM_FLAGS)
            print(stage, len(arrays["action"]), "rows", flush=True)  # noqa: T201


def make_episodes(oracle, stage, pool):
    """All groups of a stage; a task is one group."""
    groups = oracle.plan_stage(stage)
    tables = list(pool.map(_episode_task, [stage] * len(groups), range(len(groups))))
    arrays = {name: _concatenate([table[name] for table in tables]) for name in tables[0]}
    return arrays, [asdict(group) for group in groups]


def make_injected(oracle, stage, pool):
    """All injected states of a stage with what highway-env makes of them; a task is one group."""
    numbers = oracle.INJECTED[stage]
    tables, states = [], []
    plan = []
    for number, (table, lanes) in zip(numbers, pool.map(_injected_task, numbers), strict=True):
        options, actions, state = oracle.plan_injected(number)
        tables.append(table)
        states.append({name: values.ravel() for name, values in (state | {"lane": lanes}).items()})
        plan.append({"options": options, "cases": len(actions), "steps": actions.shape[1]})
    arrays = {name: _concatenate([table[name] for table in tables]) for name in tables[0]}
    for name in states[0]:
        values = _concatenate([state[name] for state in states])
        arrays[f"state_{name}"] = _narrow(values)
    return arrays, plan


def write_stage(folder, stage, arrays, plan, flags) -> None:
    """Both files of a stage, each in one piece."""
    import numpy as np

    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    manifest = {
        "stage": stage,
        "versions": {name: version(name) for name in ("highway-env", "numpy", "gymnasium")}
        | {"python": platform.python_version(), "libc": " ".join(platform.libc_ver())},
        "NPY_DISABLE_CPU_FEATURES": flags,
        "machine": platform.machine(),
        "groups": plan,
    }
    text = json.dumps(manifest, separators=(",", ":")).replace('{"options"', '\n{"options"')
    replace_file(folder / f"{stage}.npz", buffer.getvalue())
    replace_file(folder / f"{stage}.json", (text + "\n").encode())


def replace_file(path: Path, content: bytes) -> None:
    """Write a file in one piece."""
    temporary = path.with_suffix(path.suffix + ".tmp")
    with temporary.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def load_oracle():
    """Import the oracle module, which lies beside this file and in no package."""
    spec = importlib.util.spec_from_file_location("highway_oracle", HERE / "oracle.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _episode_task(stage, number):
    oracle = load_oracle()
    return oracle.make_table(oracle.run_group(oracle.plan_stage(stage)[number]))


def _injected_task(number):
    oracle = load_oracle()
    options, actions, state = oracle.plan_injected(number)
    return (
        oracle.make_table(oracle.run_injected(options, actions, state)),
        oracle.closest_lanes(options, state),
    )


def _concatenate(parts):
    import numpy as np

    return np.concatenate(parts)


def _narrow(values):
    """Store states in the smallest type that keeps them exactly."""
    import numpy as np

    for kind in (np.bool_, np.int8, np.float32):
        narrow = values.astype(kind)
        if (narrow.astype(values.dtype) == values).all():
            return narrow
    return values


if __name__ == "__main__":
    main()
