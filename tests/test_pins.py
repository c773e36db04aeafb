"""The pinned versions install on the oldest Python that a stock distribution brings."""

import re
import tomllib
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

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


def test_every_library_that_an_extra_names_is_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    names = {canonicalize_name(Requirement(line).name) for group in groups for line in group}
    assert names - UNPINNED <= set(_pins())
