"""A job for the module, as steps and bytes, and what the native engine says to each read."""

import json
from pathlib import Path

import numpy as np

from cpl.highway import Engine
from cpl.highway.engine import NOISE_KEY
from cpl.highway.layout import Codes, Fields
from cpl.network import packed
from cpl.wasm import MODULE, gate
from cpl.wasm._exports import BLOCK, NETWORKS
from cpl.wasm.ride import COUNTS, DRIVERS, NUMBERS
from tests.node import node

_BASE = 1 << 20  # above the module's stack and tables


def fingerprint(array):
    """What `executor.js` computes of an array's bytes."""
    value = np.ascontiguousarray(array).view(np.uint8).ravel().astype(np.uint32) + np.uint32(1)
    k = np.arange(1, value.size + 1, dtype=np.uint64)
    low = np.uint64(0xFFFFFFFF)
    first = (k * np.uint64(0x9E3779B1)) & low
    second = ((k * k) & low) ^ np.uint64(0x85EBCA6B)
    value = value.astype(np.uint64)
    return [int(((value * w) & low).sum() & low) for w in (first, second)]


class Job:
    """Steps for the executor; memory is handed out once and never given back."""

    def __init__(self):
        self.steps, self.blob, self.expected, self.labels = [], bytearray(), [], []
        self.top = _BASE

    def place(self, array):
        """Reserve room for an array and write it; returns its address."""
        at = -(-self.top // 16) * 16
        self.top = at + max(array.nbytes, 16)
        self.steps.append(["grow", self.top + 65536])
        self.write(at, array)
        return at

    def write(self, at, array):
        content = np.ascontiguousarray(array).tobytes()
        self.steps.append(["write", at, len(self.blob), len(content)])
        self.blob += content

    def call(self, name, *arguments):
        self.steps.append(["call", name, *arguments])

    def read(self, at, array, label, *, rows=1, pitch=0):
        """Ask for a fingerprint, and say what it must be."""
        self.steps.append(["read", at, rows, array.nbytes // rows, pitch])
        self.expected.append(fingerprint(array))
        self.labels.append(label)

    def save(self, folder):
        (folder / "job.json").write_text(json.dumps(self.steps))
        (folder / "blob.bin").write_bytes(self.blob)

    def run(self, folder):
        """Run it in node; returns what was found."""
        self.save(folder)
        script = Path(__file__).with_name("node.cjs")
        files = (MODULE, folder / "job.json", folder / "blob.bin")
        return json.loads(node(*(str(path) for path in (script, *files))))

    def differences(self, found):
        """Labels of the reads that are not what the native engine says."""
        pairs = zip(self.labels, found, self.expected, strict=True)
        return [label for label, got, wanted in pairs if got != wanted]


class Roads:
    """A native engine and its image in the module, driven side by side."""

    def __init__(self, job, config, n_envs):
        self.job, self.engine = job, Engine(config, n_envs, path="own")
        e, self.n = self.engine, config.vehicles_count + 1
        memory, space = e._memory, e._spaces[0]
        shape = (n_envs, config.observation_vehicles_count, len(config.features))
        self.arrays = {
            "counts": e._settings[0],
            "numbers": e._settings[1],
            "levels": e._levels,
            "features": e._columns[0],
            "ranges": e._columns[1],
            **memory._asdict(),
            **dict(zip(BLOCK[19:25], space, strict=True)),
            "actions": np.zeros(n_envs, np.int64),
            "obs": np.zeros(shape, np.float32),
            "reward": np.zeros(n_envs),
            "terms": np.zeros((n_envs, 5)),
            "ended": np.zeros((2, n_envs), np.bool_),
            "chosen": np.ones(n_envs, np.bool_),
            "seeds": np.zeros(n_envs, np.uint64),
        }
        self.at = {name: job.place(self.arrays[name]) for name in BLOCK[6:]}
        counts = [n_envs, memory.cars.shape[2], len(e._levels), shape[2], shape[1]]
        words = [*counts, config.lanes_count, *(self.at[name] for name in BLOCK[6:])]
        self.block = job.place(np.array(words, np.int32))

    def reset(self, seeds, label):
        if seeds is not None:
            self.job.write(self.at["seeds"], np.array(seeds, np.uint64))
            self.job.call("road_seed", self.block, -1)
            self.job.call("road_seed", self.block, NOISE_KEY)
        obs = self.engine.reset(None if seeds is None else np.array(seeds))
        self.job.call("road_reset", self.block)
        self._compare({"obs": obs}, label)

    def step(self, actions, label):
        self.job.write(self.at["actions"], np.array(actions, np.int64))
        self.job.call("road_step", self.block)
        out = self.engine.step(np.array(actions, np.int64))
        ended = np.stack([out.terminated, out.truncated])
        self._compare({"obs": out.obs, "reward": out.reward, "ended": ended}, label)

    def inject(self, state):
        self.engine.set_state(state)
        for name in BLOCK[11:19]:
            self.job.write(self.at[name], self.arrays[name])
        self.job.call("road_refresh", self.block)

    def _compare(self, outcome, label):
        memory = self.engine._memory
        for name, rows in (("cars", Fields.COUNT), ("codes", Codes.COUNT)):
            array = getattr(memory, name)
            pitch = array.shape[2] * 8
            self.job.read(
                self.at[name],
                array[:, :, : self.n],
                f"{label} {name}",
                rows=len(array) * rows,
                pitch=pitch,
            )
        for name in ("time", "steps", "speed_index", "generator"):
            self.job.read(self.at[name], getattr(memory, name), f"{label} {name}")
        for name, array in outcome.items():
            self.job.read(self.at[name], array, f"{label} {name}")


class Ride:
    """One road with its networks and its tracker in the module, driven episode by episode."""

    def __init__(self, job, config, networks, *, driver, q_safe, alpha, share, running, delay):
        self.job, self.road = job, Roads(job, config, 1)
        counts, numbers = np.zeros(len(COUNTS), np.int64), np.zeros(len(NUMBERS))
        counts[:5] = DRIVERS.index(driver), running, 5, 3, delay
        numbers[:3] = alpha, share, q_safe
        width = max(max(net.sizes) for net in networks.values())
        self.counts, self.numbers = job.place(counts), job.place(numbers)
        words = [self.road.block, self.counts, self.numbers, job.place(np.zeros((3, delay + 1)))]
        words += [job.place(np.zeros(125, np.float32)), job.place(np.zeros((2, width), np.float32))]
        words += [width, job.place(np.zeros(1))]
        for name in NETWORKS:
            sizes, values, output = packed(networks[name])
            words += [len(sizes), job.place(sizes), job.place(values), len(values), output]
        self.gate = {name: job.place(array) for name, array in gate.arrays().items()}
        words.append(job.place(np.array(list(self.gate.values()), np.int32)))
        self.block = job.place(np.array(words, np.int32))

    def drive(self, seed, forget=True):
        """Drive an episode; what it counted is the next two things that the job takes."""
        self.job.write(self.road.at["seeds"], np.array([seed], np.uint64))
        self.job.call("ride_begin", self.block, int(forget))
        self.job.call("ride_run", self.block)
        self.job.steps.append(["take", self.counts, 8 * len(COUNTS)])
        self.job.steps.append(["take", self.numbers, 8 * len(NUMBERS)])


def row(counts, numbers):
    """What a ride counted, under the names of `Rides.episodes`."""
    whole = dict(zip(COUNTS, np.array(counts, np.uint8).view(np.int64).tolist(), strict=True))
    real = dict(zip(NUMBERS, np.array(numbers, np.uint8).view(np.float64).tolist(), strict=True))
    return {**whole, **real, "crashed": bool(whole["crashed"])}
