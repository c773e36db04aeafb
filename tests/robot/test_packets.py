"""Packets between processes, and the camera's: damaged ones are refused, late ones dropped."""

import socket
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.robot import Mode, Mount, T265Localizer
from cpl.robot.bridge import CameraPacketError, Pose, Stamp, Warned, decode
from cpl.robot.bridge import encode as encode_camera
from cpl.robot.interfaces import RobotError
from cpl.robot.packets import Order, PacketError, Report, decode_order, decode_report, encode
from cpl.robot.ports import address, is_loopback, receiver
from cpl.robot.t265 import camera_pose

POSE = Pose(
    5, 1.25, (0.1, 0.2, -0.3), (0.0, 0.0, 0.0, 1.0), (0.4, 0.0, 0.0), (0.0, 0.5, 0.0), 3
)  # fmt: skip
KEY, OTHER = bytes(range(32)), bytes(32)
STAMP = Stamp(11, 1, 2.5)
ORDER = Order(
    run=7, hello=8, number=3, heard_s=1.5, mode=Mode.WALK, command=(0.5, -0.1, 0.2)
)  # fmt: skip
REPORT = Report(
    run=7, hello=8, number=9, sent_s=2.5, obeyed=3, pid=77, mode=2, battery=80, unsent=1,
    velocity=(0.4, 0.0, 0.1), odometry=(1.0, 2.0, 0.3), version=(3, 8), age_s=0.002, refused=4,
    tripped="told to end", library="unitree-legged-sdk 3.8.20231105",
)  # fmt: skip
WARNED = Warned(6, 1.3, 2)
ALL = [
    (encode(ORDER, KEY), decode_order, ORDER, PacketError),
    (encode(REPORT, KEY), decode_report, REPORT, PacketError),
    (encode_camera(POSE, STAMP, KEY), decode, (POSE, STAMP), CameraPacketError),
    (encode_camera(WARNED, STAMP, KEY), decode, (WARNED, STAMP), CameraPacketError),
]


@pytest.mark.parametrize(("data", "read", "meant", "error"), ALL)
def test_a_packet_comes_back(data, read, meant, error):
    del error
    assert read(data, KEY) == meant


@pytest.mark.parametrize(("data", "read", "meant", "error"), ALL)
def test_a_packet_of_another_key_is_refused_and_none_passes_for_another_kind(
    data, read, meant, error
):
    del meant
    with pytest.raises(error, match="without the seal of this run"):
        read(data, OTHER)
    for _, other, _, other_error in ALL:
        if other is not read:
            with pytest.raises(other_error, match="without the seal of this run"):
                other(data, KEY)


@pytest.mark.parametrize(("data", "read", "meant", "error"), ALL)
def test_a_thousand_damaged_packets_are_refused(data, read, meant, error):
    del meant
    rng = np.random.default_rng(3)
    for k in range(1000):
        bad = bytearray(data)
        bad[int(rng.integers(len(bad)))] ^= int(rng.integers(1, 256))
        junk = bytes(bad) if k % 2 else rng.bytes(int(rng.integers(0, 300)))
        with pytest.raises(error):
            read(junk, KEY)


@pytest.mark.parametrize("changes", [
    {"position": (float("nan"), 0.0, 0.0)},
    {"quaternion": (0.0, 0.0, 0.0, 0.0)},
    {"velocity": (float("inf"), 0.0, 0.0)},
    {"confidence": 7},
    {"t_s": float("nan")},
])  # fmt: skip
def test_a_pose_that_cannot_be_is_refused(changes):
    with pytest.raises(CameraPacketError, match="cannot be"):
        decode(encode_camera(Pose(**{**POSE.__dict__, **changes}), STAMP, KEY), KEY)


def test_an_order_for_another_mode_or_without_numbers_is_refused():
    for changes in ({"mode": Mode.DOWN}, {"command": (float("nan"), 0.0, 0.0)}):
        with pytest.raises(PacketError, match="an order for mode"):
            decode_order(encode(Order(**{**ORDER.__dict__, **changes}), KEY), KEY)


class Camera:
    """A localizer, and a bridge that speaks to it; time is told by hand."""

    def __init__(self):
        self.now = 0.0
        self.localizer = T265Localizer(clock=lambda: self.now)
        self.feed = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.start, self.run = 1, 1

    def send(self, packet, at=None, key=None):
        self.now = self.now if at is None else at
        stamp = Stamp(self.run, self.start, self.now)
        data = encode_camera(packet, stamp, key or self.localizer.key)
        self.feed.sendto(data, self.localizer.address)
        return data

    def close(self):
        self.localizer.close()
        self.feed.close()


@pytest.fixture
def camera():
    made = Camera()
    yield made
    made.close()


def body_pose(number, x, y, yaw, twist=(0.0, 0.0, 0.0), t_s=0.0):
    turn = (0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    return camera_pose(number, t_s, (x, y, 0.35), turn, twist, 3, Mount())


angles, places = st.floats(-3, 3), st.floats(-3, 3)


@given(places, places, angles, places, places, angles, st.floats(-1, 1))
def test_axes_mount_and_anchor_are_taken_off_again(x, y, yaw, x0, y0, yaw0, speed):
    camera = Camera()
    camera.send(body_pose(1, 0.0, 0.0, 0.0))
    camera.localizer.anchor((x0, y0, yaw0))
    camera.send(body_pose(2, x, y, yaw, (speed, 0.1, 0.3)))
    fix = camera.localizer.fix()
    camera.close()
    c, s = np.cos(yaw0), np.sin(yaw0)
    assert fix.position[:2] == pytest.approx((x0 + c * x - s * y, y0 + s * x + c * y), abs=1e-9)
    assert fix.position[2] == pytest.approx(0.35)
    _, _, q_z, q_w = fix.quaternion
    turned = 2 * np.arctan2(q_z, q_w) - (yaw + yaw0)
    assert abs((turned + pi) % (2 * pi) - pi) < 1e-9
    assert fix.twist == pytest.approx((speed, 0.1, 0.3))


def test_the_cameras_own_axes():
    """Forward is -z, left is -x, up is y: a camera that moves along its -z moves ahead."""
    ahead = camera_pose(
        1, 0.0, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), (0.5, 0.0, 0.2), 3, Mount(forward_m=0.0)
    )
    assert ahead.position == (-2.0, 3.0, -1.0)
    assert ahead.velocity == pytest.approx((0.0, 0.0, -0.5))
    assert ahead.angular_velocity == pytest.approx((0.0, 0.2, 0.0))


def test_a_slam_error_is_told_once(camera):
    camera.send(body_pose(1, 0.0, 0.0, 0.0))
    camera.send(Warned(2, 0.0, 1))
    camera.send(Warned(3, 0.0, 2))
    assert [camera.localizer.fix().slam_error for _ in range(2)] == [2, 0]


def test_a_frozen_pose_grows_old_though_packets_come(camera):
    camera.send(body_pose(1, 0.0, 0.0, 0.0, t_s=1.0), at=1.0)
    assert camera.localizer.fix().changed_s == 1.0
    camera.send(body_pose(2, 0.0, 0.0, 0.0, t_s=2.0), at=2.0)
    assert camera.localizer.fix().changed_s == 1.0
    camera.send(body_pose(3, 0.001, 0.0, 0.0, t_s=3.0), at=3.0)
    assert camera.localizer.fix().changed_s == pytest.approx(3.0, abs=1e-3)


def test_a_pose_that_waited_is_as_old_as_its_camera_says(camera):
    """Packets come as regularly as ever, a second late: their arrival says nothing."""
    for k in range(10):
        camera.send(body_pose(k + 1, 0.1 * k, 0.0, 0.0, t_s=100 + 0.1 * k), at=5 + 0.1 * k)
    for k in range(10):
        number, t_s = k + 11, 100.9 + 0.1 * k
        camera.send(body_pose(number, 0.1 * k, 0.0, 0.0, t_s=t_s), at=6.9 + 0.1 * k)
    fix = camera.localizer.fix()
    assert camera.now - fix.changed_s == pytest.approx(1.0, abs=2e-3)


def test_late_and_repeated_packets_are_dropped(camera):
    for number, x in ((5000, 1.0), (5001, 2.0), (5001, 9.0), (4999, 9.0), (1, 9.0)):
        camera.send(body_pose(number, x, 0.0, 0.0))
    assert camera.localizer.fix().position[0] == pytest.approx(2.0)
    assert camera.localizer.late == 3


def test_a_new_bridge_is_heard_before_a_run_and_is_a_fault_in_it(camera):
    camera.send(body_pose(5000, 1.0, 0.0, 0.0))
    camera.run = 2
    camera.send(body_pose(1, 3.0, 0.0, 0.0))
    assert camera.localizer.fix().position[0] == pytest.approx(3.0)
    camera.localizer.anchor((0.0, 0.0, 0.0))
    camera.send(body_pose(2, 3.1, 0.0, 0.0))
    assert camera.localizer.fix().fault == ""
    camera.start = 2
    camera.send(body_pose(3, 0.0, 0.0, 0.0))
    assert "its origin is another one" in camera.localizer.fix().fault
    assert camera.localizer.fix().position[0] == pytest.approx(0.1)
    camera.start = 1
    camera.send(body_pose(4, 3.2, 0.0, 0.0))
    assert "its origin is another one" in camera.localizer.fix().fault


def test_after_the_anchor_nobody_else_is_heard(camera):
    camera.send(body_pose(1, 0.0, 0.0, 0.0))
    camera.localizer.anchor((0.0, 0.0, 0.0))
    sent = camera.send(body_pose(2, 1.0, 0.0, 0.0))
    assert camera.localizer.fix().position[0] == pytest.approx(1.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.1", 0))
        for data in (sent, bytes(200)):
            stranger.sendto(data, camera.localizer.address)
    assert camera.localizer.fix().position[0] == pytest.approx(1.0)
    assert (camera.localizer.late, camera.localizer.refused) == (0, 0)


def test_a_packet_from_the_future_or_of_another_key_moves_nothing(camera):
    camera.send(body_pose(1, 0.0, 0.0, 0.0), at=1.0)
    camera.send(body_pose(2, 9.0, 0.0, 0.0), at=3.0)
    camera.now = 2.0
    camera.send(body_pose(3, 9.0, 0.0, 0.0), key=OTHER)
    assert camera.localizer.fix().position[0] == pytest.approx(0.0)
    assert camera.localizer.refused == 2


def test_noise_on_the_cameras_port_is_counted_and_nothing_else(camera):
    for junk in (b"", b"CPLT", bytes(500)):
        camera.feed.sendto(junk, camera.localizer.address)
    assert camera.localizer.fix() is None
    assert camera.localizer.refused == 3
    with pytest.raises(RobotError, match="is the bridge running"):
        camera.localizer.anchor((0.0, 0.0, 0.0))


def test_addresses_are_numbers_and_ports_are_free():
    assert address("127.0.0.1:80") == ("127.0.0.1", 80)
    for wrong in ("localhost:80", "127.0.0.1", "127.0.0.1:", "127.0.0.1:99999", "127.0.0.1:x"):
        with pytest.raises(ValueError, match=r"address must be like 127\.0\.0\.1:8082"):
            address(wrong)
    assert not is_loopback("10.0.0.1")
    taken = receiver()
    with pytest.raises(ValueError, match="port must be free"):
        receiver(taken.getsockname()[1])
    taken.close()
