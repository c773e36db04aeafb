"""ROS 2 bags that are packed by zstd: read like others, salvaged like others, within a budget."""

import sqlite3
import tempfile

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from cpl.logs import DamagedLogError, NotALogError, read_run, read_runs
from cpl.logs.budget import LARGEST_MESSAGE, Budget
from cpl.logs.packed import unpacked_message
from cpl.logs.source import CannotUnpackError
from tests.logs.samples import bag2, db3, mcap_ros2, tum, walk
from tests.logs.test_cases import LIMIT_MB, limited

WALK = walk()
X = np.array([[p.x, p.y, p.z] for p in WALK])
MODES = [CompressionMode.FILE, CompressionMode.MESSAGE]


@pytest.fixture(autouse=True)
def scratch(tmp_path_factory, monkeypatch):
    """What is unpacked is gone, whatever came of it."""
    folder = tmp_path_factory.mktemp("scratch")
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert not list(folder.glob("cpl-bag-*"))


def positions(run):
    return run.table[["x_m", "y_m", "z_m"]].to_numpy()


def pack(data, **options):
    return zstandard.ZstdCompressor().compress(data, **options)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_packed_bag_is_whole_and_the_same(tmp_path, plugin, mode):
    plain = read_run(bag2(tmp_path / "plain", WALK, plugin), silent="unstated", strict=True)
    folder = bag2(tmp_path / "packed", WALK, plugin, mode)
    run = read_run(folder, silent="unstated", strict=True)
    assert run.recovery.whole
    assert run.table.equals(plain.table)


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_packed_and_split_bag_is_one_run(tmp_path, plugin):
    names = []
    whole = tmp_path / "whole"
    whole.mkdir()
    for k in range(3):
        part = WALK[20 * k : 20 * k + 20]
        folder = bag2(tmp_path / f"p{k}", part, plugin, CompressionMode.FILE)
        file = next(folder.glob("p?.*"))
        names.append(file.name)
        file.rename(whole / file.name)
    text = "".join(f"    - {name}\n" for name in names)
    meta = f"a:\n  relative_file_paths:\n{text}  compression_format: zstd\n  message_count: 60\n"
    (whole / "metadata.yaml").write_text(meta)
    assert np.abs(positions(read_run(whole, silent="unstated", strict=True)) - X).max() < 1e-8
    middle = whole / names[1]
    middle.write_bytes(middle.read_bytes()[:-300])
    run = read_run(whole, silent="unstated")
    assert not run.recovery.whole
    assert len(run.table) >= 40
    assert any(names[1] in fault.what for fault in run.recovery.faults)


def test_a_bag_unpacked_by_hand_is_still_the_one_that_is_described(tmp_path):
    folder = bag2(tmp_path / "a", WALK, mode=CompressionMode.FILE)
    file = folder / "a.db3.zstd"
    (folder / "a.db3").write_bytes(
        zstandard.ZstdDecompressor().decompress(file.read_bytes(), 1 << 20)
    )
    file.unlink()
    assert read_run(folder, silent="unstated", strict=True).recovery.whole


def test_packed_files_in_a_folder_are_found(tmp_path):
    (tmp_path / "a.db3.zst").write_bytes(pack(db3(WALK)))
    (tmp_path / "b.txt.zst").write_bytes(pack(tum(WALK)))
    runs = read_runs(tmp_path)
    assert list(runs.runs) == ["a.db3.zst"]
    assert "unzstd FILE" in str(runs.refused["b.txt.zst"])


def _bad_first(folder, data):
    link = sqlite3.connect(folder / "a.db3")
    link.execute("UPDATE messages SET data = ? WHERE id = 7", (data,))
    link.commit()
    link.close()


NO_MESSAGE = pack(b"\1" * 200)


@pytest.mark.parametrize(
    "bad",
    [
        pack(bytes(200))[:-4],
        pack(bytes(200)) + b"more",
        pack(bytes(LARGEST_MESSAGE + 1)),
        NO_MESSAGE,
        b"\x28\xb5\x2f\xfd",
    ],
    ids=["cut", "followed", "too large", "no message", "no frame"],
)
def test_one_bad_message_costs_one(tmp_path, bad):
    folder = bag2(tmp_path / "a", WALK, mode=CompressionMode.MESSAGE)
    _bad_first(folder, bad)
    run = read_run(folder, silent="unstated")
    assert not run.recovery.whole
    assert run.recovery.rows_dropped == 1
    assert "packed" in run.recovery.faults[0].what or bad == NO_MESSAGE
    assert np.abs(positions(run) - np.delete(X, 6, axis=0)).max() < 1e-8


def test_a_message_of_unknown_size_is_bounded_too():
    small = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(999))
    assert unpacked_message(small, Budget(size=1)) == bytes(999)
    large = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(64 << 20))
    with pytest.raises(CannotUnpackError):
        unpacked_message(large, Budget(size=1))


def test_messages_that_unpack_to_too_much_end_the_reading(tmp_path):
    folder = bag2(tmp_path / "a", WALK, mode=CompressionMode.MESSAGE)
    link = sqlite3.connect(folder / "a.db3")
    link.execute("UPDATE messages SET data = ? WHERE id > 20", (pack(bytes(LARGEST_MESSAGE)),))
    link.commit()
    link.close()
    run = read_run(folder, silent="unstated")
    assert len(run.table) == 20
    assert any("unpacks to more than" in fault.what for fault in run.recovery.faults)


def test_another_compression_is_named(tmp_path):
    folder = bag2(tmp_path / "a", WALK, mode=CompressionMode.MESSAGE)
    there = folder / "metadata.yaml"
    there.write_text(there.read_text().replace("zstd", "lz4"))
    with pytest.raises(NotALogError, match="compressed by lz4"):
        read_run(folder, silent="unstated")


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9, 0.9999])
def test_a_packed_file_cut_short_keeps_what_came_before(tmp_path, share):
    path = tmp_path / "a.mcap.zstd"
    data = pack(mcap_ros2(walk(4000), compression=CompressionType.NONE))
    path.write_bytes(data[: max(5, int(share * len(data)))])
    if share == 0:
        with pytest.raises(NotALogError, match="unzstd FILE"):
            read_run(path, silent="unstated")
        return
    run = read_run(path, silent="unstated")
    assert not run.recovery.whole
    assert 4000 > len(run.table) > 4000 * share / 2
    assert any("within what is compressed" in fault.what for fault in run.recovery.faults)


def test_a_packed_file_whose_checksum_is_cut_or_wrong_is_not_whole(tmp_path):
    path = tmp_path / "a.db3.zstd"
    data = zstandard.ZstdCompressor(write_checksum=True).compress(db3(WALK))
    for spoiled in (data[:-1], data + b"more"):
        path.write_bytes(spoiled)
        run = read_run(path, silent="unstated")
        assert not run.recovery.whole
        assert np.abs(positions(run) - X).max() < 1e-8
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(DamagedLogError, match="cannot be decompressed"):
        read_run(path, silent="unstated")


def test_an_error_names_the_packed_file(tmp_path):
    path = tmp_path / "a.db3.zstd"
    path.write_bytes(pack(b"SQLite format 3\0" + bytes(5000)))
    with pytest.raises(DamagedLogError, match=r"^a\.db3\.zstd: ") as caught:
        read_run(path, silent="unstated")
    assert caught.value.path == path


@pytest.mark.parametrize("declared", [True, False])
def test_a_bomb_is_refused_within_the_memory(tmp_path, declared):
    path = tmp_path / "a.db3.zstd"
    packer = zstandard.ZstdCompressor(write_content_size=declared, level=19)
    frame = packer.compress(b"SQLite format 3\0" + bytes(512 << 20))
    path.write_bytes(frame)
    status, took, said = limited(path)
    assert status in (1, 2), said
    assert "Traceback" not in said
    assert "unpacks to more than" in said
    assert took < LIMIT_MB, said
