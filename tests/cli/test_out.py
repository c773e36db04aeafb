"""`--out` goes through devices, pipes and links, and never over the input."""

import os
import threading
from pathlib import Path

import pytest

from cpl.cli import UsageError, main
from cpl.cli._out import write_out


def test_a_link_is_followed_and_stays(tmp_path):
    target, link = tmp_path / "there.csv", tmp_path / "link.csv"
    link.symlink_to(target)
    write_out(link, "1")  # it leads to nothing yet
    write_out(link, "2")
    assert link.is_symlink()
    assert target.read_text() == "2"


def test_a_file_keeps_its_other_names(tmp_path):
    (tmp_path / "one").write_text("long before")
    os.link(tmp_path / "one", tmp_path / "two")
    write_out(tmp_path / "one", "now")
    assert (tmp_path / "two").read_text() == "now"


def test_a_pipe_is_written_to(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    write_out(pipe, "through")
    reader.join(timeout=10)
    assert got == ["through"]
    assert pipe.is_fifo()


def test_a_device_stays_one():
    write_out(Path(os.devnull), "gone")
    assert not Path(os.devnull).is_file()


def test_the_input_under_any_name_is_refused(tmp_path, capsys):
    scores = tmp_path / "scores.csv"
    scores.write_text("0.1\n0.2\n")
    (tmp_path / "link.csv").symlink_to(scores)
    os.link(scores, tmp_path / "twin.csv")
    for name in ("scores.csv", "link.csv", "twin.csv"):
        assert main(["track", str(scores), "--out", str(tmp_path / name)]) == 2
        assert "--out must not be the input" in capsys.readouterr().err
    assert scores.read_text() == "0.1\n0.2\n"


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(UsageError, match="must be a file, got the folder"):
        write_out(tmp_path, "x")
