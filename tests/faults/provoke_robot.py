"""What somebody may send to a watchdog, a localizer or a driver: datagrams that know the format.

A packet is taken apart and put together wrong: a field at its extremes, cut, lengthened, repeated,
sealed with another key or for another purpose, of another run, too old, from the future. It is
`refused` if it changes nothing that is asked of the robot, `harmless` if whoever has the key sent
it and what is asked for stays inside the envelope. Anything else is `silent`.
"""

import socket
import struct
from collections.abc import Iterator
from dataclasses import replace

from cpl.rng import stream
from cpl.robot import Envelope, Mode, within
from cpl.robot.bridge import Pose, Stamp
from cpl.robot.bridge import encode as encode_camera
from cpl.robot.interfaces import BaseState
from cpl.robot.packets import Order, encode
from cpl.robot.ports import receiver
from cpl.robot.seal import SEAL_BYTES, new_key, sealed
from cpl.robot.t265 import T265Localizer
from cpl.robot.watchdog import Watchdog
from cpl.robot.wire import HighState, WireError, decode_state, encode_state
from tests.faults.frame import Row, tally

ZERO = (0.0, 0.0, 0.0)
EXTREMES = (0.0, -0.0, 1e-300, 1e300, -1e300, float("inf"), float("-inf"), float("nan"), 2.0, -7.5)
MOST = 1400  # [byte]


def provoke(count: int) -> Iterator[Row]:
    """Send 60 packets for each of `count`: 12,000 by default."""
    for name, made in ORDERS.items():
        yield tally("watchdog", name, _orders(name, made, 4 * count))
    yield tally("watchdog", "hostile content, right key", _insane(4 * count))
    for name, made in POSES.items():
        yield tally("localizer", name, _poses(name, made, 4 * count))
    yield tally("driver of the robot", "a state changed anywhere", _states(8 * count))


class Robot:
    """A base that answers, and remembers what it was asked for."""

    library, refused, unsent = "fuzz", 0, 0

    def __init__(self, clock):
        self.asked, self._clock = [], clock

    def send(self, mode, command=ZERO):
        self.asked.append((mode, command))

    def state(self):
        return BaseState(mode=1, battery=80, velocity=ZERO, odometry=ZERO, version=(1, 1),
                         received_s=self._clock())  # fmt: skip


class Target:
    """A watchdog that one policy speaks to, and that stands."""

    def __init__(self):
        self.now, self.key, self.number = 100.0, new_key(), 1
        self.robot, self.here = Robot(lambda: self.now), receiver()
        self.dog = Watchdog(self.robot, self.here, self.key, clock=lambda: self.now)
        self.policy = receiver()
        self.to = self.here.getsockname()
        self.policy.sendto(encode(self.order(mode=Mode.STAND), self.key), self.to)
        self.dog.step()
        assert self.dog.lease.mode is Mode.STAND
        self.stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def order(self, **changes):
        self.number += 1
        good = Order(run=self.dog._run, hello=9, number=self.number, heard_s=self.now,
                     mode=Mode.WALK, command=(0.5, 0.0, 0.0))  # fmt: skip
        return replace(good, **changes)

    def close(self):
        for each in (self.here, self.policy, self.stranger):
            each.close()


def _cut(rng, target):
    data = encode(target.order(), target.key)
    return data[: int(rng.integers(len(data)))]


def _long(rng, target):
    return encode(target.order(), target.key) + rng.bytes(int(rng.integers(1, MOST)))


def _flipped(rng, target):
    data = bytearray(encode(target.order(), target.key))
    bit = int(rng.integers(8 * len(data)))
    data[bit // 8] ^= 1 << bit % 8
    return bytes(data)


def _field(rng, target):
    """A field is overwritten, and the seal is a stranger's."""
    data = bytearray(encode(target.order(), target.key)[:-SEAL_BYTES])
    at, value = int(rng.integers(4, len(data) - 8)), EXTREMES[int(rng.integers(len(EXTREMES)))]
    struct.pack_into("<d", data, at, value)
    return sealed(bytes(data), new_key(), b"order")


def _purpose(rng, target):
    data = encode(target.order(), target.key)[:-SEAL_BYTES]
    return sealed(data, target.key, (b"report", b"camera", b"")[int(rng.integers(3))])


def _run(rng, target):
    return encode(target.order(run=int(rng.integers(1, 2**62))), target.key)


def _old(rng, target):
    return encode(target.order(heard_s=target.now - float(rng.uniform(0.2, 1e6))), target.key)


def _future(rng, target):
    return encode(target.order(heard_s=target.now + float(rng.uniform(1e-3, 1e6))), target.key)


def _again(rng, target):
    return encode(target.order(number=int(rng.integers(0, 3))), target.key)


def _noise(rng, target):
    del target
    return rng.bytes(int(rng.integers(0, MOST)))


ORDERS = {
    "cut short": _cut,
    "lengthened": _long,
    "one bit flipped": _flipped,
    "a field at its extremes, another key": _field,
    "sealed for another purpose": _purpose,
    "of another run": _run,
    "too old": _old,
    "from the future": _future,
    "repeated": _again,
    "noise": _noise,
}


def _orders(name, made, count):
    """Half come from the policy's own port, where nothing filters them but what is in them."""
    rng, target = stream(count, "faults", "orders", name), Target()
    for k in range(count):
        before, asked = target.dog.lease, len(target.robot.asked)
        data = made(rng, target)
        (target.policy if k % 2 else target.stranger).sendto(data, target.to)
        target.dog.step()
        moved = [each for each in target.robot.asked[asked:] if each[1] != ZERO]
        yield "silent" if moved or target.dog.lease != before else "refused"
    target.close()


def _insane(count):
    """The policy itself is mad: whatever it orders stays inside the envelope."""
    rng, target = stream(count, "faults", "insane"), Target()
    for _ in range(count):
        command = tuple(EXTREMES[int(k)] for k in rng.integers(len(EXTREMES), size=3))
        asked = len(target.robot.asked)
        order = target.order(command=command)
        target.policy.sendto(encode(order, target.key), target.to)
        target.dog.step()
        sent = [each[1] for each in target.robot.asked[asked:]]
        inside = all(within(each, Envelope()) for each in sent)
        yield "silent" if not inside else "harmless" if any(map(any, sent)) else "refused"
        target.now += 0.01
    target.close()


class Eyes:
    """A localizer that counts from an origin, and its bridge."""

    def __init__(self):
        self.now, self.number = 50.0, 0
        self.localizer = T265Localizer(clock=lambda: self.now)
        self.bridge, self.stranger = receiver(), receiver()
        self.say(self.data())
        self.localizer.anchor(ZERO)

    def data(self, key=None, start=1, ahead_s=0.0, **changes):
        self.number += 1
        pose = Pose(self.number, self.now, (0.0, 0.35, 0.0), (0.0, 0.0, 0.0, 1.0),
                    ZERO, ZERO, 3)  # fmt: skip
        stamp = Stamp(5, start, self.now + ahead_s)
        return encode_camera(replace(pose, **changes), stamp, key or self.localizer.key)

    def say(self, data, sender=None):
        (sender or self.bridge).sendto(data, self.localizer.address)

    def close(self):
        self.localizer.close()
        self.bridge.close()
        self.stranger.close()


POSES = {
    "cut short": lambda rng, eyes: eyes.data()[: int(rng.integers(60))],
    "lengthened": lambda rng, eyes: eyes.data() + rng.bytes(int(rng.integers(1, MOST))),
    "one byte changed": lambda rng, eyes: _changed(rng, eyes.data()),
    "another key": lambda rng, eyes: eyes.data(key=new_key(), position=(9.0, 0.35, 9.0)),
    "numbers that cannot be": lambda rng, eyes: eyes.data(
        position=(float(EXTREMES[3 + int(rng.integers(5))]), 0.35, 0.0)
    ),
    "repeated": lambda rng, eyes: eyes.data(number=1, position=(9.0, 0.35, 9.0)),
    "from the future": lambda rng, eyes: eyes.data(
        ahead_s=float(rng.uniform(0.1, 1e6)), position=(9.0, 0.35, 9.0)
    ),
    "noise": lambda rng, eyes: rng.bytes(int(rng.integers(0, MOST))),
}


def _changed(rng, data):
    at = int(rng.integers(len(data)))
    return data[:at] + bytes([data[at] ^ int(rng.integers(1, 256))]) + data[at + 1 :]


def _poses(name, made, count):
    rng, eyes = stream(count, "faults", "poses", name), Eyes()
    for k in range(count):
        before = eyes.localizer.fix()
        eyes.say(made(rng, eyes), eyes.bridge if k % 2 else eyes.stranger)
        after = eyes.localizer.fix()
        same = after.position == before.position and after.changed_s == before.changed_s
        yield "refused" if same and not after.fault else "silent"
    eyes.close()


def _states(count):
    rng = stream(count, "faults", "states")
    good = encode_state(HighState(mode=2, battery=80, velocity=(0.5, 0.0, 0.1),
                                  odometry=(1.0, 2.0, 0.3)))  # fmt: skip
    for k in range(count):
        data = _changed(rng, good) if k % 3 else good[: int(rng.integers(len(good)))]
        try:
            decode_state(data)
        except WireError:
            yield "refused"
            continue
        yield "silent"
