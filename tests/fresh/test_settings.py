"""What a fresh machine is told about the way to packages is what this machine uses."""

import configparser
from pathlib import Path

import pytest

from tests.fresh.settings import named_paths, pip_files, pip_settings


@pytest.fixture
def machine(tmp_path):
    """A machine with a home, an index on its disk, a folder of wheels and constraints."""
    home, index = tmp_path / "home", tmp_path / "served" / "simple"
    for folder in (home / ".config" / "pip", index / "torch", tmp_path / "wheels"):
        folder.mkdir(parents=True)
    (tmp_path / "served" / "files").mkdir()
    page = '<a href="../../files/torch-1-py3-none-any.whl#sha256=0">torch</a> <a href="own.whl">'
    (index / "torch" / "index.html").write_text(page)
    (tmp_path / "caps.txt").write_text("torch<2\n")
    (home / ".config" / "pip" / "pip.conf").write_text(
        f"[global]\nfind-links = {tmp_path / 'wheels'}\n"
        f"extra-index-url =\n    https://one/simple\n    {index.as_uri()}\n"
        "[install]\nno-compile = true\n"
    )
    return tmp_path


def environ(machine, **more):
    return {"HOME": str(machine / "home"), "XDG_CONFIG_DIRS": str(machine / "xdg"), **more}


def own(files, machine):
    return [path for path in files if path.is_relative_to(machine)]


def test_settings_are_merged_as_pip_merges_them(machine):
    late = machine / "late.conf"
    late.write_text("[global]\ntimeout = 7\nfind-links = /no/such\n")
    told = environ(machine, PIP_CONFIG_FILE=str(late))
    assert own(pip_files(told), machine) == [
        machine / "home" / ".config" / "pip" / "pip.conf",
        late,
    ]
    merged = configparser.RawConfigParser()
    merged.read_string(pip_settings(told).config)
    assert merged["global"]["timeout"] == "7"
    assert merged["global"]["find-links"] == "/no/such"
    assert merged["global"]["extra-index-url"].split()[0] == "https://one/simple"
    assert merged["install"]["no-compile"] == "true"
    assert "PIP_CONFIG_FILE" not in pip_settings(told).environ


def test_what_settings_name_on_this_disk_is_passed_on(machine):
    told = environ(machine, PIP_CONSTRAINT=str(machine / "caps.txt"), PIP_RETRIES="9")
    assert set(own(pip_settings(told).paths, machine)) == {
        machine / "wheels",
        machine / "served" / "simple",
        machine / "served" / "files",  # outside of the index, but its pages point there
        machine / "caps.txt",
    }


def test_the_rest_of_the_environment_stays_here(machine):
    net = {"SSL_CERT_FILE": "/a", "https_proxy": "http://b", "REQUESTS_CA_BUNDLE": "/c"}
    other = {"PYTHONPATH": "/x", "LANG": "C", "SECRET": "s", "PIPX_HOME": "/y"}
    told = pip_settings(environ(machine, PIP_INDEX_URL="https://i", **net, **other)).environ
    assert told == {"PIP_INDEX_URL": "https://i", **net}


def test_relative_words_and_the_root_are_no_paths_to_pass_on():
    assert named_paths(["wheels", "/", "60 https://host/etc", ""]) == ()
    assert named_paths([str(Path("/etc")), "file:///etc"]) == (Path("/etc"),)
