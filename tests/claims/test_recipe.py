"""The recipe for a claim in CONTRIBUTING.md, followed word by word in a copy of the project."""

import re
import shutil
import subprocess
import sys

import pytest

from cpl.claims import committed
from cpl.store import project_root


@pytest.fixture(scope="module")
def steps():
    text = (project_root() / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return text.partition("### A claim")[2].partition("\n## ")[0]


@pytest.fixture
def checkout(tmp_path):
    """The package and the published results, where a newcomer may write."""
    root = project_root()
    shutil.copytree(root / "cpl", tmp_path / "cpl", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(root / "data" / "results", tmp_path / "data" / "results")
    for shown in ("book", "pyproject.toml", "data/models"):
        (tmp_path / shown).symlink_to(root / shown)
    return tmp_path


def claims(checkout, *words):
    done = subprocess.run(
        [sys.executable, "-m", "cpl", "claims", *words],
        cwd=checkout, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout.splitlines(), done.stderr


def test_a_claim_is_one_file_that_is_found(steps, checkout):
    place = re.search(r"`(cpl/claims/rows/c\d+_\w+\.py)`", steps)[1]
    row = int(re.search(r"/c(\d+)_", place)[1])
    assert row == len(committed()) + 1, "the recipe's number should follow the last row"
    code = re.search(r"```python\n(.*?)```", steps, re.DOTALL)[1]
    (checkout / place).write_text(code, encoding="utf-8")

    announced = re.search(r"`(claim \d+ changed: .*?)`", steps)[1]
    status, lines, complaint = claims(checkout)
    assert (status, complaint) == (1, f"{announced}\n")
    assert lines[-1].split(maxsplit=2)[:2] == [str(row), announced.rpartition(" ")[2]]

    assert claims(checkout, "--accept")[::2] == (0, "")
    assert committed(root=checkout / "data" / "results") == committed() | {row: "holds"}
