"""A file of alarms, so that a restart keeps acknowledgements."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from google.protobuf.json_format import MessageToDict, ParseDict, ParseError

from robomesh.files.atomic_write import write_atomically
from robomesh.schemas.robomesh_pb2 import Alarm as AlarmMessage
from robomesh.schemas.robomesh_pb2 import Reason as ReasonMessage
from services.watch.alarms import Alarm

_KINDS = {each.name: each.type for each in fields(Alarm)}
# The file keeps its first version's names of these fields.
_FILE_KEYS = {
    "active": "stands",
    "acknowledged": "seen",
    "occurrences": "came",
    "clears_at": "going_at",
    "reporter": "told_by",
}
_LAST_S = 253402300799.0  # the last second that a protobuf timestamp can hold


def load(path: Path) -> tuple[dict[str, Alarm], dict[str, int]]:
    """Load the saved alarms, and by topic the time of its last handled event; both empty without a file.

    Raises:
        ValueError: If it is not a file of alarms; the message names the file.
        OSError: If it cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return {}, {}
    try:
        values = json.loads(text)
        json.dumps(
            values, ensure_ascii=False, allow_nan=False
        ).encode()  # raises if a value cannot be published
        alarms = [_alarm(entry) for entry in values["alarms"]]
        return {alarm.id: alarm for alarm in alarms}, {str(k): int(v) for k, v in values["told_ns"].items()}
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
        RecursionError,
        ParseError,
    ) as error:
        raise ValueError(f"{path}: not a file of alarms: {error or type(error).__name__}") from None


def save(path: Path, alarms: Iterable[Alarm], last_event_ns: Mapping[str, int]) -> None:
    """Write the file atomically; block until the disk has it.

    Raises:
        OSError: If the disk refuses.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    values = {"alarms": [_entry(alarm) for alarm in alarms], "told_ns": dict(last_event_ns)}
    write_atomically(path, json.dumps(values, ensure_ascii=False, indent=1).encode())


def _entry(alarm: Alarm) -> dict[str, Any]:
    entry = {_FILE_KEYS.get(name, name): value for name, value in asdict(alarm).items()}
    if alarm.cause is not None:
        entry["cause"] = MessageToDict(alarm.cause)
    return entry


def _alarm(entry: dict[str, Any]) -> Alarm:
    fields_by_key = {_FILE_KEYS.get(name, name): name for name in _KINDS}
    values = {fields_by_key[key]: value for key, value in entry.items() if key in fields_by_key}
    values["values"] = tuple((str(name), str(value)) for name, value in values.get("values", ()))
    values["occurrences"] = tuple(float(at) for at in values.get("occurrences", ()))
    if values.get("cause") is not None:
        values["cause"] = ParseDict(values["cause"], ReasonMessage())
    for name, value in values.items():
        if not _fits(name, value):
            raise ValueError(f"{name} {value!r:.80} of an alarm")
    return Alarm(**values)


def _fits(name: str, value: object) -> bool:
    """Return whether a value has its field's type and range; the file may be edited or damaged."""
    match value:
        case bool():
            return _KINDS[name] is bool
        case int() if name == "priority":
            return value in AlarmMessage.Priority.values()
        case int() if name == "count":
            return 0 < value < 2**32
        case int() | float():
            return _KINDS[name] in (float, float | None) and 0 <= value <= _LAST_S
        case None:
            return _KINDS[name] in (float | None, ReasonMessage | None)
        case ReasonMessage():
            return name == "cause"
        case str():
            return _KINDS[name] is str
        case _:
            return name in ("values", "occurrences")
