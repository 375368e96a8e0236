"""Values of a robot over time, from its flight recorder and its recordings.

The same state may be in several files: to read it twice does not change an interval's minimum and maximum.
"""

import logging
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robomesh import reason_codes as codes
from robomesh.contract.keys import check_name
from robomesh.errors import KeyNameError
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.names import FLIGHT_FOLDER, SUFFIX
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.series.downsampling import (
    MOST_POINTS,
    MOST_VALUES,
    POINTS,
    FloatArray,
    Pieces,
    cut,
    topics_of_values,
    units_of,
)
from robomesh.recordings.series.values import topic_of
from robomesh.recordings.writing.capture import is_being_written
from robomesh.schemas import robomesh_pb2 as schema

_LONGEST_H = 24
_SECOND_NS = 1_000_000_000
# Closed files are read once, into intervals of at least this length. A closer view reads the file again: its
# intervals are shorter than this many of these.
_INTERVAL_NS = 50_000_000
_MOST_INTERVALS = 20_000
_LEAST_RATIO = 2
_MOST_CACHED_BYTES = 64 << 20
# Between the last state of one file and the first of the next.
_MOST_BETWEEN_NS = 2 * _SECOND_NS

_Span = tuple[int, int]

log = logging.getLogger(__name__)


@dataclass
class _Found:
    """Minimum and maximum of a value in each interval."""

    lowest: FloatArray
    highest: FloatArray
    unit: str = ""


@dataclass
class _Reading:
    """One request while it is answered; times in ns since the Unix epoch."""

    start_ns: int
    end_ns: int
    points: int
    names: tuple[str, ...]
    found: dict[str, _Found] = field(default_factory=dict)
    recorded: list[_Span] = field(default_factory=list)

    def covers(self, span: _Span) -> bool:
        """Return whether one part that was read includes a span."""
        return any(start <= span[0] and span[1] <= end for start, end in self.recorded)

    def add_span(self, span: _Span) -> None:
        """Add a part that was read."""
        joined: list[_Span] = []
        for start, end in sorted([*self.recorded, span]):
            if joined and start - joined[-1][1] <= _MOST_BETWEEN_NS:
                joined[-1] = joined[-1][0], max(joined[-1][1], end)
            else:
                joined.append((start, end))
        self.recorded = joined

    def add(self, name: str, unit: str, pieces: Pieces) -> None:
        """Add a file's intervals of a value."""
        lowest, highest = pieces.lowest.get(name), pieces.highest.get(name)
        if lowest is None or highest is None:
            return
        there = np.flatnonzero(lowest <= highest)
        width_ns = (pieces.end_ns - pieces.start_ns + 1) / pieces.count
        middle_ns = pieces.start_ns + (there + 0.5) * width_ns
        # An interval over the edge counts too: a peak may be in it.
        inside = (middle_ns > self.start_ns - width_ns / 2) & (middle_ns < self.end_ns + width_ns / 2)
        place = np.floor((middle_ns - self.start_ns) * (self.points / (self.end_ns - self.start_ns)))
        place = np.clip(place, 0, self.points - 1)
        if name not in self.found:
            self.found[name] = _Found(np.full(self.points, np.inf), np.full(self.points, -np.inf))
        found, index = self.found[name], place[inside].astype(np.int64)
        found.unit = found.unit or unit
        np.minimum.at(found.lowest, index, lowest[there][inside])
        np.maximum.at(found.highest, index, highest[there][inside])

    def answer(self) -> schema.SeriesAnswer:
        """Return the answer."""
        answer = schema.SeriesAnswer()
        width_s = (self.end_ns - self.start_ns) / _SECOND_NS / self.points
        for name in self.names:
            series = answer.series.add(name=name)
            if (found := self.found.get(name)) is not None:
                there = np.flatnonzero(found.lowest <= found.highest)
                series.unit = found.unit
                series.times_s.extend(((there + 0.5) * width_s).tolist())
                series.lowest.extend(found.lowest[there].tolist())
                series.highest.extend(found.highest[there].tolist())
        for start, end in self.recorded:
            seconds = ((each - self.start_ns) / _SECOND_NS for each in (start, end))
            answer.recorded.add(start_s=next(seconds), end_s=next(seconds))
        return answer


class RobotSeries:
    """A reader of a robot's values from all files of a recorder's folder, with a cache of closed files."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._cache: OrderedDict[tuple[str, int, int, str], Pieces] = OrderedDict()

    def read(self, request: schema.SeriesRequest) -> schema.SeriesAnswer:
        """Return values of a robot between two times; a value that is not recorded has no data.

        Raises:
            RecordingError: If the request is invalid.
        """
        reading, robot = _checked(request), request.robot
        # The flight recorder first: most recordings of the last minutes contain the same.
        for folder in (self._folder / FLIGHT_FOLDER / robot, self._folder / robot):
            for path in _files(folder, reading.start_ns):
                try:
                    self._read(path, reading)
                except RecordingError as error:
                    log.warning("%s: %s", path, error)
                except OSError:
                    pass  # the flight recorder removes old files
        return reading.answer()

    def _read(self, path: Path, reading: _Reading) -> None:
        with RecordingFile(path) as file:
            first, last = file.layout.start_ns, file.layout.end_ns
            span = max(first, reading.start_ns), min(last, reading.end_ns)
            if span[0] > span[1] or reading.covers(span):
                return
            topics = topics_of_values(file)
            unit = units_of(file, reading.names)
            count = min(max((last - first) // _INTERVAL_NS, 1), _MOST_INTERVALS)
            coarse_ns = _LEAST_RATIO * (last - first) / count
            whole = (
                not is_being_written(path)
                and coarse_ns <= (reading.end_ns - reading.start_ns) / reading.points
            )
            for topic, names in _by_topic(reading.names, topics):
                if whole:
                    pieces = self._whole(file, topic, topics[topic], names, count)
                else:
                    pieces = Pieces(names, reading.start_ns, reading.end_ns - 1, reading.points)
                    cut(file, topic, topics[topic], pieces)
                for name in names:
                    reading.add(name, unit(name), pieces)
            reading.add_span(span)

    def _whole(self, file: RecordingFile, topic: str, key: str, names: frozenset[str], count: int) -> Pieces:
        """Return the intervals of a whole closed file, from the cache if it has them."""
        status = file.path.stat()
        entry = str(file.path), status.st_mtime_ns, status.st_size, topic
        pieces = self._cache.get(entry)
        if pieces is None or not (pieces.all or names <= pieces.asked | pieces.lowest.keys()):
            own = Pieces(names, file.layout.start_ns, file.layout.end_ns, count)
            pieces = self._cache[entry] = cut(file, topic, key, own)
        self._cache.move_to_end(entry)
        while len(self._cache) > 1 and sum(each.bytes for each in self._cache.values()) > _MOST_CACHED_BYTES:
            self._cache.popitem(last=False)
        return pieces


def _checked(request: schema.SeriesRequest) -> _Reading:
    try:
        check_name(request.robot, "robot")
    except KeyNameError as error:
        raise RecordingError(error.reason) from None
    if len(request.values) > MOST_VALUES:
        raise RecordingError(codes.RECORDING_TOO_MANY_VALUES(count=len(request.values), most=MOST_VALUES))
    start_ns, end_ns = request.start.ToNanoseconds(), request.end.ToNanoseconds()
    if end_ns <= start_ns:
        raise RecordingError(codes.RECORDING_TIMES())
    if end_ns - start_ns > _LONGEST_H * 3600 * _SECOND_NS:
        raise RecordingError(codes.RECORDING_TOO_LONG(hours=_LONGEST_H))
    points = min(request.points or POINTS, MOST_POINTS)
    return _Reading(start_ns, end_ns, points, tuple(dict.fromkeys(request.values)))


def _files(folder: Path, start_ns: int) -> list[Path]:
    """Return the files that were written to after a time, oldest first by name."""
    found: list[Path] = []
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        with suppress(OSError):
            if path.stat().st_mtime_ns >= start_ns:
                found.append(path)
    return found


def _by_topic(names: Sequence[str], topics: Iterable[str]) -> Iterator[tuple[str, frozenset[str]]]:
    own: dict[str, set[str]] = {}
    known = tuple(topics)
    for name in names:
        if (topic := topic_of(name, known)) is not None:
            own.setdefault(topic, set()).add(name)
    for topic, some in own.items():
        yield topic, frozenset(some)
