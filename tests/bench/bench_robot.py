"""Does the live loop keep 10 Hz, and the watchdog 500 Hz? In real time, against the emulator.

The histograms go to standard error, the percentiles into the table.
"""

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from cpl.robot import collection, histogram, perform, urgent
from cpl.robot.live import Emulated, emulated
from cpl.robot.rehearsal import EDGES_MS
from tests.bench.frame import Row

PACKAGES = ("unitree-legged-sdk", "opencv-python-headless")

SECONDS = 15.0


def measure() -> Iterator[Row]:
    """Walk once through the vendor's library and once through our own datagrams."""
    plan = replace(collection(1)[0], max_s=SECONDS)
    for library in ("auto", "wire"):
        stage = Emulated(start=plan.course.start, seed=plan.seed, library=library)
        with tempfile.TemporaryDirectory() as folder:
            there = Path(folder)
            with emulated(stage, there) as session, urgent():
                walked = perform(session.robot, plan, there)
            stream, subject = session.base.stats(), session.base.library
        told = walked.timing.told()
        for name, limit in (("period_error", 5.0), ("policy", 20.0), ("loop", 100.0)):
            yield Row(
                bench=f"robot: {name.replace('_', ' ')}, 99th percentile of {walked.rows} steps",
                subject=subject,
                value=told[f"{name}_p99_ms"],
                unit="ms",
                limit=limit,
            )
        yield Row(
            bench=f"robot: error of the 2 ms stream, 99th percentile of {stream['datagrams']}",
            subject=subject,
            value=stream["period_error_p99_ms"],
            unit="ms",
        )
        for name, seconds in (("period error", walked.timing.error_s),
                              ("policy time", walked.timing.policy_s)):  # fmt: skip
            sys.stderr.write(f"{subject}: {name}\n{histogram(seconds, EDGES_MS)}\n")
