"""Which optional libraries can be used here: present, absent, or installed but broken.

Vendors' wheels in particular install where they cannot be loaded: pyrealsense2 wants the system's
libusb, which a minimal Debian lacks. To everything here such a library is as good as absent, and
the reason is told.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from functools import lru_cache

from cpl.environ import in_checkout

__all__ = ["EXTRAS", "Library", "explain", "install", "look", "look_all"]

EXTRAS = {
    "cv2": ("opencv-python-headless", "quadruped"),
    "distributed": ("distributed", "cluster"),
    "h5py": ("h5py", "logs"),
    "ipykernel": ("ipykernel", "book"),
    "jupyter_book": ("jupyter-book", "book"),
    "jupytext": ("jupytext", "book"),
    "mcap": ("mcap", "logs"),
    "mujoco": ("mujoco", "legged"),
    "nbclient": ("nbclient", "book"),
    "nbformat": ("nbformat", "book"),
    "onnxruntime": ("onnxruntime", "legged"),
    "otter": ("otter-grader", "course"),
    "papermill": ("papermill", "book"),
    "playwright": ("playwright", "browser"),
    "pypdf": ("pypdf", "browser"),
    "pyrealsense2": ("pyrealsense2", "t265"),
    "rosbags": ("rosbags", "tools"),
    "sphinx": ("sphinx", "book"),
    "stable_baselines3": ("stable-baselines3", "learn"),
    "torch": ("torch", "learn"),
    "unitree_legged_sdk": ("unitree-legged-sdk", "go1"),
}
"""By the name that is imported: the distribution, and the extra of cpl that brings it."""
PATIENCE_S = 60.0  # [s] for one import; torch takes a few on a busy machine

# Imported by an interpreter of its own: a library may also crash, hang or print on the way.
_PROBE = """
import importlib.util, sys
from importlib.metadata import PackageNotFoundError, version
name, package = sys.argv[1:]
if importlib.util.find_spec(name) is None:
    sys.exit(3)
try:
    __import__(name)
except Exception as error:
    sys.stderr.write(f"{error}")
    sys.exit(4)
try:
    sys.stderr.write(version(package))
except PackageNotFoundError:
    sys.stderr.write("unknown")
"""


@dataclass(frozen=True)
class Library:
    """What is known of one optional library.

    Attributes:
        name: As it is imported.
        state: `present`, `absent` or `broken`.
        version: If it is present.
        reason: If it is broken: what its import said.
    """

    name: str
    state: str
    version: str = ""
    reason: str = ""

    def __bool__(self) -> bool:
        """Whether it can be used."""
        return self.state == "present"

    def __str__(self) -> str:
        package, extra = EXTRAS[self.name]
        if self.state == "present":
            return f"{package} {self.version}"
        if self.state == "absent":
            return f"{package} is not installed: {install(extra)}"
        return f"{package} is installed but cannot be loaded: {self.reason}"


def install(extra: str) -> str:
    """Return the command that installs an extra: in a checkout, or beside an installed cpl.

    >>> install("logs").endswith("[logs]'")
    True
    """
    return f"pip install -e '.[{extra}]'" if in_checkout() else f"pip install 'cpl[{extra}]'"


@lru_cache
def look(name: str, python: str = sys.executable) -> Library:
    """Find out whether a library can be used, by importing it in a process of its own.

    Args:
        name: One of `EXTRAS`.
        python: The interpreter that is to import it; the present one unless given.

    Returns:
        What was found; true where it can be used. An answer is kept for the life of the process.

    Raises:
        ValueError: The library is not a known optional one.
        FileNotFoundError: There is no such interpreter.
    """
    if name not in EXTRAS:
        raise ValueError(f"name must be one of {', '.join(EXTRAS)}, not {name!r}")
    words = [python, "-c", _PROBE, name, EXTRAS[name][0]]
    try:
        done = subprocess.run(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
            check=False,
            timeout=PATIENCE_S,
        )
    except subprocess.TimeoutExpired:
        return Library(name, "broken", reason=f"its import takes more than {PATIENCE_S:.0f} s")
    said = " ".join(done.stderr.split())
    if done.returncode == 0:
        return Library(name, "present", version=said.rsplit(" ", 1)[-1])
    if done.returncode == 3:
        return Library(name, "absent")
    return Library(name, "broken", reason=said or f"its import ends with {done.returncode}")


def look_all() -> list[Library]:
    """Find out about every optional library, in the order of their names."""
    return [look(name) for name in EXTRAS]


def explain(error: ImportError) -> str | None:
    """Say which extra a failed import asks for.

    Args:
        error: What the import raised.

    Returns:
        What lacks and how to install it; None if the library is none of the optional ones.

    >>> explain(ModuleNotFoundError("No module named 'mcap'", name="mcap.records"))
    "mcap is not installed: pip install -e '.[logs]'"
    >>> explain(ImportError("no such thing", name="json"))
    """
    name = (error.name or "").partition(".")[0]
    if name not in EXTRAS:
        return None
    absent = isinstance(error, ModuleNotFoundError)
    return str(Library(name, "absent" if absent else "broken", reason=str(error)))
