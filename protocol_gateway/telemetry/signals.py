"""Signals of a controller, which are its values other than joints: the newest of each, and their publication.

One message has all of them, so that a late joiner, a recording and a plain Zenoh client need no earlier one.
It is published when a report arrives, at most

    10 times a second if a number has changed, 50 times a second if a text or a boolean has,
    once a second if nothing has, so that a value that stays the same does not look stale.

What a report changes too soon for this is published within 0.1 s. Without a report nothing is published.
"""

import math
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from protocol_gateway.link.timestamping import EventTime
from protocol_gateway.seam import Signal, SignalsReceived, SignalValue
from protocol_gateway.seam.text_limits import LONGEST_TEXT
from protocol_gateway.telemetry.journal import Journal
from robomesh.publications.publisher import Publisher
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import one_line
from robomesh.wire.session import Session

MOST_SIGNALS = 256
"""Most signals of a robot; the rest is left out, and reported once a connection."""
_NUMBERS_EACH_S, _CHANGES_EACH_S, _SAME_EACH_S = 0.1, 0.02, 1.0
_S = schema.Event.Severity
# What the arm carries, and in which frame it works: a change at the controller is an event.
_SETUP: Mapping[str, tuple[str, re.Pattern[str]]] = {
    "controller.tool_changed": ("tool", re.compile(r"tool\.(number|name|offset\..*)")),
    "controller.payload_changed": ("payload", re.compile(r"payload\..*")),
    "controller.frame_changed": ("user frame", re.compile(r"frame\..*")),
}
_LEAST_CHANGE = 1e-6


@dataclass(slots=True, eq=False)
class _Entry:
    """Newest value of a signal; None: not reported."""

    name: str
    unit: str
    row: schema.Signal = field(default_factory=schema.Signal)
    changed: bool = True
    event: str = ""  # code of the event that reports a change
    raw: SignalValue | None = None
    value: SignalValue | None = None
    received: EventTime = field(default_factory=lambda: EventTime(0.0, 0))
    valid_until_s: float = 0.0

    def take(self, raw: SignalValue | None) -> None:
        self.raw, self.changed = raw, True
        match raw:
            case str():
                self.value = one_line(raw, LONGEST_TEXT)
            case bool() | None:
                self.value = raw
            case _:
                self.value = float(raw) if math.isfinite(raw) else None

    def write(self) -> None:
        """Write the value into the row of the message."""
        self.changed = False
        match self.value:
            case bool():
                self.row.on = self.value
            case str():
                self.row.text = self.value
            case float():
                self.row.number = self.value


def measure_signals(session: Session, robots: Mapping[str, "Signals"]) -> None:
    """Register a metric of the robots' signals that are numbers and booleans.

    Args:
        robots: Signals by robot name.
    """

    def read() -> dict[tuple[str, ...], float]:
        now_s = time.monotonic()
        return {
            (robot, name, unit): float(value)
            for robot, signals in robots.items()
            for name, (unit, value) in signals.current(now_s).items()
            if not isinstance(value, str)
        }

    text = "Signals of the controller that are current: numbers in their unit, booleans as 1 and 0"
    session.measure("signal", text, read, labels=("robot", "name", "unit"))


class Signals:
    """Newest signals of one robot, and their publication.

    Args:
        joint_names: In the order of the driver's joint numbers.
        confirmed: Tool, payload and frame that were confirmed last, by signal.
    """

    def __init__(
        self,
        publisher: Publisher,
        journal: Journal,
        joint_names: Sequence[str],
        confirmed: Mapping[str, SignalValue] = MappingProxyType({}),
    ) -> None:
        self._publisher, self._journal = publisher, journal
        self._joint_names = joint_names
        # Tool, payload and frame: as reported last, and as they were first or confirmed.
        self._setup: dict[str, SignalValue] = {}
        self._confirmed = dict(confirmed)
        self.forget()

    def forget(self) -> None:
        """Drop all values after the link was lost, but not the tool, payload and frame to compare with."""
        self._entries: dict[str, _Entry] = {}
        self._by_signal: dict[Signal, _Entry] = {}
        self._message = schema.Signals()
        self._shown: list[_Entry] = []  # the entries of its rows
        self._newest: EventTime | None = None
        self._numbers_changed = self._states_changed = self._unpublished = False
        self._next_s = self._next_change_s = self._next_same_s = float("-inf")
        self._next_removal_s = float("-inf")
        self._said_too_many = False

    def take(self, report: SignalsReceived, received: EventTime) -> None:
        """Take a report's values, and publish if it is time."""
        valid_until_s = received.monotonic_s + report.valid_for_s
        changes: dict[str, list[str]] = {}
        for signal, raw in report.values:
            entry = self._by_signal.get(signal) or self._entry(signal, received.monotonic_s)
            if entry is None:
                continue
            # 1 and True are equal, but one is a number.
            if raw != entry.raw or type(raw) is not type(entry.raw):
                before = entry.value
                entry.take(raw)
                if isinstance(before, float) and isinstance(entry.value, float):
                    self._numbers_changed = True
                elif entry.value != before or type(entry.value) is not type(before):
                    self._states_changed = True
                if entry.event and entry.value is not None and (change := self._set_up(entry, entry.value)):
                    changes.setdefault(entry.event, []).append(change)
            entry.received, entry.valid_until_s = received, valid_until_s
        self._newest, self._unpublished = received, True
        self.publish_due(received.monotonic_s)
        for code, some in changes.items():
            text = f"the {_SETUP[code][0]} was changed at the controller: {', '.join(some)}"
            self._journal.report(_S.INFO, code, text, changes=", ".join(some))

    def _set_up(self, entry: _Entry, value: SignalValue) -> str:
        """Keep a value of tool, payload or frame; return its change in words, or an empty text."""
        before = self._setup.get(entry.name, self._confirmed.get(entry.name))
        if before is None and len(self._setup) >= MOST_SIGNALS:
            return ""
        self._setup[entry.name] = value
        self._confirmed.setdefault(entry.name, value)
        return _change(entry.name, before, value, entry.unit) if before is not None else ""

    @property
    def has_set_up(self) -> bool:
        """True if tool, payload or frame were reported."""
        return bool(self._setup)

    @property
    def confirmed(self) -> dict[str, SignalValue]:
        """Tool, payload and frame as they were first reported or confirmed, by signal."""
        return self._confirmed

    @property
    def unconfirmed(self) -> tuple[str, ...]:
        """Changes of tool, payload and frame since they were first reported or confirmed, in words."""
        found = (_change(name, self._confirmed[name], value) for name, value in self._setup.items())
        return tuple(each for each in found if each)

    def confirm(self) -> None:
        """Take tool, payload and frame as they are now for right."""
        self._confirmed = self._confirmed | self._setup

    def publish_due(self, now_s: float) -> None:
        """Publish what was reported since the last message, if it is time; call it repeatedly."""
        if not self._unpublished:
            return
        due_s = self._next_same_s
        if self._states_changed:
            due_s = self._next_change_s
        elif self._numbers_changed:
            due_s = self._next_s
        if now_s >= due_s:
            self._publish(now_s)

    def current(self, now_s: float) -> dict[str, tuple[str, SignalValue]]:
        """Return the unit and value of each signal that is known now, by its name."""
        return {
            name: (entry.unit, entry.value)
            for name, entry in tuple(self._entries.items())
            if entry.value is not None and now_s < entry.valid_until_s
        }

    def _entry(self, signal: Signal, now_s: float) -> _Entry | None:
        """Return the entry of a signal that is seen for the first time; None: there are too many."""
        name = self._name(signal)
        entry = self._entries.get(name)
        if entry is None and len(self._entries) >= MOST_SIGNALS:
            self._remove_old(now_s)
        if entry is None and len(self._entries) >= MOST_SIGNALS:
            if not self._said_too_many:
                self._said_too_many = True
                text = (
                    f"the controller reports more than {MOST_SIGNALS} signals: {name} and others are left "
                    "out. Let its driver report fewer"
                )
                self._journal.report(_S.WARNING, "signals.too_many", text, signal=name, most=MOST_SIGNALS)
            return None
        if entry is None:
            event = next((code for code, (_, names) in _SETUP.items() if names.fullmatch(name)), "")
            entry = _Entry(name, signal.unit, event=event)
            self._entries[name] = entry
            self._entries = dict(sorted(self._entries.items()))
        elif entry.unit != signal.unit:
            entry.unit = signal.unit
            self._shown, self._states_changed = [], True
            self._by_signal = {each: own for each, own in self._by_signal.items() if own is not entry}
        self._by_signal[signal] = entry
        return entry

    def _name(self, signal: Signal) -> str:
        if signal.joint is None:
            return signal.name
        first, _, rest = signal.name.partition(".")
        return f"{first}.{self._joint_names[signal.joint]}.{rest}"

    def _remove_old(self, now_s: float) -> None:
        """Make room once a second, so that thousands of names in each report stay cheap."""
        if now_s < self._next_removal_s:
            return
        self._next_removal_s = now_s + 1.0
        self._entries = {name: each for name, each in self._entries.items() if now_s < each.valid_until_s}
        kept = {id(each) for each in self._entries.values()}
        self._by_signal = {signal: each for signal, each in self._by_signal.items() if id(each) in kept}

    def _publish(self, now_s: float) -> None:
        newest = self._newest
        assert newest is not None
        self._unpublished = self._numbers_changed = self._states_changed = False
        # On a fixed grid, so that 125 Hz gives 10 Hz and not 9.6; a gap restarts the grid.
        self._next_s = max(self._next_s + _NUMBERS_EACH_S, now_s + _NUMBERS_EACH_S / 2)
        self._next_change_s, self._next_same_s = now_s + _CHANGES_EACH_S, now_s + _SAME_EACH_S
        shown = [
            entry
            for entry in self._entries.values()
            if entry.value is not None and newest.monotonic_s < entry.valid_until_s
        ]
        message = self._message
        message.timestamp.seconds, message.timestamp.nanos = divmod(newest.wall_ns, 1_000_000_000)
        if shown != self._shown:
            # New rows take eight times as long as other values in the same ones.
            del message.signals[:]
            for entry in shown:
                entry.row, entry.changed = message.signals.add(name=entry.name, unit=entry.unit), True
            self._shown = shown
        for entry in shown:
            if entry.changed:
                entry.write()
            if entry.received is not newest:
                entry.row.age_s = max(newest.monotonic_s - entry.received.monotonic_s, 0.0)
            elif entry.row.HasField("age_s"):
                entry.row.ClearField("age_s")
        self._publisher.put(message, source_time_ns=newest.wall_ns, dated_by=newest.clock)


def _change(name: str, before: SignalValue, now: SignalValue, unit: str = "") -> str:
    """Return a change in words, or an empty text."""
    if isinstance(before, float) and isinstance(now, float):
        same = abs(now - before) <= _LEAST_CHANGE
    else:
        same = now == before and type(now) is type(before)
    return "" if same else f"{name} {_shown(before)} → {_shown(now)} {unit}".rstrip()


def _shown(value: SignalValue) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
