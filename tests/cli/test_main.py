"""What a person types is answered or refused, quickly, with the right exit status."""

import json
import subprocess
import sys
import time
from importlib.metadata import version

import pytest

from cpl.cli import main, project_root
from cpl.publish.chapters import find_chapters
from cpl.store import project_root as root_of_the_store


def test_the_command_line_agrees_with_the_store_on_where_the_project_is():
    assert project_root() == root_of_the_store()


def test_params_lists_the_chapters_one_name_a_line(capsys):
    assert main(["params"]) == 0
    assert capsys.readouterr().out.split() == list(find_chapters(project_root()))


def test_params_of_a_chapter_say_type_unit_range_and_meaning(capsys):
    for name, chapter in find_chapters(project_root()).items():
        assert main(["params", name, "--json"]) == 0
        listed = json.loads(capsys.readouterr().out)
        assert [entry["name"] for entry in listed] == [p.name for p in chapter.parameters]
        assert all({"type", "default", "unit", "range", "meaning"} <= set(e) for e in listed)
        assert main(["params", name]) == 0
        said = capsys.readouterr().out
        assert all(entry["meaning"] in said for entry in listed)


@pytest.mark.parametrize("words", [["params", "no-such"], ["run", "no-such"], ["run", "../x"]])
def test_an_unknown_chapter_is_refused(capsys, words):
    assert main(words) == 2
    assert "there is no chapter" in capsys.readouterr().err


def test_what_makes_no_sense_ends_with_status_2(capsys):
    for words in ([], ["no-such-command"], ["run"]):
        with pytest.raises(SystemExit) as end:
            main(words)
        assert end.value.code == 2
    assert "COMMAND" in capsys.readouterr().err


def test_help_lists_the_commands_and_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    assert main(["--version"]) == 0
    said = capsys.readouterr().out
    assert all(name in said for name in ("params", "run", "build"))
    assert f"cpl {version('cpl')}" in said


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("{near}=0.2", "did you mean"),
        ("{name}=1e9999", "{name} must be"),
        ("{name}=abc", "{name} must be"),
        ("{name}=nan", "{name} must be"),
        ("{name}=__import__('os').abort()", "{name} must be"),
        ("import os; os.abort()=1", "has no parameter"),
    ],
)
def test_a_senseless_setting_is_refused_in_two_seconds_and_starts_nothing(setting, says):
    chapter = next(c for c in find_chapters(project_root()).values() if c.parameters)
    name = next(p.name for p in chapter.parameters if p.type in ("int", "float"))
    near = name + "x" if len(name) > 1 else name + name
    typed = setting.format(name=name, near=near)
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "cpl", "run", chapter.name, "--set", typed],
        capture_output=True,
        text=True,
        check=False,
        cwd=project_root(),
    )
    assert time.perf_counter() - begin < 2
    assert done.returncode == 2
    assert done.stdout == ""
    assert says.format(name=name) in done.stderr
    assert "Traceback" not in done.stderr
