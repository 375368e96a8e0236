"""Lines that the reading process prints, one fact each, as JSON.

    {"found": [ITEM, ...], "server": TEXT, "sampling_s": SECONDS}       once, first
    {"values": [[NUMBER OF ITEM, VALUE, SOURCE TIME, GOOD], ...]}       a notification: what has changed
    {"alive": true}                                                     nothing has changed, all is as before

An ITEM is [KIND, NAME, UNIT ID, UNIT NAME, MOTION PROFILE]. A value is a number, a boolean or a text; null:
another type. A source time is in seconds since the Unix epoch; null: not reported. GOOD is false unless the
StatusCode is Good: the value is unknown.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from controllers.opcua.units import NO_UNIT, Unit
from robomesh import bounded_json

LONGEST_TEXT = 200
MOST_ITEMS = 512
# 300 years.
_LONGEST_S = 1e10

POSITION, SPEED, MOTOR = "position", "speed", "motor"
DECLARED = "declared"
KINDS = frozenset(
    {
        POSITION,
        SPEED,
        MOTOR,
        DECLARED,
        *("override", "in_control", "on_path", "mass", "mode", "emergency_stop", "protective_stop"),
        *("program", "loaded", "execution", "temperature", "software", "manufacturer", "model", "serial"),
    }
)
"""Of an axis: position and speed; of a motor: its temperature; declared: a signal of the site file."""


@dataclass(frozen=True, slots=True)
class Item:
    """Variable that is read.

    Attributes:
        kind: One of `KINDS`.
        name: Of its axis, motor, task or signal.
        profile: MotionProfile of its axis: 1, 2 rotary, 3, 4 linear; 0: another, or unknown.
    """

    kind: str
    name: str = ""
    unit: Unit = NO_UNIT
    profile: int = 0


@dataclass(frozen=True, slots=True)
class ItemsFound:
    """List of the items that are read.

    Attributes:
        server: Its name and version, for people.
        sampling_s: Longest interval at which it samples an axis.
    """

    items: tuple[Item, ...]
    server: str
    sampling_s: float


Value: TypeAlias = float | bool | str | None


@dataclass(frozen=True, slots=True)
class Reading:
    """A value of an item.

    Attributes:
        item: Number of the item.
        value: None: of a type that is not read.
        source_s: Seconds since the Unix epoch; None: not reported.
        good: Its StatusCode is Good.
    """

    item: int
    value: Value
    source_s: float | None
    good: bool


@dataclass(frozen=True, slots=True)
class Values:
    """Values of one notification; empty: a keep-alive."""

    readings: tuple[Reading, ...] = ()


Fact: TypeAlias = ItemsFound | Values


def encode(fact: Fact) -> bytes:
    """Return a fact as a line."""
    match fact:
        case ItemsFound(items, server, sampling_s):
            listed = [[i.kind, i.name, i.unit.number, i.unit.text, i.profile] for i in items]
            data: dict[str, Any] = {"found": listed, "server": server, "sampling_s": sampling_s}
        case Values(()):
            data = {"alive": True}
        case Values(readings):
            data = {"values": [[r.item, r.value, r.source_s, r.good] for r in readings]}
    return json.dumps(data, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def decode(line: bytes) -> Fact:
    """Return the fact in a line.

    Raises:
        ValueError: If it is invalid; the text says why.
    """
    try:
        data = bounded_json.loads(line)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    match data:
        case {"found": list(listed), "server": str(server), "sampling_s": int() | float() as seconds}:
            if len(data) != 3 or len(listed) > MOST_ITEMS or not _is_number(seconds):
                raise ValueError("too many items, or not the keys of a list of items")
            return ItemsFound(tuple(map(_item, listed)), _text(server), float(seconds))
        case {"alive": True} if len(data) == 1:
            return Values()
        case {"values": list(listed)} if len(data) == 1 and 0 < len(listed) <= MOST_ITEMS:
            return Values(tuple(map(_reading, listed)))
        case _:
            raise ValueError("not a fact of the reading process")


def _item(data: Any) -> Item:
    match data:
        case [str(kind), str(name), int(number), str(text), int(profile)] if (
            kind in KINDS and not isinstance(number, bool) and not isinstance(profile, bool)
        ):
            return Item(kind, _text(name), Unit(number, _text(text)), profile)
        case _:
            raise ValueError("an invalid item")


def _reading(data: Any) -> Reading:
    match data:
        case [int(item), value, source_s, bool(good)] if not isinstance(item, bool):
            if value is not None and not isinstance(value, bool | int | float | str):
                raise ValueError("an invalid value")
            if source_s is not None and not _is_number(source_s):
                raise ValueError("an invalid source time")
            return Reading(item, _value(value), None if source_s is None else float(source_s), good)
        case _:
            raise ValueError("an invalid reading")


def _value(value: bool | int | float | str | None) -> Value:
    match value:
        case bool() | None:
            return value
        case str():
            return _text(value)
        case _:
            return float(value) if _is_finite(value) else None


def _is_number(value: Any) -> bool:
    """Return whether it is a time in seconds."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LONGEST_S


def _is_finite(value: int | float) -> bool:
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _text(text: str) -> str:
    return text[:LONGEST_TEXT]


def order_of(names: Sequence[str]) -> list[int]:
    """Return the numbers of names in their natural order: Axis_2 before Axis_10."""
    return sorted(range(len(names)), key=lambda each: _natural(names[each]))


def _natural(name: str) -> list[tuple[int, str]]:
    parts: list[tuple[int, str]] = []
    for char in name:
        digit = char.isascii() and char.isdigit()
        if digit and parts and parts[-1][1] == "":
            parts[-1] = (parts[-1][0] * 10 + int(char), "")
        else:
            parts.append((int(char), "") if digit else (-1, char))
    return parts
