"""Put a run's messages together to rows, in columns: a row of a log comes in a dozen messages."""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np
from mcap.records import Message
from numpy.typing import NDArray

from cpl.logs.budget import MOST_VALUES
from cpl.logs.clock import LAST_NS, NS
from cpl.logs.codec import MalformedError, decode
from cpl.logs.errors import (
    DuplicateChannelError,
    LogError,
    MissingChannelError,
    SchemaError,
    TimeOrderError,
)
from cpl.logs.schema import CHANNELS, FIELDS, Channel
from cpl.logs.sieve import QUATERNION, Sieve

__all__ = ["Assembly"]

BLOCK = 1 << 15  # rows that are offered at once
MOST_REASONS = 10_000  # of broken rows, that are kept in words
_BY_TOPIC = {each.topic: each for each in CHANNELS}
_Reason = tuple[type[LogError], str, str]


class Assembly:
    """Rows that grow with every message.

    Args:
        topics: The channels that the file says it has.
        sieve: Where the rows go, and the faults.

    Attributes:
        there: The topics of which there is a message.
        count: How many rows there are.
    """

    def __init__(self, topics: tuple[str, ...], sieve: Sieve) -> None:
        self.there: set[str] = set()
        self._sieve = sieve
        channels = [_BY_TOPIC[topic] for topic in topics]
        numeric = [f.column for c in channels for f in c.fields if f.kind != "text"]
        self._columns = {name: array("d") for name in numeric}
        self._texts = {f.column: dict[int, str]() for c in channels for f in c.fields
                       if f.kind == "text"}  # fmt: skip
        self._seen = {topic: array("q") for topic in topics}  # digest of the message; 0 for none
        self._slots: dict[int, int] = {}
        self._first, self._last = array("Q"), array("Q")
        self._broken = bytearray()
        self._reasons: dict[int, _Reason] = {}
        self._most = MOST_VALUES // (len(numeric) + len(topics) + 8)

    @property
    def count(self) -> int:
        """How many rows there are, sound or not."""
        return len(self._slots)

    def take(self, channel: Channel, message: Message, at: int) -> None:
        """Take a message.

        Args:
            channel: Its channel.
            message: The message.
            at: Where its chunk begins, for faults.
        """
        topic, number = channel.topic, message.sequence
        slot = self._slots.get(number)
        if slot is None:
            if len(self._slots) >= self._most:
                self._sieve.overflow(number)
                return
            slot = self._grown(number, message.log_time)
        self.there.add(topic)
        digest = hash((message.data, message.log_time)) or 1
        seen = self._seen.setdefault(topic, array("q", [0]) * len(self._slots))
        if seen[slot]:
            self._twice(channel, number, slot, seen[slot] == digest, at)
            return
        seen[slot] = digest
        self._first[slot] = min(self._first[slot], message.log_time)
        self._last[slot] = max(self._last[slot], message.log_time)
        try:
            values = decode(channel, message.data)
        except MalformedError as error:
            self._break(slot, error.error, f"row {number}, {topic}", str(error))
            return
        for name, value in values.items():
            if FIELDS[name].kind == "text":
                self._texts.setdefault(name, {})[number] = value
            else:
                column = self._columns.get(name)
                if column is None:
                    column = array("d", [math.nan]) * len(self._slots)
                    self._columns[name] = column
                column[slot] = value

    def offer(self, topics: tuple[str, ...]) -> None:
        """Offer the rows that have every channel to the sieve; name what is wrong with others.

        Args:
            topics: The channels that every row must have, unless they are sparse.
        """
        self._judge(topics)
        broken = np.frombuffer(self._broken, dtype=np.uint8)
        whole = np.flatnonzero(broken == 0)
        numbers = np.fromiter(self._slots, dtype=np.int64, count=len(self._slots))
        stamps = np.frombuffer(self._first, dtype=np.uint64)
        names = [
            field.column
            for topic in topics
            for field in _BY_TOPIC[topic].fields
            if field.kind != "text"
        ]
        if not set(QUATERNION) <= set(names):
            return
        for begin in range(0, len(whole), BLOCK):
            rows = whole[begin : begin + BLOCK]
            columns = {name: np.frombuffer(self._columns[name])[rows] for name in names}
            self._sieve.offer_block(
                numbers[rows], numbers[rows], stamps[rows].astype(np.int64), columns
            )
        for name, words in self._texts.items():
            self._sieve.texts[name] = {number: word for number, word in words.items() if word}

    def _judge(self, topics: tuple[str, ...]) -> None:
        """Find rows that lack a message, or whose messages do not belong together."""
        needed = [topic for topic in topics if not _BY_TOPIC[topic].sparse]
        digests: dict[str, Any] = {
            topic: np.frombuffer(self._seen[topic], dtype=np.int64) for topic in needed
        }
        numbers = list(self._slots)
        for topic in needed:
            lacking = np.flatnonzero((digests[topic] == 0) & self._sound())
            for slot in lacking.tolist():
                self._break(
                    slot, MissingChannelError, f"row {numbers[slot]}", f"has no message of {topic}"
                )
        first = np.frombuffer(self._first, dtype=np.uint64)
        last = np.frombuffer(self._last, dtype=np.uint64)
        for slot in np.flatnonzero((first != last) & self._sound()).tolist():
            spread = (int(last[slot]) - int(first[slot])) / NS
            what = f"its messages are up to {spread} s apart"
            self._break(slot, TimeOrderError, f"row {numbers[slot]}", what)
        for slot in np.flatnonzero((first >= LAST_NS) & self._sound()).tolist():
            what = f"its time is {first[slot]} ns, which is no date"
            self._break(slot, TimeOrderError, f"row {numbers[slot]}", what)
        for slot in range(len(self._broken)):
            if self._broken[slot] == 1:
                error, where, what = self._reasons.get(
                    slot, (SchemaError, f"row {numbers[slot]}", "as rows before it")
                )
                self._sieve.drop(error, where, what)

    def _sound(self) -> NDArray[np.bool]:
        return np.frombuffer(self._broken, dtype=np.uint8) == 0

    def _grown(self, number: int, log_time: int) -> int:
        slot = self._slots[number] = len(self._slots)
        for column in self._columns.values():
            column.append(math.nan)
        for seen in self._seen.values():
            seen.append(0)
        self._first.append(log_time)
        self._last.append(log_time)
        self._broken.append(0)
        return slot

    def _twice(self, channel: Channel, number: int, slot: int, same: bool, at: int) -> None:
        what = "is there twice, the same" if same else "is there twice and differs"
        where = f"row {number}, {channel.topic}, chunk at byte {at}"
        new = not same and self._broken[slot] != 2
        self._sieve.drop(DuplicateChannelError, where, what, rows=int(new))
        if not same:
            self._broken[slot] = 2  # said already

    def _break(self, slot: int, error: type[LogError], where: str, what: str) -> None:
        if self._broken[slot]:
            return
        self._broken[slot] = 1
        if len(self._reasons) < MOST_REASONS:
            self._reasons[slot] = (error, where, what)
