from pathlib import Path

import pytest

import cpl.experiments
from cpl.experiments import names
from cpl.experiments.run import found
from cpl.store import manifests
from cpl.store.source import is_module


def test_every_published_result_has_its_experiment():
    assert {manifest.experiment for manifest in manifests()} <= set(names())


def test_a_name_leads_to_a_module_whose_file_is_named_like_it():
    for name in names():
        module = found.module_of(name)
        assert is_module(module)
        assert module.rpartition(".")[2] == name


def test_what_experiments_share_is_none():
    assert not {"setup", "policies", "streams", "lab", "job"} & set(names())


def test_every_room_says_what_it_asks():
    folders = [path.parent for path in Path(cpl.experiments.__file__).parent.glob("*/__init__.py")]
    assert len(folders) >= 9
    for folder in folders:
        assert (folder / "__init__.py").read_text(encoding="utf-8").startswith('"""')


def test_two_files_of_one_name_are_refused(tmp_path, monkeypatch):
    for room in ("a", "b"):
        (tmp_path / room).mkdir()
        (tmp_path / room / "same.py").write_text("EXPERIMENT = 1\n")
    monkeypatch.setattr(found, "__file__", str(tmp_path / "run" / "found.py"))
    with pytest.raises(ValueError, match=r"one name: cpl\.experiments\.a\.same and cpl"):
        found._found.__wrapped__()
