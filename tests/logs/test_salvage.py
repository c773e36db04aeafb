"""Truncated and bit-flipped files: what is left is exact, and what is gone is said."""

import io
import struct

import numpy as np
import pandas as pd
import pytest
import zstandard
from mcap.exceptions import McapError
from mcap.records import Message
from mcap.stream_reader import StreamReader

from cpl.logs import (
    DamagedLogError,
    EmptyLogError,
    LogError,
    MissingChannelError,
    NotALogError,
    read_run,
)
from cpl.logs.salvage import MAGIC
from tests.logs.conftest import salvage


def recovered(data, path, whole_run):
    """Read damaged bytes: all that comes back must be rows of the whole run, unchanged."""
    path.write_bytes(data)
    try:
        run = read_run(path)
    except LogError as error:
        assert str(error).startswith(path.name)  # noqa: PT017 - any of its kinds will do
        return 0, error
    assert not run.recovery.whole
    assert run.recovery.faults
    assert run.info == whole_run.info
    pd.testing.assert_frame_equal(run.table, whole_run.table.loc[run.table.index], check_exact=True)
    dropped = run.recovery.rows_dropped
    assert dropped in (None, len(whole_run.table) - len(run.table))
    return len(run.table), run


def by_the_library(data):
    """How many messages the library's own stream reader gives."""
    count = 0
    try:
        for record in StreamReader(io.BytesIO(data), validate_crcs=True).records:
            count += isinstance(record, Message)
    except (McapError, ValueError, struct.error, zstandard.ZstdError, MemoryError, OverflowError):
        return count
    return count


@pytest.fixture(scope="module")
def whole_run(whole, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "whole.mcap"
    path.write_bytes(whole)
    return read_run(path, strict=True)


def cut(whole, seed):
    return whole[: np.random.default_rng([1, seed]).integers(0, len(whole))]


def flipped(whole, seed):
    rng, data = np.random.default_rng([2, seed]), bytearray(whole)
    for _ in range(1 + seed % 3):
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
    return bytes(data)


def chunk_ends(whole, begins):
    return [at + 9 + int.from_bytes(whole[at + 1 : at + 9], "little") for at in begins]


def check_cut(whole, seed, path, whole_run):
    data = cut(whole, seed)
    rows, _ = recovered(data, path, whole_run)
    assert len(salvage(data).messages) >= by_the_library(data)
    begins = sorted({at for at, _ in salvage(whole).messages})
    assert rows == 20 * sum(end <= len(data) for end in chunk_ends(whole, begins))


def check_flip(whole, seed, path, whole_run):
    data = flipped(whole, seed)
    rows, told = recovered(data, path, whole_run)
    assert len(salvage(data).messages) >= by_the_library(data)
    if isinstance(told, LogError):  # one flip in each of the two descriptions
        assert seed % 3
        assert "where it comes from is not known" in str(told)
    else:
        assert rows >= 100 - 20 * (1 + seed % 3)  # a flipped bit costs a chunk, not the run


@pytest.mark.parametrize("seed", range(10))
def test_a_truncated_file_gives_what_is_before_the_cut(whole, seed, tmp_path, whole_run):
    check_cut(whole, seed, tmp_path / "cut.mcap", whole_run)


@pytest.mark.parametrize("seed", range(20))
def test_a_flipped_bit_costs_a_chunk_at_most_and_is_never_silent(whole, seed, tmp_path, whole_run):
    check_flip(whole, seed, tmp_path / "flip.mcap", whole_run)


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(10, 210))
def test_two_hundred_cuts(whole, seed, tmp_path, whole_run):
    check_cut(whole, seed, tmp_path / "cut.mcap", whole_run)


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(20, 220))
def test_two_hundred_flips(whole, seed, tmp_path, whole_run):
    check_flip(whole, seed, tmp_path / "flip.mcap", whole_run)


@pytest.mark.parametrize("at", range(0, 200, 7))
def test_every_byte_of_the_beginning_matters_and_none_is_fatal(whole, at, tmp_path, whole_run):
    data = bytearray(whole)
    data[at] ^= 0x10
    rows, _ = recovered(bytes(data), tmp_path / "flip.mcap", whole_run)
    assert rows == 100


def test_the_report_of_a_cut_says_bytes_and_place(whole, tmp_path, whole_run):
    third = [at for at, _ in salvage(whole).messages]
    third = sorted(set(third))[2]
    rows, run = recovered(whole[: third + 50], tmp_path / "cut.mcap", whole_run)
    assert rows == 40
    told = run.recovery
    assert (told.bytes, told.bytes_dropped) == (third + 50, 50)
    assert told.seconds == pytest.approx(3.9)
    assert str(told) == (
        f"damaged: 40 rows, 3.90 s recovered, an unknown number of rows and 50 of {third + 50} "
        "bytes dropped"
    )
    assert f"byte {third}: the file ends inside a chunk record" in str(told.faults[0])


def test_a_lost_chunk_is_a_gap_that_nothing_looks_across(whole, tmp_path, whole_run):
    data = bytearray(whole)
    second = sorted({at for at, _ in salvage(whole).messages})[1]
    data[second + 100] ^= 0x40
    rows, run = recovered(bytes(data), tmp_path / "flip.mcap", whole_run)
    assert (rows, run.recovery.rows_dropped) == (80, 20)
    assert [each.index[[0, -1]].tolist() for each in run.segments()] == [[0, 19], [40, 99]]
    with pytest.raises(DamagedLogError, match="a chunk cannot be decompressed"):
        read_run(tmp_path / "flip.mcap", strict=True)


def test_the_first_chunk_holds_the_channels_and_may_be_lost(whole, tmp_path, whole_run):
    data = bytearray(whole)
    first = min(at for at, _ in salvage(whole).messages)
    data[first + 200] ^= 1
    rows, _ = recovered(bytes(data), tmp_path / "flip.mcap", whole_run)
    assert rows == 80


def test_without_any_description_nothing_is_trusted(whole, tmp_path):
    data = bytearray(whole)
    begin = -1
    while (begin := whole.find(b"simulated-kinematic", begin + 1)) >= 0:
        data[begin] ^= 1
    path = tmp_path / "flip.mcap"
    path.write_bytes(data)
    with pytest.raises(DamagedLogError, match="where it comes from is not known"):
        read_run(path)


@pytest.mark.parametrize("tail", [b"\0" * 1000, b"\x06" * 1000, MAGIC])
def test_what_follows_the_end_is_reported(whole, tail, tmp_path, whole_run):
    rows, run = recovered(whole + tail, tmp_path / "tail.mcap", whole_run)
    assert rows == 100
    assert run.recovery.bytes_dropped == len(tail)


def test_a_chunk_that_claims_terabytes_is_refused_without_asking_for_them(whole, tmp_path):
    first = min(at for at, _ in salvage(whole).messages)
    data = bytearray(whole)
    data[first + 9 + 16 : first + 9 + 24] = (1 << 45).to_bytes(8, "little")
    assert salvage(bytes(data)).damages[0].what == "a chunk's size is damaged"


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (b"", EmptyLogError),
        (MAGIC, DamagedLogError),
        (MAGIC[:5], NotALogError),
        (b"\0" * 500, NotALogError),
        (b"t_s,x_m\n0,1\n", MissingChannelError),
        (np.random.default_rng(0).bytes(5000), NotALogError),
        (MAGIC + np.random.default_rng(0).bytes(5000), DamagedLogError),
    ],
)
def test_what_is_no_log_is_said_to_be_none(data, error, tmp_path):
    path = tmp_path / "some.mcap"
    path.write_bytes(data)
    with pytest.raises(error, match=r"^some\.mcap"):
        read_run(path)
