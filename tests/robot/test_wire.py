"""The Go1's datagrams: against a slow reading of the protocol, against the vendor's SDK, fuzzed."""

import socket
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.optional import Library
from cpl.robot import Envelope, Go1Base, Mode, within
from cpl.robot.interfaces import RobotError
from cpl.robot.wire import (
    COMMAND_BYTES,
    STATE_BYTES,
    HighCommand,
    HighState,
    WireError,
    checksum,
    decode_command,
    decode_state,
    encode_command,
    encode_state,
    toward_zero,
)

WALK = HighCommand(mode=Mode.WALK, velocity=(0.5, -0.25, 1.0))
STATE = HighState(mode=2, battery=77, velocity=(0.5, 0.25, -0.5), odometry=(1.0, 2.0, 0.5))


def slow_checksum(data):
    """Bit by bit, as the protocol says: polynomial 0x04c11db7, words, highest bit first."""
    crc = 0xFFFFFFFF
    for (word,) in struct.iter_unpack("<I", data):
        for bit in range(31, -1, -1):
            carry = crc >> 31
            crc = (crc << 1) & 0xFFFFFFFF
            crc ^= 0x04C11DB7 * carry
            crc ^= 0x04C11DB7 * ((word >> bit) & 1)
    return crc


@given(st.binary(min_size=4, max_size=64).map(lambda data: data[: len(data) // 4 * 4]))
def test_the_checksum_is_the_slow_one(data):
    assert checksum(data) == slow_checksum(data)


def test_the_layout_is_that_of_the_facts():
    command, state = encode_command(WALK), encode_state(STATE)
    assert (len(command), len(state)) == (COMMAND_BYTES, STATE_BYTES) == (129, 1087)
    assert command[:3] == b"\xfe\xef\xee"
    assert state[:3] == b"\xfe\xef\x00"
    assert struct.unpack_from("<I", command, 125)[0] == slow_checksum(command[: 4 * 31])
    assert struct.unpack_from("<I", state, 1083)[0] == slow_checksum(state[: 4 * 270])
    assert state[885] == 2
    assert struct.unpack_from("<2f", state, 895) == (1.0, 2.0)
    assert struct.unpack_from("<2f", state, 911) == (0.5, 0.25)


@given(st.floats(allow_nan=False, allow_infinity=False, width=64))
def test_rounding_never_speeds_up(value):
    with np.errstate(over="ignore"):
        rounded = toward_zero(value)
    assert abs(rounded) <= abs(value)
    assert np.float32(rounded) == rounded


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda d: d[:-1], "length"),
        (lambda d: d + b"\0", "length"),
        (lambda d: b"\xfe\xee" + d[2:], "head"),
        (lambda d: d[:2] + b"\x12" + d[3:], "level"),
        (lambda d: d[:60] + bytes([d[60] ^ 1]) + d[61:], "checksum"),
    ],
)
def test_what_is_wrong_has_a_name(change, kind):
    for data, decode in (
        (encode_command(WALK), decode_command),
        (encode_state(STATE), decode_state),
    ):
        with pytest.raises(WireError) as refused:
            decode(change(data))
        assert refused.value.kind == kind


def test_numbers_that_are_none_are_refused():
    data = bytearray(encode_command(WALK))
    struct.pack_into("<f", data, 53, float("nan"))
    struct.pack_into("<I", data, 125, checksum(bytes(data[:124])))
    with pytest.raises(WireError, match="not finite"):
        decode_command(bytes(data))
    with pytest.raises(ValueError, match="velocity must be finite"):
        encode_command(HighCommand(mode=2, velocity=(float("inf"), 0.0, 0.0)))


def fuzzed(valid, count, seed):
    """Random bytes, damaged copies, cut and lengthened copies."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        if k % 3 == 0:
            yield rng.bytes(int(rng.integers(0, 1500)))
        elif k % 3 == 1:
            data = bytearray(valid)
            for at in rng.integers(len(valid), size=int(rng.integers(1, 9))):
                data[at] ^= int(rng.integers(1, 256))
            yield bytes(data)
        else:
            yield (valid + rng.bytes(40))[: int(rng.integers(0, len(valid) + 40))]


@pytest.mark.parametrize(("make", "decode"), [
    (lambda: encode_command(WALK), decode_command),
    (lambda: encode_state(STATE), decode_state),
])  # fmt: skip
def test_two_thousand_fuzzed_datagrams_are_refused_by_name_or_read(make, decode):
    valid, kinds = make(), []
    for data in fuzzed(valid, 2000, seed=1):
        try:
            decode(data)
            kinds.append("read")
        except WireError as error:
            kinds.append(error.kind)
    assert set(kinds) <= {"read", "length", "head", "level", "checksum", "number"}
    # Byte 124 of a command is under no checksum, and a cut copy can be a whole one.
    assert kinds.count("read") < 20


@pytest.fixture
def peer():
    """A socket in the robot's place."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(2)
        yield made


def test_a_command_arrives_as_it_was_meant(library, peer):
    base = Go1Base(peer.getsockname(), library=library)
    base.send(Mode.WALK, (0.5, -0.25, 1.0))
    data, sender = peer.recvfrom(4096)
    assert decode_command(data) == WALK
    assert data == encode_command(WALK)  # byte by byte, from the vendor's library too
    peer.sendto(encode_state(STATE), sender)
    state = base.state()
    assert (state.mode, state.battery, state.velocity) == (2, 77, STATE.velocity)
    assert (state.odometry, state.version) == (STATE.odometry, (0, 0))
    base.close()


def test_no_command_leaves_outside_the_envelope(library, peer):
    base = Go1Base(peer.getsockname(), library=library, envelope=Envelope(v_max_mps=0.7))
    wanted = [(9.0, 9.0, 9.0), (0.7, 0.1, -2.1), (float("nan"), 0, 0), (1e308, 1e308, -1e308)]
    for each in wanted:
        base.send(Mode.WALK, each)
        velocity = decode_command(peer.recv(4096)).velocity
        assert within(velocity, Envelope(v_max_mps=0.7))
    base.send(Mode.STAND, (1.0, 1.0, 1.0))
    assert decode_command(peer.recv(4096)).velocity == (0.0, 0.0, 0.0)
    base.close()


def test_fuzzed_answers_neither_crash_nor_become_a_state(library, peer):
    base = Go1Base(peer.getsockname(), library=library)
    base.send(Mode.STAND)
    _, sender = peer.recvfrom(4096)
    valid = encode_state(STATE)
    for data in fuzzed(valid, 400, seed=2):
        if len(data) <= STATE_BYTES and data[: len(valid)] != valid:
            peer.sendto(data, sender)
            assert base.state() is None
    for _ in range(500):  # the vendor's Recv takes one datagram a call and stops at a wrong head
        base.state()
    peer.sendto(valid, sender)
    assert base.state().battery == 77
    assert base.refused > 0
    base.close()


def test_nobody_there_is_no_crash(library):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(("127.0.0.1", 0))
        address = gone.getsockname()
    base = Go1Base(address, library=library)
    for _ in range(5):
        base.send(Mode.STAND)
        assert base.state() is None
    base.close()
    base.close()


def test_a_library_that_is_not_there_is_named(monkeypatch):
    absent = Library("unitree_legged_sdk", "absent")
    monkeypatch.setattr("cpl.robot.go1.look", lambda name: absent)
    with pytest.raises(RobotError, match=r"unitree-legged-sdk is not installed.*\.\[go1\]"):
        Go1Base(("127.0.0.1", 1), library="sdk")
    base = Go1Base(("127.0.0.1", 1), library="auto")
    assert base.library == "cpl.robot.wire"
    base.close()
    with pytest.raises(ValueError, match="library must be one of auto, sdk, wire, not 'usb'"):
        Go1Base(("127.0.0.1", 1), library="usb")
