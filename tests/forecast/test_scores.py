"""Files of scores as people have them: read as meant, or refused with the line and the way out."""

import bz2
import gzip
import lzma
import zipfile

import pytest
import zstandard

from cpl.cli import main
from cpl.forecast.scores import open_scores, read_scores


@pytest.fixture
def put(tmp_path):
    def put_(text, name="scores.csv"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return put_


@pytest.mark.parametrize(
    ("text", "column", "expected"),
    [
        ("0.1\n0.2\n", None, [0.1, 0.2]),
        ("score\n0.1\n1e-3\n", None, [0.1, 0.001]),
        ("# made by hand\nt,s\n1,0.5\n2,0.25\n", "s", [0.5, 0.25]),
        ("a;b\n1,5;2,5\n3;0,25\n", "b", [2.5, 0.25]),
        ("a\tb\n1.5\t2.5\n3\t4\n", "a", [1.5, 3]),
        ("a  b\n1.5   2.5\n3 4\n", "b", [2.5, 4]),
        ("0,5 0,3\n0,1 0,7\n", "2", [0.3, 0.7]),
        ("score\n0,5\n0,25\n", None, [0.5, 0.25]),
        ("5\n0,25\n", None, [5, 0.25]),
        ("1,5\r\n2,5\r\n", "2", [5, 5]),
        ("score,score\n0.1,0.9\n0.2,0.8\n", "2", [0.9, 0.8]),
        ('"t","s"\n"1","0.5"\n"2","0.25"\n', "s", [0.5, 0.25]),
        ("\ufeffscore\n0.5\n", "score", [0.5]),
        ("0.1,\n0.2,\n", None, [0.1, 0.2]),
        ("\n\nscore\n0.1\n\n\n", None, [0.1]),
    ],
)
def test_scores_are_read_as_meant(put, text, column, expected):
    two_ways = "1,5\r" in text
    found = open_scores(put(text), column, decimal="." if two_ways else None)
    assert found.values.tolist() == expected


@pytest.mark.parametrize(
    ("text", "clock", "expected"),
    [
        ("t,s\n0.0,0.5\n0.07,0.25\n", "t", [0.5, 0.25]),
        ("s;time_s\n0,5;3\n0,25;9\n", "time_s", [0.5, 0.25]),
        (",score\n0,0.5\n1,0.25\n", "", [0.5, 0.25]),
        ("7 0.5\n8 0.25\n", "1", [0.5, 0.25]),
        ("when,s\n2024-01-01 00:00:00,0.5\n2024-01-01 00:00:01,0.25\n", "when", [0.5, 0.25]),
    ],
)
def test_a_clock_beside_the_scores_is_recognised(put, text, clock, expected):
    found = open_scores(put(text))
    assert (found.clock, found.values.tolist()) == (clock, expected)


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("", None, "must be a table of numbers, and nothing is in it"),
        ("score\n", None, "only a line of names"),
        ("a,b\n1,2\n5,1\n", None, "several columns, choose one: 1 'a', 2 'b'"),
        ("t,time\n1,1\n2,2\n", None, "several columns"),
        ("a,b\n1,2\n", "c", "no column 'c'"),
        ("score,score\n0.1,0.9\n", "score", "several columns 'score', choose by number"),
        ("s\n0.1\nlost\n", None, "line 3: a score must be a number, got 'lost'"),
        ("0.1\n# remark\n\n0.2x\n", None, "line 4: a score must be a number, got '0.2x'"),
        ("s\n0.1\n1_0\n", None, "line 3"),
        ("0.1\ninf\n", None, "line 2: a score must be finite, got 'inf'"),
        ("1\n2,3\n4,5,6\n", None, "line 3"),
        ("a;b\n1;2\n3\n", None, "line 3: it has 1 cells, the first line 2"),
        ("0.1\n\n0.2\n", None, r"line 2: a score is missing \(1 of 3 are\)"),
        ("t,s\n1,0.1\n2,\n3,NaN\n", "s", r"line 3: a score is missing \(2 of 3 are\)"),
        ("0,5\n0,25\n", None, "two ways: is '0,5' one number or two"),
        (b"\xff\xff\xfe", None, "must be a table of numbers"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_line(put, text, column, message):
    with pytest.raises(ValueError, match=message):
        read_scores(put(text), column)


def test_missing_scores_are_carried_or_dropped_and_counted(put):
    path = put("s\n0.1\n\n0.2\n\n\n0.3\n")
    carried, dropped = (open_scores(path, missing=how) for how in ("carry", "drop"))
    assert carried.values.tolist() == [0.1, 0.1, 0.2, 0.2, 0.2, 0.3]
    assert dropped.values.tolist() == [0.1, 0.2, 0.3]
    assert (carried.missing, dropped.missing) == (3, 3)
    with pytest.raises(ValueError, match="line 2: no score before it"):
        open_scores(put("s\n\n0.1\n"), missing="carry")
    with pytest.raises(ValueError, match="missing must be one of refuse, carry, drop"):
        open_scores(path, missing="guess")


def zipped(text, tmp_path, *names):
    with zipfile.ZipFile(tmp_path / "made.zip", "w") as archive:
        for name in names:
            archive.writestr(name, text)
    return (tmp_path / "made.zip").read_bytes()


def packed(text, ending, tmp_path):
    return {
        "gz": gzip.compress,
        "bz2": bz2.compress,
        "xz": lzma.compress,
        "zst": zstandard.ZstdCompressor().compress,
        "zip": lambda text: zipped(text, tmp_path, "scores.csv"),
    }[ending](text)


@pytest.mark.parametrize("ending", ["gz", "bz2", "xz", "zst", "zip"])
def test_compressed_files_are_read_and_damaged_ones_are_one_line(put, tmp_path, ending):
    whole = packed(b"0.1\n0.2\n" * 200, ending, tmp_path)
    name = f"scores.csv.{ending}"
    assert len(read_scores(put(whole, name))) == 400
    at = 100 if ending == "zip" else 10
    for damaged in (whole[: len(whole) // 2], b"0.1\n", whole[:at] + b"\0\xff" + whole[at + 2 :]):
        with pytest.raises(ValueError, match=f"scores.csv.{ending} ") as told:
            read_scores(put(damaged, name))
        assert "\n" not in str(told.value)


def test_an_archive_of_two_files_or_of_too_much_is_refused(put, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="must hold one file, not 2"):
        read_scores(put(zipped("0.1\n", tmp_path, "a", "b"), "two.zip"))
    monkeypatch.setattr("cpl.forecast._text.LARGEST", 100)
    with pytest.raises(ValueError, match="must hold at most"):
        read_scores(put(gzip.compress(b"0.1\n" * 999), "bomb.csv.gz"))


def test_the_command_says_what_it_recognised(put, capsys):
    path = put("t;s\n0;0,1\n1;\n2;0,2\n")
    assert main(["track", str(path), "--missing", "carry"]) == 0
    said = capsys.readouterr()
    assert said.err.splitlines() == [
        "tracking 's'; 't' only counts or tells the time",
        "a comma is the decimal mark",
        "1 scores are missing: the last score was carried on",
    ]
    assert "steps            3" in said.out


@pytest.mark.parametrize(
    ("text", "words", "said"),
    [
        ("0.1\n" * 90, ["--delay", "3"], "--rule fixed --eta"),
        ("0\n" + "0.1\n" * 90, [], "--rule fixed --eta"),
        ("-0.1\n" + "0.1\n" * 90, [], "absolute values"),
        ("0.1\n0.1\n", [], "more of them would do"),
    ],
)
def test_without_a_bound_the_command_says_what_gives_one(put, capsys, text, words, said):
    assert main(["track", str(put(text)), *words]) == 0
    assert said in capsys.readouterr().out.splitlines()[-1]
