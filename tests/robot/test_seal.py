"""A key is for those who have it: how it is kept, and what happens without it."""

import io
import os
import stat

import pytest

from cpl.robot.seal import (
    KEY_BYTES,
    SEAL_BYTES,
    SealError,
    key_of_file,
    key_of_stream,
    make_key_file,
    new_key,
    opened,
    sealed,
)


def test_a_seal_depends_on_every_bit_of_content_key_and_kind():
    key, said = new_key(), b"walk"
    data = sealed(said, key, b"order")
    assert len(data) == len(said) + SEAL_BYTES
    assert opened(data, key, b"order") == said
    for k in range(8 * len(data)):
        bad = bytearray(data)
        bad[k // 8] ^= 1 << k % 8
        with pytest.raises(SealError):
            opened(bytes(bad), key, b"order")
    for k in range(8 * KEY_BYTES):
        bad = bytearray(key)
        bad[k // 8] ^= 1 << k % 8
        with pytest.raises(SealError):
            opened(data, bytes(bad), b"order")
    with pytest.raises(SealError):
        opened(data, key, b"report")
    with pytest.raises(SealError):
        opened(b"", key, b"order")


def test_a_key_without_its_length_seals_nothing():
    with pytest.raises(ValueError, match="key must have 32 bytes, not 0"):
        sealed(b"walk", b"", b"order")


def test_keys_are_drawn():
    assert len({new_key() for _ in range(100)}) == 100


def test_a_key_file_is_for_its_owner_alone(tmp_path):
    path = tmp_path / "run.key"
    make_key_file(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert len(key_of_file(path)) == KEY_BYTES
    with pytest.raises(FileExistsError):
        make_key_file(path)
    path.chmod(0o640)
    with pytest.raises(ValueError, match=r"for you alone \(chmod 600 .*\), not mode 640"):
        key_of_file(path)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file away")
def test_a_key_file_of_somebody_else_is_refused(tmp_path):
    path = tmp_path / "run.key"
    make_key_file(path)
    os.chown(path, 65534, 65534)
    with pytest.raises(ValueError, match="must be a file of your own"):
        key_of_file(path)


def test_a_link_a_pipe_and_a_folder_are_no_key_files(tmp_path):
    path = tmp_path / "run.key"
    make_key_file(path)
    link, pipe = tmp_path / "link", tmp_path / "pipe"
    link.symlink_to(path)
    os.mkfifo(pipe, 0o600)
    with pytest.raises(OSError, match="symbolic links"):
        key_of_file(link)
    for wrong in (pipe, tmp_path):
        with pytest.raises((ValueError, OSError)):
            key_of_file(wrong)


@pytest.mark.parametrize("text", [b"", b"00", b"zz" * 32, b"00" * 31, b"00" * 33, b"\xff" * 64])
def test_what_is_no_key_is_refused_and_not_repeated(text):
    with pytest.raises(ValueError, match=r"a key must be a line of 64 hexadecimal digits$"):
        key_of_stream(io.BytesIO(text + b"\n"))
