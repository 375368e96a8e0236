"""Values over time, downsampled without losing peaks: the minimum and maximum of each interval."""

import contextlib
import itertools
import logging
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from robomesh import reason_codes as codes
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.names import robot_channels, topic_name
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.series.publisher_time import PublisherTimes
from robomesh.recordings.series.values import (
    has_values,
    prismatic_joints,
    signal_units,
    topic_of,
    unit_of,
    values_of,
)
from robomesh.schemas.robomesh_pb2 import Description, Signals

POINTS, MOST_POINTS = 1000, 10_000
MOST_VALUES = 64
# Intervals of a whole recording, computed once; a closer view reads the file again.
_PIECES = 20_000
_MOST_NAMES = 2000
_LOOKED_AT = 200
# Limits of the cache: total size, and values of a topic that were not requested.
_MOST_KEPT_BYTES = 64 << 20
_MOST_UNASKED = 32
_ROWS = 5000
_OF_JOINTS = ("joints/", "kinematics/margin/")

log = logging.getLogger(__name__)

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """Minimum and maximum of a value in each interval that contains data.

    Attributes:
        times_s: Middle of the intervals, since the recording's start [s].
    """

    name: str
    unit: str
    times_s: FloatArray
    lowest: FloatArray
    highest: FloatArray


@dataclass
class Pieces:
    """Minimum and maximum of values while they are read, one column for each interval.

    Attributes:
        asked: Requested values, which are never omitted.
        all: No value was omitted.
    """

    asked: frozenset[str]
    start_ns: int
    end_ns: int
    count: int
    lowest: dict[str, FloatArray] = field(default_factory=dict)
    highest: dict[str, FloatArray] = field(default_factory=dict)
    all: bool = True

    @property
    def bytes(self) -> int:
        """Return the size in memory."""
        return len(self.lowest) * self.count * 16

    def take(self, names: Sequence[str], places: Sequence[int], rows: Sequence[Sequence[float]]) -> None:
        """Add rows of numbers, each to an interval."""
        index, numbers = np.array(places), np.array(rows)
        for column, name in enumerate(names):
            if name not in self.lowest:
                if name not in self.asked and len(self.lowest) >= _MOST_UNASKED:
                    self.all = False
                    continue
                self.lowest[name] = np.full(self.count, np.inf)
                self.highest[name] = np.full(self.count, -np.inf)
            finite = np.isfinite(numbers[:, column])
            own = numbers[:, column][finite]
            np.minimum.at(self.lowest[name], index[finite], own)
            np.maximum.at(self.highest[name], index[finite], own)


class SeriesReader:
    """A reader of series with a cache of the intervals of whole recordings."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[str, int, int, str], Pieces] = OrderedDict()

    def read(
        self, file: RecordingFile, names: Sequence[str], *, start_ns: int, end_ns: int, points: int
    ) -> list[Series]:
        """Return the series of values between two times (both included).

        Raises:
            RecordingError: If a value is missing, or the file is damaged.
        """
        if len(names) > MOST_VALUES:
            raise RecordingError(codes.RECORDING_TOO_MANY_VALUES(count=len(names), most=MOST_VALUES))
        topics = topics_of_values(file)
        wanted: dict[str, list[str]] = {}
        for name in names:
            topic = topic_of(name, topics)
            if topic is None:
                there = ", ".join(f"{topic}/..." for topic in topics) or "none"
                raise RecordingError(codes.RECORDING_NO_VALUE(file=file.path.name, name=name, topics=there))
            wanted.setdefault(topic, []).append(name)
        unit = units_of(file, names)
        found: dict[str, Series] = {}
        for topic, own in wanted.items():
            pieces = self._pieces(file, topic, topics[topic], start_ns, end_ns, points, frozenset(own))
            for name in own:
                combined = _combined(name, pieces, file.layout.start_ns, start_ns, end_ns, points)
                found[name] = replace(combined, unit=unit(name))
        return [found[name] for name in names]

    def _pieces(
        self,
        file: RecordingFile,
        topic: str,
        key: str,
        start_ns: int,
        end_ns: int,
        points: int,
        asked: frozenset[str],
    ) -> Pieces:
        whole_ns = max(file.layout.end_ns - file.layout.start_ns, 1)
        share = (end_ns - start_ns) / whole_ns
        if share * _PIECES < points * 4:
            return cut(file, topic, key, Pieces(asked, start_ns, end_ns, points))
        found = file.path.stat()
        about = (str(file.path), found.st_mtime_ns, found.st_size, topic)
        pieces = self._kept.get(about)
        if pieces is None or not (pieces.all or asked <= pieces.asked | pieces.lowest.keys()):
            first, last = file.layout.start_ns, file.layout.end_ns
            pieces = self._kept[about] = cut(file, topic, key, Pieces(asked, first, last, _PIECES))
        self._kept.move_to_end(about)
        while len(self._kept) > 1 and sum(each.bytes for each in self._kept.values()) > _MOST_KEPT_BYTES:
            self._kept.popitem(last=False)
        return pieces


def topics_of_values(file: RecordingFile) -> dict[str, str]:
    """Return the topics with numbers as in the names of values, and their channels' names in the file.

    Raises:
        RecordingError: If several robots have messages.
    """
    own = robot_channels(file.layout.messages, file.path.name)
    found: dict[str, str] = {}
    for key in sorted(file.topics):
        topic = topic_name(key)
        if own.get(topic, key) == key and has_values(file.schema_name(key)) and file.decoder(key) is not None:
            found.setdefault(topic, key)
    return found


def known_values(file: RecordingFile) -> list[str]:
    """Return the names of a recording's values, from the first messages and the last message of each topic.

    Raises:
        RecordingError: If the file is damaged.
    """
    known: dict[str, None] = {}
    for topic, key in topics_of_values(file).items():
        last = file.newest(key, file.layout.end_ns)
        looked = itertools.islice(file.messages([key]), _LOOKED_AT)
        values = _Values(file, key)
        for message in itertools.chain(looked, () if last is None else (last,)):
            known.update((f"{topic}/{name}", None) for name, _ in values.of(message.data))
            if len(known) >= _MOST_NAMES:
                return list(known)[:_MOST_NAMES]
    return list(known)


def units_of(file: RecordingFile, names: Sequence[str]) -> Callable[[str], str]:
    """Return the function that returns the unit of one of these values of a recording."""
    prismatic, signals = _sliding_joints(file, names), _units_of_signals(file, names)
    return lambda name: unit_of(name, prismatic, signals)


def _units_of_signals(file: RecordingFile, names: Sequence[str]) -> dict[str, str]:
    """Return the units of signals, by the last message, or the first one that has the signal."""
    key = topics_of_values(file).get("signals")
    wanted = {name for name in names if name.startswith("signals/")}
    if key is None or not wanted:
        return {}
    found: dict[str, str] = {}
    last = file.newest(key, file.layout.end_ns)
    looked = itertools.islice(file.messages([key]), _LOOKED_AT)
    for message in itertools.chain(() if last is None else (last,), looked):
        with contextlib.suppress(DecodeError):
            found = signal_units(Signals.FromString(message.data)) | found
        if found.keys() >= wanted:
            break
    return found


def _sliding_joints(file: RecordingFile, names: Sequence[str]) -> frozenset[str]:
    """Return the prismatic joints (unit: metre)."""
    description = robot_channels(file.layout.messages, file.path.name).get("description")
    if not any(name.startswith(_OF_JOINTS) for name in names) or description is None:
        return frozenset()
    told = file.newest(description, file.layout.end_ns)
    try:
        return prismatic_joints(Description.FromString(b"" if told is None else told.data))
    except DecodeError:
        return frozenset()


class _Values:
    """The values of a topic's messages; counts messages that cannot be read."""

    def __init__(self, file: RecordingFile, key: str) -> None:
        decode = file.decoder(key)
        assert decode is not None
        self.unread = 0
        self._schema, self._decode = file.schema_name(key), decode

    def of(self, data: bytes) -> Iterator[tuple[str, float]]:
        try:
            message = self._decode(data)
        except (DecodeError, ValueError):
            self.unread += 1
            return iter(())
        return values_of(self._schema, message)


def cut(file: RecordingFile, topic: str, key: str, pieces: Pieces) -> Pieces:
    """Fill intervals with the file's values."""
    start_ns, end_ns, count = pieces.start_ns, pieces.end_ns, pieces.count
    values = _Values(file, key)
    scale = count / max(end_ns - start_ns + 1, 1)
    times = PublisherTimes()
    # Rows of messages with the same values.
    before: tuple[str, ...] = ()
    places: list[int] = []
    rows: list[tuple[float, ...]] = []

    def flush() -> None:
        if rows:
            pieces.take([f"{topic}/{name}" for name in before], places, rows)
        places.clear()
        rows.clear()

    for message in file.messages([key], start_ns=start_ns, end_ns=end_ns + 1):
        piece = min(max(int((times.of(message) - start_ns) * scale), 0), count - 1)
        names, numbers = tuple(zip(*values.of(message.data), strict=True)) or ((), ())
        if names != before or len(rows) >= _ROWS:
            flush()
            before = names
        if names:
            places.append(piece)
            rows.append(numbers)
    flush()
    if values.unread:
        log.warning("%s: %d messages of %s cannot be read: left out", file.path.name, values.unread, topic)
    return pieces


def _combined(name: str, pieces: Pieces, zero_ns: int, start_ns: int, end_ns: int, points: int) -> Series:
    """Combine a value's intervals into the requested number."""
    lowest, highest = pieces.lowest.get(name), pieces.highest.get(name)
    none = np.empty(0)
    if lowest is None or highest is None:
        return Series(name, unit_of(name), none, none, none)
    width_ns = max(pieces.end_ns - pieces.start_ns, 1) / pieces.count
    first = max(int((start_ns - pieces.start_ns) / width_ns), 0)
    last = min(int(np.ceil((end_ns - pieces.start_ns) / width_ns)), pieces.count)
    there = np.flatnonzero(lowest[first:last] <= highest[first:last]) + first
    if not len(there):
        return Series(name, unit_of(name), none, none, none)
    together = max((last - first) / points, 1.0)
    group = ((there - first) / together).astype(np.int64)
    begins = np.flatnonzero(np.diff(group, prepend=-1))
    ends = np.append(begins[1:], len(there)) - 1
    middle_ns = (there[begins] + there[ends] + 1) / 2 * width_ns + (pieces.start_ns - zero_ns)
    return Series(
        name,
        unit_of(name),
        middle_ns * 1e-9,
        np.minimum.reduceat(lowest[there], begins),
        np.maximum.reduceat(highest[there], begins),
    )
