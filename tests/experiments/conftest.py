import pytest


@pytest.fixture(autouse=True)
def _own_store(tmp_path, monkeypatch):
    """Keep the work layer of the tests apart from everybody's."""
    monkeypatch.setenv("CPL_STORE", str(tmp_path / "store"))
