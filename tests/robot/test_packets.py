"""Packets between processes, and the camera's: damaged ones are refused, late ones dropped."""

import socket
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.robot import Mode, Mount, T265Localizer
from cpl.robot.bridge import CameraPacketError, Pose, Warned, decode, encode_pose, encode_warning
from cpl.robot.interfaces import RobotError
from cpl.robot.packets import Order, PacketError, Report, decode_order, decode_report, encode
from cpl.robot.ports import address, is_loopback, receiver
from cpl.robot.t265 import camera_pose

POSE = Pose(
    5, 1.25, (0.1, 0.2, -0.3), (0.0, 0.0, 0.0, 1.0), (0.4, 0.0, 0.0), (0.0, 0.5, 0.0), 3
)  # fmt: skip
ORDER = Order(token=7, number=3, mode=Mode.WALK, command=(0.5, -0.1, 0.2))
REPORT = Report(
    token=7, number=9, obeyed=3, mode=2, battery=80, velocity=(0.4, 0.0, 0.1),
    odometry=(1.0, 2.0, 0.3), version=(3, 8), age_s=0.002, refused=4, tripped="told to end",
    library="unitree-legged-sdk 3.8.20231105",
)  # fmt: skip
ALL = [
    (encode(ORDER), decode_order, ORDER, PacketError),
    (encode(REPORT), decode_report, REPORT, PacketError),
    (encode_pose(POSE), decode, POSE, CameraPacketError),
    (encode_warning(Warned(6, 1.3, 2)), decode, Warned(6, 1.3, 2), CameraPacketError),
]


@pytest.mark.parametrize(("data", "read", "meant", "error"), ALL)
def test_a_packet_comes_back(data, read, meant, error):
    del error
    assert read(data) == meant


@pytest.mark.parametrize(("data", "read", "meant", "error"), ALL)
def test_a_thousand_damaged_packets_are_refused(data, read, meant, error):
    del meant
    rng = np.random.default_rng(3)
    for k in range(1000):
        bad = bytearray(data)
        bad[int(rng.integers(len(bad)))] ^= int(rng.integers(1, 256))
        junk = bytes(bad) if k % 2 else rng.bytes(int(rng.integers(0, 300)))
        with pytest.raises(error):
            read(junk)


@pytest.mark.parametrize("changes", [
    {"position": (float("nan"), 0.0, 0.0)},
    {"quaternion": (0.0, 0.0, 0.0, 0.0)},
    {"velocity": (float("inf"), 0.0, 0.0)},
    {"confidence": 7},
])  # fmt: skip
def test_a_pose_that_cannot_be_is_refused(changes):
    with pytest.raises(CameraPacketError, match="cannot be"):
        decode(encode_pose(Pose(**{**POSE.__dict__, **changes})))


def test_an_order_for_another_mode_or_without_numbers_is_refused():
    for changes in ({"mode": Mode.DOWN}, {"command": (float("nan"), 0.0, 0.0)}):
        with pytest.raises(PacketError, match="an order for mode"):
            decode_order(encode(Order(**{**ORDER.__dict__, **changes})))


@pytest.fixture
def camera():
    """A localizer, and a socket that speaks to it; time is told by hand."""
    now = [0.0]
    made = T265Localizer(clock=lambda: now[0])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as feed:

        def send(packet, at=0.0):
            now[0] = at
            data = encode_warning(packet) if isinstance(packet, Warned) else encode_pose(packet)
            feed.sendto(data, made.address)

        yield made, send, feed
    made.close()


def body_pose(number, x, y, yaw, twist=(0.0, 0.0, 0.0)):
    turn = (0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    return camera_pose(number, 0.0, (x, y, 0.35), turn, twist, 3, Mount())


angles, places = st.floats(-3, 3), st.floats(-3, 3)


@given(places, places, angles, places, places, angles, st.floats(-1, 1))
def test_axes_mount_and_anchor_are_taken_off_again(x, y, yaw, x0, y0, yaw0, speed):
    localizer = T265Localizer()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as feed:
        feed.sendto(encode_pose(body_pose(1, 0.0, 0.0, 0.0)), localizer.address)
        localizer.anchor((x0, y0, yaw0))
        feed.sendto(encode_pose(body_pose(2, x, y, yaw, (speed, 0.1, 0.3))), localizer.address)
        fix = localizer.fix()
    localizer.close()
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
    localizer, send, _ = camera
    send(body_pose(1, 0.0, 0.0, 0.0))
    send(Warned(2, 0.0, 1))
    send(Warned(3, 0.0, 2))
    assert [localizer.fix().slam_error for _ in range(2)] == [2, 0]


def test_a_frozen_pose_grows_old_though_packets_come(camera):
    localizer, send, _ = camera
    send(body_pose(1, 0.0, 0.0, 0.0), at=1.0)
    assert localizer.fix().changed_s == 1.0
    send(body_pose(2, 0.0, 0.0, 0.0), at=2.0)
    assert localizer.fix().changed_s == 1.0
    send(body_pose(3, 0.001, 0.0, 0.0), at=3.0)
    assert localizer.fix().changed_s == 3.0


def test_late_and_repeated_packets_are_dropped_and_a_new_bridge_is_heard(camera):
    localizer, send, _ = camera
    for number, x in ((5000, 1.0), (5001, 2.0), (5001, 9.0), (4999, 9.0)):
        send(body_pose(number, x, 0.0, 0.0))
    assert localizer.fix().position[0] == pytest.approx(2.0)
    assert localizer.late == 2
    send(body_pose(1, 3.0, 0.0, 0.0))
    assert localizer.fix().position[0] == pytest.approx(3.0)


def test_noise_on_the_cameras_port_is_counted_and_nothing_else(camera):
    localizer, _, feed = camera
    for junk in (b"", b"CPLT", bytes(500)):
        feed.sendto(junk, localizer.address)
    assert localizer.fix() is None
    assert localizer.refused == 3
    with pytest.raises(RobotError, match="is the bridge running"):
        localizer.anchor((0.0, 0.0, 0.0))


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
