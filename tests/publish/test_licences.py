"""What the site carries of others has its licence beside it."""

import importlib.util

import pytest

from cpl.store import project_root


@pytest.fixture(scope="module")
def licences():
    path = project_root() / "book" / "_ext" / "licences.py"
    spec = importlib.util.spec_from_file_location("licences", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_part_that_is_carried_has_its_licence(licences, tmp_path):
    licences.write(tmp_path)
    told = (tmp_path / "README.txt").read_text(encoding="utf-8")
    assert all(what in told for what in licences.CARRIED)
    texts = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.glob("*.txt")}
    assert "Apache License" in texts["mathjax-LICENSE.APACHE.txt"]
    owners = {package for _, package in licences.CARRIED.values()} - {"packaging"}
    assert all(any(name.startswith(f"{owner}-") for name in texts) for owner in owners)
    assert all(len(text) > 200 for text in texts.values())


def test_a_package_without_a_licence_file_fails_the_build(licences):
    with pytest.raises(FileNotFoundError, match="sphinx-mathjax-offline has no licence file"):
        licences.licence_files("sphinx-mathjax-offline")
