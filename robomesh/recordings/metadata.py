"""Metadata records in which a recording describes itself.

    robomesh:<site>/<robot>/<file>      at the beginning: site, robot, name, started_by, start, ...
    robomesh.end:<site>/<robot>/<file>  at the end: its end, and the number of lost publications by topic

The `mcap` tools merge only files without equal names, so each recording has its own. `<file>` is the name
under which the recording began, and stays when the file is renamed, copied or filtered. What is known at the
start is at the beginning, where it survives a cut. Earlier versions wrote `robomesh` and `robomesh.lost`, at
the end.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from google.protobuf.timestamp_pb2 import Timestamp
from mcap.records import Metadata

from robomesh.recordings.records import number_in

_ABOUT, _END = "robomesh:", "robomesh.end:"
_OLD_ABOUT, _OLD_END = "robomesh", "robomesh.lost"
# Entries of the records that are times; the other entries of an end are topics.
_START, _ENDED = "start", "end"


@dataclass(frozen=True)
class OneRecording:
    """One of the recordings in a file.

    Attributes:
        about: site, robot, name, started_by, cause, part, recovered; an unknown one is missing.
        start_ns, end_ns: ns since the Unix epoch; 0: unknown.
        lost: Number of lost publications by topic.
    """

    about: Mapping[str, str]
    start_ns: int = 0
    end_ns: int = 0
    lost: Mapping[str, int] = field(default_factory=dict)


def about_name(site: str, robot: str, file: str) -> str:
    """Return the name of the record at a recording's beginning.

    Args:
        file: Name of its first file, without ending.
    """
    return _ABOUT + "/".join(filter(None, (site, robot, file)))


def end_name(about: str) -> str:
    """Return the name of the record at the end that belongs to one at the beginning."""
    return _OLD_END if about == _OLD_ABOUT else _END + about.removeprefix(_ABOUT)


def is_about(name: str) -> bool:
    """Return whether a record of this name is at a recording's beginning."""
    return name == _OLD_ABOUT or name.startswith(_ABOUT)


def is_end(name: str) -> bool:
    """Return whether a record of this name is at a recording's end."""
    return name == _OLD_END or name.startswith(_END)


def about_record(name: str, about: Mapping[str, str], start_ns: int) -> Metadata:
    """Return the record at the beginning of a recording."""
    return Metadata(name, {**about, _START: _text(start_ns)})


def end_record(about: str, end_ns: int, lost: Mapping[str, int]) -> Metadata:
    """Return the record at the end of the recording whose record at the beginning has this name."""
    values = {topic: str(number) for topic, number in lost.items() if number}
    # Earlier versions read every entry as a topic.
    ended = {_ENDED: _text(end_ns)} if end_ns and about != _OLD_ABOUT else {}
    return Metadata(end_name(about), {**ended, **values})


def lost_in(records: Iterable[Metadata]) -> Counter[str]:
    """Return the number of lost publications by topic, of all recordings."""
    lost: Counter[str] = Counter()
    for record in records:
        if is_end(record.name):
            lost.update({key: number_in(text) for key, text in record.metadata.items() if key != _ENDED})
    return lost


def recordings_in(records: Iterable[Metadata]) -> tuple[OneRecording, ...]:
    """Return the recordings in a file, each once."""
    abouts: dict[tuple[object, ...], Metadata] = {}
    ends: dict[str, list[Metadata]] = {}
    for record in records:
        if is_about(record.name):
            abouts[record.name, *sorted(record.metadata.items())] = record
        elif is_end(record.name):
            ends.setdefault(record.name, []).append(record)
    # Recordings of earlier versions share their names: then it is unknown whose end is whose.
    names = Counter(record.name for record in abouts.values())
    return tuple(
        _recording(record, ends.get(end_name(record.name), []) if names[record.name] == 1 else [])
        for record in abouts.values()
    )


def shared_entries(recordings: Iterable[OneRecording]) -> dict[str, str]:
    """Return the entries of `about` that all the recordings share: of a single one, all."""
    abouts = [each.about for each in recordings]
    first = abouts[0] if abouts else {}
    return {key: text for key, text in first.items() if all(each.get(key) == text for each in abouts)}


def _recording(about: Metadata, ends: list[Metadata]) -> OneRecording:
    known = {key: text for key, text in about.metadata.items() if key != _START}
    return OneRecording(
        known,
        _time_ns(about.metadata.get(_START, "")),
        max((_time_ns(each.metadata.get(_ENDED, "")) for each in ends), default=0),
        lost_in(ends),
    )


def _text(time_ns: int) -> str:
    timestamp = Timestamp()
    timestamp.FromNanoseconds(time_ns)
    return timestamp.ToJsonString()


def _time_ns(text: str) -> int:
    """Return a time in a record, which another program may have written; 0 if it is invalid."""
    timestamp = Timestamp()
    try:
        timestamp.FromJsonString(text)
    except ValueError:
        return 0
    return timestamp.ToNanoseconds()
