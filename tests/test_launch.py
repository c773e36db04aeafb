"""Where else the book can be opened: what those files name is there."""

import json
import os
import re
import subprocess
import tomllib

import pytest

from cpl.store import project_root

ROOT = project_root()
EXTRAS = set(
    tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
)


def test_the_devcontainer_builds_with_a_command_of_the_makefile():
    told = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    assert (ROOT / ".devcontainer" / told["build"]["dockerfile"]).is_file()
    target = told["postCreateCommand"].removeprefix("make ")
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE)


def test_the_devcontainer_has_an_ordinary_user():
    told = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    dockerfile = (ROOT / ".devcontainer" / "Dockerfile").read_text()
    assert f"useradd --create-home --shell /bin/bash {told['remoteUser']}\n" in dockerfile
    assert dockerfile.splitlines()[-1] == f"USER {told['remoteUser']}"


def test_images_are_of_the_python_that_the_versions_are_pinned_for():
    python = re.search(r"Python (\d\.\d+)", (ROOT / "constraints.txt").read_text())[1]
    first = (ROOT / ".devcontainer" / "Dockerfile").read_text().splitlines()[0]
    assert first == f"FROM python:{python}-bookworm"
    assert (ROOT / ".binder" / "runtime.txt").read_text() == f"python-{python}\n"


def test_binder_installs_extras_that_exist_with_the_pinned_versions():
    script = ROOT / ".binder" / "postBuild"
    assert os.access(script, os.X_OK)
    subprocess.run(["bash", "-n", script], check=True)
    text = script.read_text()
    assert "-c constraints.txt" in text
    assert set(re.search(r'"\.\[([a-z,]+)\]"', text)[1].split(",")) <= EXTRAS


@pytest.mark.parametrize("name", ["README.md", "book/trouble.md"])
def test_extras_that_the_text_names_exist(name):
    named = re.findall(r"\.\[([a-z,]+)\]", (ROOT / name).read_text())
    assert {extra for group in named for extra in group.split(",")} <= EXTRAS
