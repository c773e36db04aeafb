"""All formats under the same laws: known by content, read whole and right, cut short and said."""

import math

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from cpl.cli import main
from cpl.logs import LogError, NotALogError, formats, read_run, save_run
from cpl.logs.formats import Head
from tests.logs.samples import SAMPLES, START_NS, bag2, kitti, t265, tum, walk

WALK = walk()
X = np.array([[p.x, p.y, p.z] for p in WALK])
YAW = np.array([p.yaw for p in WALK])


@pytest.fixture(params=SAMPLES)
def sample(request, tmp_path):
    """A file without an ending that could tell what it is, its format and the options it needs."""
    kind, make, options = SAMPLES[request.param]
    path = tmp_path / "recording"
    path.write_bytes(make(WALK))
    return path, kind, {"silent": "unstated", **options}


def test_it_is_known_by_its_content_alone(sample):
    path, kind, _ = sample
    head = Head(path, path.read_bytes()[: 64 << 10])
    liked = {each.name: each.recognise(head).score for each in formats()}
    assert max(liked, key=liked.get) == kind
    assert sorted(liked.values())[-2] < liked[kind]


def test_it_is_whole_and_right(sample):
    path, kind, options = sample
    run = read_run(path, strict=True, **options)
    assert run.recovery.whole
    assert np.abs(run.table[["x_m", "y_m", "z_m"]].to_numpy() - X).max() < 1e-8
    assert np.abs(run.table["yaw_rad"].to_numpy() - YAW).max() < 1e-8
    assert run.table["t_s"].to_numpy() == pytest.approx(0.05 * np.arange(60), abs=1e-6)
    assert run.info.start_unix_ns == (0 if kind == "kitti" else START_NS)
    assert run.recovery.plausibility.rate_hz == pytest.approx(20, rel=1e-3)
    assert run.recovery.plausibility.doubts == ()
    ros2 = path.read_bytes()[17:25] == b"\4\0\0\0ros2"
    moving = ros2 or kind in ("bag", "ros2", "rostopic")
    assert ("/odometry/twist" in run.topics) == moving


def test_the_command_opens_it(sample, capsys):
    path, _, options = sample
    words = ["--pose-rate", "20"] if "pose_rate_hz" in options else []
    assert main(["logs", "info", str(path), *words]) == 0
    said = capsys.readouterr().out
    assert "whole: 60 rows, 2.95 s" in said
    assert "plausible? 20 Hz, no gap; 0.5 m/s" in said


@pytest.mark.parametrize("share", [0.35, 0.7, 0.97])
def test_cut_short_it_is_never_called_whole(sample, share):
    path, kind, options = sample
    data = path.read_bytes()
    data = data[: int(share * len(data)) - 3]
    path.write_bytes(data)
    try:
        run = read_run(path, **options)
    except LogError:
        assert kind in ("cpl", "netcdf", "ros2", "bag", "mcap")  # a text keeps its first lines
        return
    assert not run.recovery.whole
    kept = run.table[["x_m", "y_m", "z_m"]].to_numpy()
    steps = np.round(run.table["t_s"] / 0.05).astype(int)
    assert np.abs(kept - X[steps]).max() < 1e-8


def test_it_is_converted_and_read_again(sample, tmp_path):
    path, _, options = sample
    run = read_run(path, **options)
    for ending in (".mcap", ".csv"):
        again = read_run(save_run(run, tmp_path / f"again{ending}"), strict=True)
        assert again.table.equals(run.table)
        assert again.info.start_unix_ns == run.info.start_unix_ns


def test_every_format_has_an_example_and_says_what_it_lacks(capsys):
    assert main(["logs", "formats"]) == 0
    said = capsys.readouterr().out
    for each in formats():
        assert f"{each.name}: {each.title}" in said
        assert each.example.splitlines()[0] in said
        assert each.lacks


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_split_bag_is_one_run(tmp_path, plugin):
    parts = [bag2(tmp_path / f"part{k}", WALK[20 * k : 20 * k + 20], plugin) for k in range(3)]
    whole = tmp_path / "whole"
    whole.mkdir()
    names = []
    for k, part in enumerate(parts):
        file = next(each for each in part.iterdir() if each.suffix in (".db3", ".mcap"))
        names.append(f"whole_{k}{file.suffix}")
        (whole / names[-1]).write_bytes(file.read_bytes())
    listed = "".join(f"    - {name}\n" for name in names)
    text = f"rosbag2_bagfile_information:\n  relative_file_paths:\n{listed}  message_count: 60\n"
    (whole / "metadata.yaml").write_text(text)
    run = read_run(whole, silent="unstated", strict=True)
    assert np.abs(run.table[["x_m", "y_m", "z_m"]].to_numpy() - X).max() < 1e-8
    (whole / names[1]).unlink()
    run = read_run(whole, silent="unstated")
    assert len(run.table) == 40
    assert any("is missing" in fault.what for fault in run.recovery.faults)
    assert any("counts 60 messages, 40 are there" in fault.what for fault in run.recovery.faults)


def test_kitti_asks_for_its_times(tmp_path):
    path, times = tmp_path / "00.txt", tmp_path / "times.txt"
    path.write_bytes(kitti(WALK))
    with pytest.raises(LogError, match="--times FILE"):
        read_run(path, silent="unstated")
    times.write_text("".join(f"{0.1 * k:.6e}\n" for k in range(60)))
    run = read_run(path, silent="unstated", times=times, strict=True)
    assert run.table["t_s"].iloc[-1] == pytest.approx(5.9)
    times.write_text("0\n1\n")
    with pytest.raises(LogError, match="has 60 poses"):
        read_run(path, silent="unstated", times=times)


def test_infinite_matrices_are_no_warning(tmp_path):
    path = tmp_path / "00.txt"
    path.write_bytes(kitti(WALK).replace(b"1.0000", b"inf ", 1).replace(b"0.0000", b"1e200", 1))
    with pytest.raises(LogError):
        read_run(path, silent="unstated")


def test_a_t265_export_without_times_has_its_rate(tmp_path):
    path = tmp_path / "a.csv"
    lines = t265(WALK).decode().splitlines()
    path.write_text("\n".join(line.partition(",")[2] for line in lines) + "\n")
    run = read_run(path, silent="unstated", strict=True)
    assert run.recovery.plausibility.rate_hz == pytest.approx(200)
    assert any("times derived" in note for note in run.recovery.notes)
    assert (run.table["confidence"] == 3).all()


def test_w_first_is_doubted_and_can_be_said(tmp_path):
    path = tmp_path / "a.txt"
    poses = walk(400)
    lines = [line.split() for line in tum(poses).decode().splitlines()[1:]]
    path.write_text("".join(f"{' '.join([*c[:4], c[7], *c[4:7]])}\n" for c in lines))
    doubted = read_run(path, silent="unstated").recovery.plausibility.doubts
    assert any("--quaternion wxyz" in doubt for doubt in doubted)
    run = read_run(path, silent="unstated", quaternion="wxyz")
    assert run.recovery.plausibility.doubts == ()
    assert run.table["yaw_rad"].iloc[-1] == pytest.approx(poses[-1].yaw - 2 * math.pi, abs=1e-6)


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "mm"), (100.0, "cm")])
@pytest.mark.parametrize("seconds", [1, 20])
def test_a_wrong_unit_is_named_and_can_be_said(tmp_path, factor, unit, seconds):
    path = tmp_path / "a.txt"
    poses = walk(int(seconds * 20) + 1)
    path.write_text("".join(
        f"{p.stamp_ns / 1e9:.6f} {factor * p.x} {factor * p.y} {factor * p.z} {p.q[0]} {p.q[1]} "
        f"{p.q[2]} {p.q[3]}\n" for p in poses))  # fmt: skip
    try:
        doubts = read_run(path, silent="unstated").recovery.plausibility.doubts
    except LogError as error:
        doubts = (str(error),)
    assert any("--unit" in doubt for doubt in doubts)
    run = read_run(path, silent="unstated", unit=unit)
    assert run.recovery.plausibility.speed_mps == pytest.approx(0.5, rel=0.01)


def test_a_relocalisation_is_noted_with_size_and_time(tmp_path):
    path = tmp_path / "a.txt"
    poses = walk(100)
    path.write_text("".join(
        f"{p.stamp_ns / 1e9:.6f} {p.x + 1.5 * (k > 50)} {p.y} {p.z} 0 0 {p.q[2]} {p.q[3]}\n"
        for k, p in enumerate(poses)))  # fmt: skip
    run = read_run(path, silent="unstated", strict=True)
    ((t_s, size_m),) = run.recovery.plausibility.jumps
    assert t_s == pytest.approx(2.55)
    assert size_m == pytest.approx(1.5, abs=0.05)
    assert "1 jump (1.5" in str(run.recovery.plausibility)


def test_the_name_of_a_format_may_be_said_and_must_be_one(tmp_path):
    path = tmp_path / "a"
    path.write_text("1 2 3 4 5 6 7 8\n" * 3)
    with pytest.raises(NotALogError, match=r"nearest is tum: .* no unit quaternion"):
        read_run(path)
    with pytest.raises(LogError, match="has length"):
        read_run(path, silent="unstated", format="tum")
    with pytest.raises(ValueError, match="format must be one of bag, cpl, csv"):
        read_run(path, format="rosbag")
    assert main(["logs", "check", str(path), "--format", "rosbag"]) == 2
