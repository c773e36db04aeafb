"""The pinned versions install on the oldest Python that a stock distribution brings."""

import re
import subprocess
import sys
import tomllib
from importlib.metadata import distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests.pins import GROUPS, pins_path

ROOT = Path(__file__).parent.parent
# Debian 12 is the oldest system that the README promises; its patch level decides what installs.
DEBIAN_12 = "3.11.2"
# Beside the project's own, pip and the wheel of cpl itself are in every environment.
UNPINNED = {"cpl", "pip"}


def _pins():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = (re.match(r"([A-Za-z0-9._-]+)==([^\s;\\]+)", line) for line in lines)
    return {canonicalize_name(pin[1]): pin[2] for pin in pins if pin}


@pytest.fixture(scope="module")
def installed():
    found = {canonicalize_name(d.metadata["Name"]): d for d in distributions()}
    return {name: d for name, d in found.items() if name not in UNPINNED}


def test_every_pin_admits_the_python_of_debian_12(installed):
    refused = {
        name: d.metadata["Requires-Python"]
        for name, d in installed.items()
        if not SpecifierSet(d.metadata.get("Requires-Python") or "").contains(DEBIAN_12)
    }
    assert not refused


def test_what_is_installed_is_pinned_at_its_version(installed):
    pins = _pins()
    drift = {
        name: (d.version, pins.get(name))
        for name, d in installed.items()
        if d.version.partition("+")[0] != pins.get(name)
    }
    assert not drift


def _hashed():
    texts = [pins_path(group).read_text(encoding="utf-8") for group in GROUPS]
    lines = [line for text in texts for line in text.splitlines() if not line.startswith("#")]
    return [re.fullmatch(r"(\S+)==(\S+) --hash=sha256:[0-9a-f]{64}", line) for line in lines]


def _needed(extras):
    """Return what a set of extras installs here, with everything that it requires."""
    found, named = set(), [Requirement(f"cpl[{extras}]")]
    while named:
        asked = named.pop()
        for extra in asked.extras or {""}:
            key = canonicalize_name(asked.name), extra
            if key not in found:
                found.add(key)
                lines = map(Requirement, requires(asked.name) or [])
                named += [r for r in lines if not r.marker or r.marker.evaluate({"extra": extra})]
                named += [Requirement(asked.name)]
    return {name for name, _ in found} - UNPINNED


@pytest.mark.skipif(not pins_path().exists(), reason="no hashes are kept for this system")
def test_everything_that_is_installed_here_has_a_hash_but_torch():
    hashed = {canonicalize_name(line[1]): line[2] for line in _hashed()}
    pins = _pins()
    assert {name: pins.get(name) for name in hashed} == hashed, "make pins"
    assert _needed("book,test") - hashed.keys() == {"torch"}, "make pins"


@pytest.mark.skipif(not pins_path().exists(), reason="no hashes are kept for this system")
def test_pip_refuses_a_file_with_another_content(tmp_path):
    pin = _hashed()[0]
    archive = f"{pin[1].replace('-', '_')}-{pin[2]}.tar.gz"
    (tmp_path / archive).write_bytes(b"not what was pinned")
    (tmp_path / "pins.txt").write_text(f"{pin[0]}\n")
    words = [sys.executable, "-m", "pip", "download", "--no-index", "--no-deps", "--dest", "got"]
    words += ["--find-links", str(tmp_path), "--require-hashes", "-r", str(tmp_path / "pins.txt")]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "DO NOT MATCH THE HASHES" in done.stderr


def test_every_library_that_an_extra_names_is_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    names = {canonicalize_name(Requirement(line).name) for group in groups for line in group}
    assert names - UNPINNED <= set(_pins())
