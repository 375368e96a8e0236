"""Driver that reads an OPC UA server: it decodes the output of its reading process, and sends nothing.

The process subscribes to the server and prints each notification (`facts`). The server's keep-alives say that
nothing has changed, so the driver reports all values again. Without either, all values become stale.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from controllers.opcua import signals
from controllers.opcua.facts import ItemsFound, Reading, Value, decode
from controllers.opcua.joints import (
    LEAST_SPREAD_S,
    Joiner,
    NotShownError,
    axes_of,
    check_declared,
)
from controllers.opcua.settings import OpcUaSettings, to_text
from protocol_gateway.driver_parts.only_reads import OnlyReads, check_no_type_codes
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    Capabilities,
    Carries,
    Channel,
    ControllerEvent,
    Effects,
    JointsReceived,
    MalformedReceived,
    Mode,
    Open,
    Report,
    Severity,
    Signal,
    SignalsReceived,
    SoftwareReceived,
    StatusReceived,
)
from robomesh.texts import one_line
from robots.kinematics.joints import JointType

OPCUA = Channel(name="opcua", carries=Carries.READING, program="controllers.opcua.reader.process")

# All signals are repeated this often, so that they stay known.
_ALL_SIGNALS_EACH_S = 1.0
# Joints that did not change are repeated this often while other values change.
_JOINTS_EACH_S = 0.2
_LONGEST_LINE = 1 << 19
# Of rad or m, beyond noise at rest; the arm counts as moving for this long after it.
_MOVED, _MOVES_FOR_S = 1e-3, 0.5
_STOPS = frozenset({"emergency_stop", "protective_stop"})
_IDENTITY = frozenset({"software", "manufacturer", "model", "serial"})
_MODES = {
    1.0: Mode.LOCAL,  # manual, reduced speed
    2.0: Mode.LOCAL,  # manual, high speed
    3.0: Mode.LOCAL,  # automatic, started at the controller
    4.0: Mode.REMOTE,  # automatic, external
}


class OpcUaDriver(OnlyReads):
    """Driver of OPC UA (`protocol_gateway.seam.Driver`).

    Raises:
        GatewaySettingsError: If the settings do not fit the model, or there are type codes.
    """

    ports: frozenset[str] = frozenset()
    requests_a_second = 0.0

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        check_no_type_codes("opcua", codes)
        self._settings = options if isinstance(options, OpcUaSettings) else OpcUaSettings()
        self._joint_types = joint_types
        check_declared(self._settings.joints, joint_types)
        mapping = repr([self._settings.device, *self._settings.joints])
        self.capabilities = Capabilities(commands=frozenset(), joint_mapping=mapping)
        # Kept over a lost link, so that they are not reported again.
        self._server = self._identity = ""
        self._stops: set[str] = set()
        self._begin()

    def _begin(self) -> None:
        self._line = bytearray()
        self._state: _State | None = None

    # -------------------------------------------------------------------------- seam

    def started(self, now_s: float) -> Effects:
        """Start the reading process."""
        return (Open(OPCUA, settings=to_text(self._settings)),)

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Discard what the last connection reported."""
        self._begin()
        return ()

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Report the facts of whole lines."""
        *ends, rest = data.split(b"\n")
        events: list[ControllerEvent] = []
        units = 0
        for end in ends:
            line = bytes(self._line) + end
            self._line.clear()
            try:
                events += self._events(line, now_s)
            except ValueError as error:
                events.append(_malformed(line, str(error)))
            else:
                units += 1
        self._line += rest
        if len(self._line) > _LONGEST_LINE:
            events.append(_malformed(bytes(self._line[:200]), "a line without an end"))
            self._line.clear()
        return (Report(events, units),) if events or units else ()

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Go on at the next line."""
        self._line.clear()
        return ()

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Know nothing until the next connection."""
        self._begin()
        return ()

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Do nothing: no timer is set."""
        return ()

    # ------------------------------------------------------------------------- facts

    def _events(self, line: bytes, now_s: float) -> list[ControllerEvent]:
        fact = decode(line)
        if isinstance(fact, ItemsFound):
            return self._on_found(fact)
        if self._state is None:
            raise ValueError("values before the list of items")
        events = self._state.take(fact.readings, now_s)
        for name, stopped in self._state.stops():
            if stopped is True and name not in self._stops:
                self._stops.add(name)
                events.append(AlarmReceived(Severity.ERROR, f"{name} is on", name))
            elif stopped is False:
                self._stops.discard(name)
        identity = self._state.identity
        if identity and identity != self._identity:
            self._identity = identity
            events.append(AlarmReceived(Severity.INFO, identity))
        if software := self._state.new_software:
            events.append(SoftwareReceived(software))
        return events

    def _on_found(self, found: ItemsFound) -> list[ControllerEvent]:
        if self._state is not None:
            raise ValueError("a second list of items")
        self._state = _State(found, self._settings, self._joint_types)
        events: list[ControllerEvent] = []
        if found.server and found.server != self._server:
            self._server = found.server
            events.append(AlarmReceived(Severity.INFO, found.server))
        if self._state.not_shown:
            text = f"joints are not shown: {self._state.not_shown}"
            events.append(AlarmReceived(Severity.WARNING, text))
        return events


@dataclass(slots=True)
class _Motion:
    """Detector of motion by the positions."""

    since: tuple[float, ...] | None = None
    moved_s: float = float("-inf")

    def add(self, positions: tuple[float, ...], now_s: float) -> bool:
        if self.since is None:
            self.since = positions
        elif any(abs(one - other) > _MOVED for one, other in zip(self.since, positions, strict=True)):
            self.since, self.moved_s = positions, now_s
        return now_s - self.moved_s < _MOVES_FOR_S


class _State:
    """Values that one connection has reported.

    Attributes:
        not_shown: Why there are no joints; empty: there are.
        new_software: Version of the controller's software, if the last notification had it; empty otherwise.
    """

    def __init__(self, found: ItemsFound, settings: OpcUaSettings, joint_types: Sequence[JointType]) -> None:
        self._items = found.items
        self._numbers: dict[str, list[int]] = {}
        for number, item in enumerate(found.items):
            self._numbers.setdefault(item.kind, []).append(number)
        self._known: dict[int, Reading] = {}
        self._joiner: Joiner | None = None
        self.not_shown = ""
        names: list[str] = []
        try:
            axes = axes_of(found, settings.joints, joint_types)
        except NotShownError as error:
            self.not_shown = str(error)
        else:
            names = [each.name for each in axes]
            self._joiner = Joiner(axes, max(found.sampling_s, LEAST_SPREAD_S))
        self._signals, without_unit = signals.signals_of(found.items, names, settings.signals)
        self._without_unit = one_line(", ".join(without_unit)) or None
        self._problem = self.not_shown
        self._spread_s: float | None = None
        self._motion = _Motion()
        self._moves: bool | None = None
        self._next_all_s = self._next_joints_s = float("-inf")
        self.new_software = ""

    def take(self, readings: Sequence[Reading], now_s: float) -> list[ControllerEvent]:
        """Take a notification, or a keep-alive without readings; return what to report."""
        for each in readings:
            if not 0 <= each.item < len(self._items):
                raise ValueError(f"a value of item {each.item}; there are {len(self._items)}")
        self.new_software = ""
        for each in readings:
            self._known[each.item] = each
            if self._items[each.item].kind == "software" and each.good and isinstance(each.value, str):
                self.new_software = each.value
        events: list[ControllerEvent] = []
        before = self._problem
        if self._joiner is not None:
            joined = self._joiner.take(readings)
            if isinstance(joined, str):
                self._problem, self._moves = joined, None
            else:
                self._problem, self._spread_s = "", joined.spread_s
                self._moves = self._motion.add(joined.positions, now_s)
                if joined.source_s is not None or not readings or now_s >= self._next_joints_s:
                    self._next_joints_s = now_s + _JOINTS_EACH_S
                    events.append(JointsReceived(joined.positions, joined.velocities, joined.source_s))
        events.append(StatusReceived(activity=self._activity(), mode=self._mode()))
        report = self._all() if now_s >= self._next_all_s else self._changed(readings, before)
        if now_s >= self._next_all_s:
            self._next_all_s = now_s + _ALL_SIGNALS_EACH_S
        if report:
            events.append(SignalsReceived(report))
        return events

    def _all(self) -> list[tuple[Signal, Value]]:
        report = [self._signals[item].of(self._good(item)) for item in self._signals]
        return [
            *report,
            (signals.JOINTS, self._problem or "shown"),
            (signals.SPREAD, self._spread_s),
            (signals.WITHOUT_UNIT, self._without_unit),
        ]

    def _changed(self, readings: Sequence[Reading], before: str) -> list[tuple[Signal, Value]]:
        report = [self._signals[r.item].of(self._good(r.item)) for r in readings if r.item in self._signals]
        if self._problem != before:
            report.append((signals.JOINTS, self._problem or "shown"))
        return report

    def _good(self, item: int) -> Value:
        reading = self._known.get(item)
        return reading.value if reading is not None and reading.good else None

    def _values(self, kind: str) -> list[Value]:
        return [self._good(number) for number in self._numbers.get(kind, ())]

    def _of_kinds(self, kinds: frozenset[str]) -> list[int]:
        return sorted(number for kind in kinds for number in self._numbers.get(kind, ()))

    def _activity(self) -> Activity | None:
        """Return what the arm does.

        At rest it is idle only if no program is loaded: one that waits moves the arm without notice, and the
        server does not say whether it runs.
        """
        # By identity: 1.0 equals True, and a number is no answer here.
        off = any(each is False for each in self._values("in_control"))
        if off or any(stopped is True for _, stopped in self.stops()):
            return Activity.STOPPED
        if self._moves:
            return Activity.MOVING
        loaded = self._values("loaded")
        at_rest = self._moves is False and bool(loaded) and all(each is False for each in loaded)
        return Activity.IDLE if at_rest else None

    def stops(self) -> Iterator[tuple[str, Value]]:
        """Yield the name and value of each signal of a stop."""
        for number in self._of_kinds(_STOPS):
            if number in self._signals:
                yield self._signals[number].signal.name, self._good(number)

    def _mode(self) -> Mode | None:
        modes = self._values("mode")
        value = modes[0] if len(modes) == 1 else None
        return _MODES.get(value) if isinstance(value, float) else None

    @property
    def identity(self) -> str:
        """Software, manufacturer, model and serial number, in a line; empty: not all are reported yet."""
        parts: list[str] = []
        for number in self._of_kinds(_IDENTITY):
            if number not in self._known:
                return ""
            if value := self._good(number):
                parts.append(f"{self._items[number].kind} {value}")
        return one_line(", ".join(parts))


def _malformed(line: bytes, reason: str) -> MalformedReceived:
    return MalformedReceived(0, one_line(line[:200].decode(errors="replace")), reason)
