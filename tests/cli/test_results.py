"""The commands that compute, verify and judge: what they print and how they end."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import fields

import pytest

from cpl.claims import committed
from cpl.claims.row import Row
from cpl.cli import main
from cpl.experiments.run.publication import job
from cpl.store import WorkStore, data_path, plain


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    monkeypatch.setenv("CPL_STORE", str(tmp_path / "store"))
    return WorkStore()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["compute", "proximitty"], "did you mean 'proximity'?"),
        (["compute", "proximity", "--profile", "big"], "smoke, book, paper"),
        (["compute", "proximity", "--set", "point=5"], "did you mean 'points'?"),
        (["compute", "proximity", "--set", "points=many"], "points must be an int"),
        (["compute", "proximity", "--set", "points=1"], "points must be an int in [2, inf)"),
        (["compute", "proximity", "--set", "points"], "name=value"),
        (["compute", "proximity", "--set", "points=5", "--publish"], "--publish goes with"),
        (["verify", "proximitty"], "did you mean"),
        (["verify", "proximity", "--sample", "0"], "sample must be positive"),
        (["verify", "proximity", "--profile", "smoke"], "no published result"),
        (["status", "proximitty"], "did you mean"),
    ],
)
def test_what_makes_no_sense_is_refused_before_any_work(words, named, capsys, store):
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert named in err
    assert out == ""
    assert not store.root.exists()


@pytest.mark.parametrize("words", [["compute"], ["compute", "proximity", "--workers", "0"]])
def test_argparse_refuses_with_the_same_status(words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2


def test_compute_shows_settings_and_content(capsys):
    words = ["compute", "proximity", "--profile", "smoke", "--set", "points=5", "--workers", "1"]
    assert main(words) == 0
    out, err = capsys.readouterr()
    assert "points = 5" in out
    assert "5 rows in 1 shards" in out
    assert "1/1" in err
    assert main([*words, "--quiet"]) == 0
    assert capsys.readouterr() == (out, "")


def test_status_says_what_is_computed_and_published(capsys):
    main(["compute", "proximity", "--profile", "smoke", "--quiet"])
    capsys.readouterr()
    assert main(["status", "proximity"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("proximity: Where does the normalised distance lie")
    assert "smoke: 1 of 1 shards computed" in out
    assert "paper: published, made 20" in out


def test_status_says_why_something_is_stale(capsys, store):
    plan = job("miscoverage", "smoke")
    older = {"parameters": plain(plan.config), "modules": plan.modules | {"cpl.rng": "older"}}
    store.describe("miscoverage", "0" * 64, older | {"versions": plan.versions})
    assert main(["status", "miscoverage"]) == 0
    assert "smoke: computed, but stale: cpl.rng changed" in capsys.readouterr().out


def test_verify_compares_what_is_published(capsys):
    assert main(["verify", "proximity"]) == 0
    assert "proximity/paper: agrees (1 of 1 shards" in capsys.readouterr().out


def test_verify_differs_with_status_1(capsys, monkeypatch):
    from cpl.experiments.road import proximity

    monkeypatch.setattr(proximity, "proximity", lambda l_m: l_m * 0.5)
    assert main(["verify", "proximity"]) == 1
    assert "DIFFERS" in capsys.readouterr().out


def test_claims_as_json_is_one_object_a_line(capsys):
    assert main(["claims", "--json"]) == 0
    out = capsys.readouterr().out
    objects = json.loads(out)
    assert [row["row"] for row in objects] == list(committed())
    lines = [line.rstrip(",") for line in out.splitlines()[1:-1]]
    assert [json.loads(line) for line in lines] == objects
    assert list(objects[0]) == [field.name for field in fields(Row)]


def test_claims_in_words(capsys):
    assert main(["claims"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len([line for line in lines if line[:2].strip().isdigit()]) == len(committed())
    assert lines[0].startswith(" 1  holds")


def test_claims_exits_1_where_a_verdict_changed(capsys, monkeypatch, tmp_path):
    verdicts = json.loads(data_path("results", "verdicts.json").read_text())
    other = tmp_path / "verdicts.json"
    other.write_text(json.dumps({**verdicts, "1": "does not hold"}))
    monkeypatch.setattr("cpl.claims._ledger._file", lambda _root: other)
    assert main(["claims"]) == 1
    assert "claim 1 changed: does not hold -> holds" in capsys.readouterr().err
    assert main(["claims", "--accept"]) == 0
    assert json.loads(other.read_text()) == verdicts


def test_claims_with_a_damaged_result_fails(capsys, monkeypatch, tmp_path):
    import shutil

    folder = tmp_path / "results"
    shutil.copytree(data_path("results"), folder)
    path = folder / "windows" / "paper.parquet"
    path.write_bytes(path.read_bytes()[:-5])
    monkeypatch.setattr("cpl.store.published.data_path", lambda *parts: folder.joinpath(*parts[1:]))
    assert main(["claims"]) == 1
    assert "does not agree" in capsys.readouterr().err


def test_ctrl_c_keeps_what_is_finished_and_says_so(store):
    """The real command: interrupted, status 130; the second run finds what the first kept."""
    words = ["compute", "quantile_range", "--set", "settings=149", "T=150", "--workers", "1"]
    command = [sys.executable, "-m", "cpl", *words]
    driver = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell's background job ignores Ctrl-C, and hands that on to what it starts.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 120
    while not list(store.root.glob("quantile_range/*/*.shard")) and time.monotonic() < deadline:
        assert driver.poll() is None, "the command ended before it could be hit"
        time.sleep(0.01)
    os.kill(driver.pid, signal.SIGINT)
    _, err = driver.communicate(timeout=60)
    assert driver.returncode == 130
    assert "the same command goes on from here" in err
    kept = len(list(store.root.glob("quantile_range/*/*.shard")))
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"({kept} found)" in again.stderr or "6 of 6" in again.stderr
