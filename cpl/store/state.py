"""The state of the source and of the machine, as a result's label needs them."""

import os
import platform
import subprocess
from datetime import UTC, datetime
from typing import Any

from cpl.store.paths import project_root

__all__ = ["machine", "source_commit", "today"]


def source_commit() -> str:
    """Return the commit that the code is at; ``+`` behind it says that files under cpl/ differ.

    Returns:
        40 hexadecimal digits, perhaps with ``+``; ``"unknown"`` outside a git checkout.
    """
    commit = _git("rev-parse", "HEAD")
    if commit is None:
        return "unknown"
    return commit + ("+" if _git("status", "--porcelain", "--", "cpl") else "")


def machine() -> dict[str, Any]:
    """Describe the machine as far as it can matter for numbers and timings; never its name.

    Examples:
        >>> sorted(machine())
        ['cores', 'processor', 'python', 'system']
    """
    return {
        "processor": _processor(),
        "cores": os.cpu_count() or 1,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }


def today() -> str:
    """Return the date in UTC, as ``2026-01-31``."""
    return datetime.now(UTC).date().isoformat()


def _git(*words: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", *words], cwd=project_root(), capture_output=True, encoding="utf-8", check=False
        )
    except FileNotFoundError:  # no git on this machine
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:  # noqa: PTH123 - a device, not data
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except FileNotFoundError:
        pass
    return platform.processor() or "unknown"
