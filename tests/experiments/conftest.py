"""The work layer of the tests: one for each test, or one for all processes of a run."""

import fcntl
import os

import pytest

from cpl.experiments import compute


@pytest.fixture(autouse=True)
def _own_store(request, tmp_path, monkeypatch):
    """Keep the work layer of a test apart from everybody's, unless its module shares one."""
    if "shared_store" not in request.fixturenames:
        monkeypatch.setenv("CPL_STORE", str(tmp_path / "store"))


@pytest.fixture(scope="session")
def common_folder(tmp_path_factory):
    """A folder that all processes of a run see."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="module")
def shared_store(common_folder):
    """One work layer for all modules that ask for it: networks are trained once a run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CPL_STORE", str(common_folder / "trained"))
        yield


@pytest.fixture(scope="module")
def smoke(shared_store, common_folder):
    """Compute experiments at their smallest; of processes that ask at once one trains."""

    def tables(*names):
        with (common_folder / "trained.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            return {name: compute(name, profile="smoke").table for name in names}

    return tables
