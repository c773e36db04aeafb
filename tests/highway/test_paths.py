"""Which arithmetic runs, and how it is chosen."""

import os
import subprocess
import sys

import pytest

from cpl.highway import active_path, path_report
from cpl.highway.exact import FAST, LIBM
from cpl.highway.paths import ENVIRONMENT_VARIABLE, _drive


def test_both_paths_give_the_stored_digest():
    assert _drive(FAST) == _drive(LIBM)
    assert path_report().path == active_path()


def test_a_path_can_be_forced(monkeypatch):
    monkeypatch.setenv(ENVIRONMENT_VARIABLE, "portable")
    assert path_report() == ("portable", f"forced by {ENVIRONMENT_VARIABLE}")
    monkeypatch.setenv(ENVIRONMENT_VARIABLE, "quick")
    with pytest.raises(ValueError, match=r"CPL_HIGHWAY_PATH must be .*, got \'quick\'"):
        active_path()


def test_importing_the_engine_imports_no_heavy_peer():
    code = "import sys, cpl.highway; print({'highway_env', 'pygame', 'torch'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=dict(os.environ),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "set()"
