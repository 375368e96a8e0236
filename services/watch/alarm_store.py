"""Alarms in a small file, so that a restart forgets no acknowledgement."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from robomesh.atomic_write import write_atomically
from robomesh.schemas.robomesh_pb2 import Alarm as AlarmMessage
from services.watch.alarms import Alarm

_KINDS = {each.name: each.type for each in fields(Alarm)}
_LAST_S = 253402300799.0  # the last second that a protobuf timestamp can tell


def load(path: Path) -> tuple[dict[str, Alarm], dict[str, int]]:
    """The alarms that were saved, and until when each topic's events were taken; none without a file.

    Raises:
        ValueError: If the file is none of ours; its text names the file.
        OSError: If it cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return {}, {}
    try:
        values = json.loads(text)
        json.dumps(values, ensure_ascii=False, allow_nan=False).encode()  # all of it can be told
        alarms = [_alarm(entry) for entry in values["alarms"]]
        return {alarm.id: alarm for alarm in alarms}, {str(k): int(v) for k, v in values["told_ns"].items()}
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise ValueError(f"{path}: not a file of alarms: {error or type(error).__name__}") from None


def save(path: Path, alarms: Iterable[Alarm], told_ns: Mapping[str, int]) -> None:
    """Write them, the whole file or nothing of it; blocks until the disk has it.

    Raises:
        OSError: If the disk refuses.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    values = {"alarms": [asdict(alarm) for alarm in alarms], "told_ns": dict(told_ns)}
    write_atomically(path, json.dumps(values, ensure_ascii=False, indent=1).encode())


def _alarm(entry: dict[str, Any]) -> Alarm:
    values = {name: value for name, value in entry.items() if name in _KINDS}
    values["values"] = tuple((str(name), str(value)) for name, value in values.get("values", ()))
    values["came"] = tuple(float(at) for at in values.get("came", ()))
    for name, value in values.items():
        if not _fits(name, value):
            raise ValueError(f"{name} {value!r:.80} of an alarm")
    return Alarm(**values)


def _fits(name: str, value: object) -> bool:
    """Whether it can be held and told: a hand or a disk may have changed it."""
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
            return _KINDS[name] == float | None
        case str():
            return _KINDS[name] is str
        case _:
            return name in ("values", "came")
