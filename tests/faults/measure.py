"""How much memory and time one call took, in this process: the kernel's own high-water mark."""

import ctypes
import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Measured", "measured"]

_STATUS, _CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


@dataclass
class Measured:
    """What a call took.

    Attributes:
        mb: Memory beyond what the process had before [MB]; NaN where no kernel says.
        s: Time [s].
    """

    mb: float = float("nan")
    s: float = float("nan")


@contextmanager
def measured() -> Iterator[Measured]:
    """Measure what happens inside."""
    told = Measured()
    gc.collect()
    with suppress(OSError, AttributeError):  # what was freed is given back, so that it counts again
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    with suppress(OSError):
        _CLEAR.write_text("5")  # the high-water mark begins again
    before, begun = _kb("VmRSS"), time.process_time()
    try:
        yield told
    finally:
        told.s = time.process_time() - begun
        told.mb = max(0.0, _kb("VmHWM") - before) / 1000


def _kb(name: str) -> float:
    with suppress(OSError):
        for line in _STATUS.read_text().splitlines():
            if line.startswith(f"{name}:"):
                return float(line.split()[1])
    return float("nan")
