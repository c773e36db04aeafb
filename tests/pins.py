"""Write the hashes of everything that `make venv` and `make check` install here, into `pins/`.

    python -m tests.pins     # this is `make pins`: after a change of constraints.txt

`constraints.txt` says which version, for every system; a file of `pins/` says which files, for one
system and Python. pip resolves and downloads as it would for an installation, into nowhere. What
has a local version, such as a torch that was built for processors alone, comes from wherever this
machine has it and carries no hash.
"""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from cpl.store import atomic_write, project_root

__all__ = ["GROUPS", "lines", "main", "pins_path"]

GROUPS = {"": "book,test", "-browser": "browser"}
"""The end of a file's name, and the extras of cpl that it holds."""
HEAD = "# Made by `make pins`: [{extras}] on {system}. torch is left out, see the Makefile."


def pins_path(group: str = "", root: Path | None = None) -> Path:
    """Return where the hashes for this system and Python are kept; the Makefile says the same."""
    version = ".".join(map(str, sys.version_info[:2]))
    name = f"{sysconfig.get_platform()}-{version}{group}.txt"
    return (root or project_root()) / "pins" / name


def lines(report: Mapping[str, Any], without: Iterable[str] = ()) -> list[str]:
    """Turn pip's report of an installation into requirements with hashes.

    Args:
        report: What `pip install --report` writes.
        without: Requirements that another file holds already.

    Returns:
        `name==version --hash=sha256:...`, sorted; nothing for cpl and for local versions.
    """
    held = {line.partition(" ")[0] for line in without}
    found = []
    for each in report["install"]:
        name, version = each["metadata"]["name"], each["metadata"]["version"]
        if name == "cpl" or "+" in version or f"{name}=={version}" in held:
            continue
        hashes = each["download_info"]["archive_info"]["hashes"]
        found.append(f"{name}=={version} --hash=sha256:{hashes['sha256']}")
    return sorted(found, key=str.lower)


def main() -> int:
    """Write every group's file."""
    held: list[str] = []
    for group, extras in GROUPS.items():
        words = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--report", "-"]
        words += ["--ignore-installed", "-c", "constraints.txt", f".[{extras}]"]
        done = subprocess.run(words, cwd=project_root(), stdout=subprocess.PIPE, check=True)
        made = lines(json.loads(done.stdout), held)
        system = pins_path().stem
        text = "\n".join([HEAD.format(extras=extras, system=system), *made])
        sys.stdout.write(f"{atomic_write(pins_path(group), text + chr(10))}: {len(made)}\n")
        held += made
    return 0


if __name__ == "__main__":
    sys.exit(main())
