"""A recording of messages, of whatever kind of file: its topics, and the messages of some."""

from __future__ import annotations

import sqlite3
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Container, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from cpl.logs.bag_salvage import BagSurvey, bag_messages, survey_bag
from cpl.logs.budget import LARGEST_FILE, LARGEST_MESSAGE, Budget, OverBudgetError
from cpl.logs.errors import DamagedLogError, EmptyLogError, LogError, NotALogError
from cpl.logs.packed import ENDINGS, ZSTD, unpacked_file, unpacked_message
from cpl.logs.salvage import Damage, Survey, messages, survey
from cpl.logs.source import CannotUnpackError, Source

__all__ = ["Bag1", "Bag2", "McapFiles", "Recording", "Topic", "opened"]


@dataclass(kw_only=True)
class Topic:
    """A topic of a recording.

    Attributes:
        name: Its name.
        kind: The type of its messages, as ROS 2 writes it, or as the schema is named.
        encoding: How they are written: `cdr`, `ros1`, `json` or another.
        definition: What the file says of their layout; empty if it says nothing.
        held: How many there are.
        expected: How many there are by the file's own count; None if that is lost.
    """

    name: str
    kind: str
    encoding: str
    definition: str = ""
    held: int = 0
    expected: int | None = None


class Recording(ABC):
    """What can be asked of any recording of messages.

    Attributes:
        topics: By name.
        damages: What could not be confirmed.
        notes: What is to be said of sound parts.
        size: Of all its files [byte].
    """

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.damages: list[Damage] = []
        self.notes: list[str] = []
        self.size = 0
        self._open = ExitStack()

    def messages(self, wanted: Container[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield name of the topic, time of receipt [ns] and content, in the order of the file.

        A message of ROS 2 that is packed by itself comes unpacked; as it is, if that fails.
        """
        budget = Budget(size=self.size)
        for name, received_ns, raw in self._stored(wanted):
            content = raw
            if raw.startswith(ZSTD) and self.topics[name].encoding == "cdr":
                try:
                    content = unpacked_message(raw, budget)
                except CannotUnpackError:
                    content = raw  # which is no CDR: it costs itself, where it is understood
                except OverBudgetError as error:
                    what = f"its messages' compression {error}; no more are read"
                    self.damages.append(Damage(at=0, size=0, what=what))
                    break
            yield name, received_ns, content

    @abstractmethod
    def _stored(self, wanted: Container[str]) -> Iterator[tuple[str, int, bytes]]:
        """As :meth:`messages`, with the content as it is in the file."""

    def keep(self, others: ExitStack) -> None:
        """Close others after its own files."""
        others.push(self._open)
        self._open = others

    def close(self) -> None:
        """Close its files."""
        self._open.close()

    def _topic(self, topic: Topic) -> None:
        """Add what a file says of a topic to what others said."""
        known = self.topics.setdefault(topic.name, topic)
        if known is topic:
            return
        if (known.kind, known.encoding) != (topic.kind, topic.encoding):
            what = f"topic {topic.name} has messages of two types, {known.kind} and {topic.kind}"
            self.damages.append(Damage(at=0, size=0, what=what))
            return
        known.held += topic.held
        both = known.expected is not None and topic.expected is not None
        known.expected = (known.expected or 0) + (topic.expected or 0) if both else None


class Bag1(Recording):
    """A ROS 1 bag."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._bag: BagSurvey = survey_bag(self._open.enter_context(Source.open(path)))
        self.size, self.damages = self._bag.source.size, self._bag.damages
        self.notes.append("ROS 1 bags carry no checksums: a changed digit in one cannot be seen")
        expected = self._bag.expected
        for number, each in self._bag.connections.items():
            self._topic(
                Topic(
                    name=each.topic,
                    kind=each.msgtype,
                    encoding="ros1",
                    definition=each.msgdef,
                    held=self._bag.held[number],
                    expected=None if expected is None else expected.get(number, 0),
                )
            )

    def _stored(self, wanted: Container[str]) -> Iterator[tuple[str, int, bytes]]:
        names = {n: c.topic for n, c in self._bag.connections.items() if c.topic in wanted}
        for number, received_ns, raw in bag_messages(self._bag, names):
            yield names[number], received_ns, raw


class McapFiles(Recording):
    """One MCAP file of any program, or several that follow each other."""

    def __init__(self, paths: list[Path]) -> None:
        super().__init__()
        self._files: list[Survey] = []
        for path in paths:
            found = survey(self._open.enter_context(Source.open(path)), foreign=True)
            self._files.append(found)
            self.size += found.source.size
            for each in found.damages:
                where = f"{path.name}: " if len(paths) > 1 else ""
                self.damages.append(Damage(at=each.at, size=each.size, what=where + each.what))
            for topic in self._told(found):
                self._topic(topic)
        unchecked = sum(each.unchecked + len(each.loose) for each in self._files)
        if unchecked:
            what = (
                f"{unchecked} chunks or messages have no checksum: a changed digit cannot be seen"
            )
            self.notes.append(what)

    @staticmethod
    def _told(found: Survey) -> Iterator[Topic]:
        for number, each in found.channels.items():
            schema = found.schemas.get(each.schema_id)
            text = schema.data if schema and schema.encoding in ("ros1msg", "ros2msg") else b""
            kind = schema.name if schema else ""
            if schema and schema.encoding == "ros1msg" and "/msg/" not in kind:
                kind = kind.replace("/", "/msg/", 1)
            yield Topic(
                name=each.topic,
                kind=kind,
                encoding=each.message_encoding,
                definition=text.decode(errors="replace"),
                held=found.held[number],
                expected=None if found.expected is None else found.expected.get(number, 0),
            )

    def _stored(self, wanted: Container[str]) -> Iterator[tuple[str, int, bytes]]:
        for found in self._files:
            names = {n: c.topic for n, c in found.channels.items() if c.topic in wanted}
            for _, message in messages(found, names):
                yield names[message.channel_id], message.log_time, message.data


@dataclass(frozen=True, kw_only=True)
class _Metadata:
    """What a ROS 2 bag's `metadata.yaml` says that is needed here."""

    files: list[str] = field(default_factory=list)
    compression: str = ""
    count: int | None = None


class Bag2(Recording):
    """ROS 2 messages in SQLite files: one `.db3`, or several that follow each other."""

    def __init__(self, paths: list[Path]) -> None:
        super().__init__()
        self._files: list[tuple[Path, sqlite3.Connection]] = []
        self._steps = 0
        self.notes.append("SQLite carries no checksums: a changed digit in it cannot be seen")
        for path in paths:
            with Source.open(path) as source:
                self.size += source.size
                self._complete(source, path)
            link = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
            self._open.callback(link.close)
            self._guarded(link)
            try:
                self._tables(link, path)
                self._sound(link, path)
                for topic in self._told(link):
                    self._topic(topic)
            except sqlite3.Error as error:
                what = f"the file cannot be read ({error})"
                raise DamagedLogError(what, path=path) from error
            self._files.append((path, link))

    def _stored(self, wanted: Container[str]) -> Iterator[tuple[str, int, bytes]]:
        for path, link in self._files:
            link.text_factory = bytes
            count = timeless = 0
            try:
                topics = dict(link.execute("SELECT id, name FROM topics LIMIT 10000").fetchall())
                names = {n: name.decode(errors="replace") for n, name in topics.items()}
                for number, received_ns, data in link.execute(
                    "SELECT topic_id, timestamp, data FROM messages"
                ):
                    count += 1
                    name = names.get(number, "")
                    if name in wanted and isinstance(received_ns, int):
                        yield name, received_ns, data if isinstance(data, bytes) else b""
                    elif name in wanted:
                        timeless += 1
            except (sqlite3.Error, OverflowError) as error:
                what = f"{path.name}: after {count} messages the file cannot be read ({error})"
                self.damages.append(Damage(at=0, size=0, what=what))
            if timeless:
                what = f"{path.name}: {timeless} messages have a time that is no number"
                self.damages.append(Damage(at=0, size=0, what=what))

    def _guarded(self, link: sqlite3.Connection) -> None:
        """Let a hostile file neither run its own code, nor run for ever, nor fill the memory."""
        most = 50_000 + self.size // 100  # some hundred bytes a thousand instructions

        def step() -> int:
            self._steps += 1
            return int(self._steps > most)

        link.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 64 * LARGEST_MESSAGE)
        link.execute("PRAGMA trusted_schema = OFF")
        link.execute("PRAGMA cell_size_check = ON")
        link.set_progress_handler(step, 1000)

    def _complete(self, source: Source, path: Path) -> None:
        """Note pages that the file says it has and has not: SQLite reads them as empty."""
        head = source.read(0, 32)
        page = int.from_bytes(head[16:18]) or 0
        page = 1 << 16 if page == 1 else page
        lost = page * int.from_bytes(head[28:32]) - source.size
        if lost > 0:
            what = f"{path.name}: the file ends {lost} bytes before its last page"
            self.damages.append(Damage(at=source.size, size=0, what=what))

    def _sound(self, link: sqlite3.Connection, path: Path) -> None:
        """Note what SQLite's own check of the pages finds first."""
        try:
            found = str(link.execute("PRAGMA quick_check(1)").fetchone()[0])
        except sqlite3.Error as error:
            found = str(error)
        if found != "ok":
            what = f"{path.name}: SQLite finds the file damaged ({found.splitlines()[0][:200]})"
            self.damages.append(Damage(at=0, size=0, what=what))

    @staticmethod
    def _tables(link: sqlite3.Connection, path: Path) -> None:
        kinds = dict(link.execute("SELECT name, type FROM sqlite_master LIMIT 1000").fetchall())
        for name in ("topics", "messages"):
            if kinds.get(name) != "table":
                have = kinds.get(name, "nothing")
                raise NotALogError(f"is SQLite, but {name!r} is {have}, not a table", path=path)
        hidden = link.execute(
            "SELECT count(*) FROM pragma_table_xinfo('messages') WHERE hidden > 1"
        ).fetchone()[0]
        if hidden:
            raise NotALogError("computes columns of its messages, which no bag does", path=path)

    @staticmethod
    def _told(link: sqlite3.Connection) -> Iterator[Topic]:
        held = Counter(number for (number,) in link.execute("SELECT topic_id FROM messages"))
        topics = "SELECT id, name, type, serialization_format FROM topics LIMIT 10000"
        for number, name, kind, encoding in link.execute(topics):
            yield Topic(name=str(name), kind=str(kind), encoding=str(encoding), held=held[number])


def opened(path: Path) -> Recording:
    """Open a ROS 2 bag: its folder, or one of its files.

    Raises:
        LogError: There is none, or a part of it is missing.
    """
    if path.is_file():
        return _bag([path])
    told = _described(path / "metadata.yaml")
    if told.compression not in ("", "zstd"):
        what = (
            f"is compressed by {told.compression}, which is not read: `ros2 bag convert` writes it "
            "anew"
        )
        raise NotALogError(what, path=path)
    found = {name: _there(path / Path(name).name) for name in told.files}
    missing = [Path(name).name for name, each in found.items() if each is None]
    there = [each for each in found.values() if each is not None]
    if not there:
        raise EmptyLogError("has no file of those that metadata.yaml names", path=path)
    bag = _bag(there)
    bag.damages += [Damage(at=0, size=0, what=f"{name} is missing") for name in missing]
    held = sum(topic.held for topic in bag.topics.values())
    if told.count is not None and told.count > held:
        what = f"metadata.yaml counts {told.count} messages, {held} are there"
        bag.damages.append(Damage(at=0, size=0, what=what))
    return bag


def _there(path: Path) -> Path | None:
    """Return a file that is named, or the same packed or unpacked since."""
    plain = path.with_suffix("") if path.suffix in ENDINGS else path
    names = [path, plain, *(plain.with_name(plain.name + ending) for ending in ENDINGS)]
    return next((each for each in names if each.is_file()), None)


def _bag(paths: list[Path]) -> Recording:
    """Open files of one kind, of which some may be packed."""
    with ExitStack() as held:
        packed: dict[Path, Path] = {}
        damages: list[Damage] = []
        plain: list[Path] = []
        for path in paths:
            if not _begins(path, ZSTD):
                plain.append(path)
                continue
            folder = Path(held.enter_context(TemporaryDirectory(prefix="cpl-bag-")))
            try:
                made, wrong = unpacked_file(path, folder)
            except OverBudgetError as error:
                raise DamagedLogError(str(error), path=path) from error
            if wrong:
                damages.append(Damage(at=path.stat().st_size, size=0, what=f"{path.name}: {wrong}"))
            if made.stat().st_size:
                packed[made] = path
                plain.append(made)
        if not plain:
            what = damages[0].what.removeprefix(f"{paths[0].name}: ") if damages else "is empty"
            raise DamagedLogError(what, path=paths[0])
        kinds = {_begins(each, b"SQLite") for each in plain}
        if len(kinds) > 1:
            raise NotALogError("mixes SQLite and MCAP files", path=paths[0].parent)
        try:
            bag = (Bag2 if kinds == {True} else McapFiles)(plain)
        except LogError as error:
            path = packed.get(error.path, error.path)
            raise type(error)(error.what, path=path, where=error.where) from error
        bag.keep(held.pop_all())
    bag.damages += damages
    bag.notes += [f"{each.name} was unpacked: its bytes are counted so" for each in packed.values()]
    return bag


def _begins(path: Path, mark: bytes) -> bool:
    with Source.open(path) as source:
        return source.read(0, len(mark)) == mark


def _described(path: Path) -> _Metadata:
    """Read what is needed of a `metadata.yaml`, line by line: nothing in it is ever built."""
    with Source.open(path) as source:
        text = source.read(0, min(source.size, LARGEST_FILE, 1 << 20)).decode(errors="replace")
    files: list[str] = []
    said: dict[str, str] = {}
    listing = False
    for line in text.splitlines():
        name, _, value = line.strip().partition(":")
        if line.strip().startswith("- ") and listing:
            files.append(line.strip()[2:].strip().strip("\"'"))
            continue
        listing = name == "relative_file_paths"
        said.setdefault(name, value.strip().strip("\"'"))
    counted = said.get("message_count", "")
    return _Metadata(
        files=files,
        compression=said.get("compression_format", ""),
        count=int(counted) if counted.isdecimal() and len(counted) < 19 else None,
    )
