"""An optional library is present, absent, or broken for a reason that is told."""

import pytest

from cpl.cli import main
from cpl.optional import EXTRAS, PATIENCE_S, explain, install, look

fresh_look = look.__wrapped__  # an answer is kept, and here the same name is asked again


@pytest.fixture
def library(tmp_path, monkeypatch):
    """Put a module in front of whatever is installed under its name."""

    def put(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    return put


def test_a_library_that_loads_is_present(library):
    library("mujoco", "print('a greeting of the vendor')")
    found = fresh_look("mujoco")
    assert (bool(found), found.state, found.reason) == (True, "present", "")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("raise ImportError('libusb-1.0.so.0: cannot open')", "libusb-1.0.so.0: cannot open"),
        ("import no_such_dependency", "No module named 'no_such_dependency'"),
        ("1 / 0", "division by zero"),
        ("import os; os.abort()", "its import ends with -6"),
    ],
)
def test_installed_but_unloadable_is_broken_and_counts_as_absent(library, text, reason):
    library("pyrealsense2", text)
    found = fresh_look("pyrealsense2")
    assert (bool(found), found.state, found.reason) == (False, "broken", reason)
    assert str(found) == f"pyrealsense2 is installed but cannot be loaded: {reason}"


def test_an_import_that_never_ends_is_broken(library, monkeypatch):
    monkeypatch.setattr("cpl.optional.PATIENCE_S", 0.5)
    library("h5py", "import time; time.sleep(60)")
    assert fresh_look("h5py").reason == "its import takes more than 0 s"
    assert PATIENCE_S > 10


def test_an_absent_library_names_its_extra(monkeypatch):
    monkeypatch.setitem(EXTRAS, "no_such_sdk", ("no-such-sdk", "go1"))
    found = fresh_look("no_such_sdk")
    assert (bool(found), found.state) == (False, "absent")
    assert str(found) == f"no-such-sdk is not installed: {install('go1')}"
    with pytest.raises(ValueError, match=r"name must be one of cv2, .*, not 'numpy'"):
        look("numpy")


def test_a_failed_import_names_the_extra_only_of_optional_libraries():
    assert explain(ImportError("libGL.so.1: not found", name="cv2")) == (
        "opencv-python-headless is installed but cannot be loaded: libGL.so.1: not found"
    )
    assert explain(ModuleNotFoundError("no", name="no_such_thing")) is None
    assert explain(ImportError("nameless")) is None


def test_a_command_that_lacks_a_library_says_which_and_ends_with_status_2(monkeypatch, capsys):
    def lacking(name):
        raise ModuleNotFoundError(f"No module named {name!r}", name="mcap.records")

    monkeypatch.setattr("cpl.cli.import_module", _registering(lacking))
    assert main(["params"]) == 2
    assert capsys.readouterr().err == f"cpl params: mcap is not installed: {install('logs')}\n"


def _registering(fails):
    """Return an `import_module` whose modules register, and fail when they are to run."""
    import importlib
    from types import SimpleNamespace

    def load(name):
        real = importlib.import_module(name)
        return SimpleNamespace(register=real.register, run=fails)

    return load


def test_the_long_version_lists_every_optional_library(monkeypatch, capsys):
    monkeypatch.setattr("cpl.optional.EXTRAS", {"h5py": EXTRAS["h5py"]})
    assert main(["--version", "--long"]) == 0
    version, python, *libraries = capsys.readouterr().out.splitlines()
    assert version.startswith("cpl ")
    assert python.startswith("Python 3.")
    assert [line.split()[0] for line in libraries] == ["h5py"]
