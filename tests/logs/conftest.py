"""Runs to test with, and a forger: files whose checksums are right and whose content is not."""

import io
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.writer import IndexType, Writer

from cpl.logs import RunInfo
from cpl.logs.info import METADATA, packed
from cpl.logs.salvage import messages, survey
from cpl.logs.schema import CHANNELS
from cpl.logs.source import Source
from cpl.logs.writer import encoded_run


def make_rows(n, seed=0):
    """A robot that walks a wide circle at 0.5 m/s, with everything that a twin's log has."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(n):
        t_s, yaw = 0.1 * k, math.remainder(0.05 * k, 2 * math.pi)
        rows.append(
            {
                "t_s": t_s,
                "x_m": math.sin(0.05 * k),
                "y_m": 1 - math.cos(0.05 * k),
                "z_m": 0.3,
                "qx": 0.0,
                "qy": 0.0,
                "qz": math.sin(yaw / 2),
                "qw": math.cos(yaw / 2),
                "yaw_rad": yaw,
                "v_x_mps": 0.5,
                "v_y_mps": 0.0,
                "yaw_rate_radps": 0.5,
                "confidence": 3 - k % 2,
                "slam_error": int(k % 7 == 6),
                "cmd_v_x_mps": 0.5 + 0.01 * rng.normal(),
                "cmd_v_y_mps": 0.0,
                "cmd_yaw_rate_radps": 0.5,
                "kp": 1.5 * 1.1 ** (k % 3),
                "waypoint_index": k // 5,
                "l_hat": float(rng.uniform()),
                "q": float(rng.uniform()),
                "score": math.nan if k < 2 else float(rng.uniform()),
                "err": -1 if k < 2 else k % 2,
                "supervisor": "speed_clamp" if k % 5 == 4 else "",
                "true_x_m": math.sin(0.05 * k) + 0.01,
                "true_y_m": 1 - math.cos(0.05 * k),
                "true_yaw_rad": yaw,
                "outcome": "arrived" if k == n - 1 else "",
            }
        )
    return rows


def salvage(data):
    """All that is confirmed in the bytes of a run's file."""
    found = survey(Source.of(data))
    return SimpleNamespace(
        messages=list(messages(found, range(1 << 16))),
        channels=list(found.channels.values()),
        damages=found.damages,
    )


@pytest.fixture(scope="session")
def rows_of():
    return make_rows


@pytest.fixture(scope="session")
def info():
    config = {"kp": 1.5, "room": {"light": "dim"}}
    return RunInfo(provenance="simulated-kinematic", config=config, seed=17)


@pytest.fixture(scope="session")
def whole(info):
    """The bytes of a whole run of 100 rows, five chunks."""
    return encoded_run(make_rows(100), info)


class Forger:
    """A run's parts, to be spoiled; `save` writes them with checksums that are right."""

    def __init__(self, info, n=40, rows=None):
        found = salvage(encoded_run(rows or make_rows(n), info))
        names = {each.id: each.topic for each in found.channels}
        self.info = info
        self.messages = [
            SimpleNamespace(
                topic=names[m.channel_id], row=m.sequence, t=m.log_time, body=json.loads(m.data)
            )
            for _, m in found.messages
        ]
        topics = [each.topic for each in found.channels]
        self.channels = {
            each.topic: {"schema": each.schema, "frame": each.frame, "units": dict(each.units)}
            for each in CHANNELS
            if each.topic in topics
        }
        self.twice = []
        self.metadata = [packed(info, tuple(topics)), packed(info, tuple(topics), n)]

    def body(self, topic, row):
        return next(m.body for m in self.messages if (m.topic, m.row) == (topic, row))

    def of(self, row):
        return [m for m in self.messages if m.row == row]

    def save(self, path):
        buffer = io.BytesIO()
        log = Writer(
            buffer, index_types=IndexType.CHUNK | IndexType.METADATA, enable_data_crcs=True
        )
        log.start(library="cpl.logs" if self.metadata else "someone else")
        for each in self.metadata[:1]:
            log.add_metadata(METADATA, each)
        numbers = {}
        for topic, said in [*self.channels.items(), *((t, self.channels[t]) for t in self.twice)]:
            schema = log.register_schema(said["schema"], "jsonschema", b"{}")
            about = {"frame": said["frame"], "units": json.dumps(said["units"])}
            numbers[topic] = log.register_channel(topic, "json", schema, about)
        for m in self.messages:
            data = m.body if isinstance(m.body, bytes) else json.dumps(m.body).encode()
            log.add_message(numbers[m.topic], m.t, data, m.t, m.row)
            if m.topic == "/policy/gain" and m.row % 10 == 9:
                log.flush()
        log.flush()
        for each in self.metadata[1:]:
            log.add_metadata(METADATA, each)
        log.finish()
        path.write_bytes(buffer.getvalue())
        return path


@pytest.fixture
def forger(info):
    return Forger(info)


@pytest.fixture
def forge(info):
    """Make a forger for rows of one's own."""
    return lambda rows: Forger(info, n=len(rows), rows=rows)
