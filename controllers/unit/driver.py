"""Driver of controllers that speak the unit protocol.

It converts the protocol's degrees and millimetres to SI units, and back. The controllers of the paper send
only ABSOLUTE.DEG; all other records are optional.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import lru_cache
from itertools import zip_longest
from operator import mul
from types import MappingProxyType

from protocol_gateway.seam import (
    ALL,
    COMMANDS,
    Activity,
    Capabilities,
    Channel,
    ControllerCommand,
    ControllerEvent,
    Effects,
    Hold,
    Home,
    JointsReceived,
    MalformedReceived,
    Mode,
    MoveAbsolute,
    MoveRelative,
    Open,
    Refused,
    Report,
    Reset,
    Resume,
    Send,
    Speed,
    StatusReceived,
    Stop,
    Trace,
    UnknownReceived,
)
from protocol_gateway.seam.errors import CommandError, UnitFormatError
from protocol_gateway.unit_protocol.codes import code_table
from protocol_gateway.unit_protocol.grammar import TERMINATOR
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Command,
    Error,
    Record,
    RelativePositions,
    Status,
    Time,
    Unknown,
    Velocities,
    write_number,
    write_unit,
)
from protocol_gateway.unit_protocol.scales import si_scales
from protocol_gateway.unit_protocol.stream import Malformed, Unit, UnitStream, printable
from robomesh import reason_codes as codes
from robomesh.texts import one_line
from robots.kinematics.joints import JointType

UNITS = Channel(name="units", carries=ALL)
"""The one connection, which carries everything."""

_ACTIVITIES = {activity.value: activity for activity in Activity}
_MODES = {mode.value: mode for mode in Mode}
_WORDS: dict[type[ControllerCommand], tuple[str, ...]] = {
    Home: ("home",),
    Hold: ("hold",),
    Resume: ("resume",),
    Reset: ("reset",),
    Stop: ("stop",),
    Trace: ("trace", "untrace"),
    Speed: ("speed",),
}
_NO_CODES: Mapping[int, str] = MappingProxyType({})


class UnitDriver:
    """Driver of the unit protocol (`protocol_gateway.seam.Driver`).

    Args:
        joint_types: Types of the joints, in the order of the controller's values.
        codes: The site file's table of type codes; empty: names.
        relay: Callback with every well-formed unit: its bytes with the "@", whether it holds only refusals,
            and a key; a newer unit of the same key replaces an older one.

    Raises:
        CodeTableError: If the table is invalid.
    """

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str] = _NO_CODES,
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        self._table = code_table(codes)
        self._stream = UnitStream(self._table)
        self._scales = si_scales(joint_types)
        self._relay = relay
        # Of a controller that knows only codes, those that have one.
        without = {kind for kind, words in _WORDS.items() if not all(map(self._table.supports, words))}
        self.capabilities = Capabilities(commands=COMMANDS - without, jogs=not without & {Hold, Reset})

    ports: frozenset[str] = frozenset()
    # Nothing is ever sent but an operator's command.
    requests_a_second = 0.0

    def started(self, now_s: float) -> Effects:
        """Connect to the site file's port."""
        return (Open(UNITS),)

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Discard the unfinished unit of the previous connection."""
        self._stream = UnitStream(self._table)
        return ()

    skipped = opened

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Do nothing: the link connects again."""
        return ()

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Do nothing: no timer is set."""
        return ()

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Report the events of the next bytes, split anywhere."""
        return (self.read(data),)

    def read(self, data: bytes) -> Report:
        """Return what the next bytes report, split anywhere."""
        events: list[ControllerEvent] = []
        units = refusals = 0
        for received in self._stream.receive(data):
            match received:
                case Unit():
                    answer = self._read_unit(received, events)
                    if answer is not None:
                        units += 1
                        refusals += answer
                case Malformed(offset, text, reason):
                    events.append(MalformedReceived(offset, text, reason))
        return Report(events, units, refusals)

    def prepare(self, *commands: ControllerCommand) -> bytes:
        """Return commands as one unit, a record each.

        Raises:
            CommandError: If a command has the wrong joint count, or a number that is not finite.
        """
        try:
            return write_unit([self._record(command) for command in commands], self._table)
        except UnitFormatError as error:
            raise CommandError(codes.COMMAND_NOT_A_UNIT(detail=error)) from None

    def command(self, prepared: bytes, now_s: float) -> Effects:
        """Send a unit."""
        return (Send(UNITS, prepared),)

    # -------------------------------------------------------------- from the controller

    def _read_unit(self, unit: Unit, events: list[ControllerEvent]) -> bool | None:
        """Append a unit's events; return whether it holds only refusals; None: it cannot be used."""
        positions: list[tuple[float, ...]] = []
        velocities: list[tuple[float, ...]] = []
        time_s: float | None = None
        others: list[Record] = []
        for record in unit.records:
            match record:
                case AbsolutePositions(values) | Velocities(values):
                    # All or nothing: one record of the wrong length rejects the whole unit.
                    if len(values) != len(self._scales):
                        events.append(self._wrong_count(values, unit))
                        return None
                    si = tuple(map(mul, values, self._scales))
                    (positions if isinstance(record, AbsolutePositions) else velocities).append(si)
                case Time(seconds):
                    time_s = seconds
                case _:
                    others.append(record)
        answer = bool(others) and all(isinstance(record, Error) for record in unit.records)
        if self._relay is not None:
            self._relay(unit.data + TERMINATOR, answer, frozenset(map(type, unit.records)))
        for si, velocity in zip_longest(positions, velocities[: len(positions)]):
            events.append(JointsReceived(si, velocity, time_s))
        for record in others:
            _append_event(record, unit, time_s, events)
        if time_s is not None and not positions and not others:
            events.append(StatusReceived(controller_time_s=time_s))
        return answer

    def _wrong_count(self, values: Sequence[float], unit: Unit) -> MalformedReceived:
        reason = codes.JOINT_VALUES(count=len(values), joints=len(self._scales))
        return MalformedReceived(unit.offset, printable(unit.data), reason.text, joint_count=reason)

    # ---------------------------------------------------------------- to the controller

    def _record(self, command: ControllerCommand) -> Record:
        match command:
            case MoveAbsolute(positions):
                return AbsolutePositions(self._protocol_values(positions))
            case MoveRelative(offsets):
                return RelativePositions(self._protocol_values(offsets))
            case Speed(percent):
                return Command((f"speed={write_number(percent)}",))
            case Trace(on):
                return Command(("trace" if on else "untrace",))
            case _:
                return Command(_WORDS[type(command)])

    def _protocol_values(self, values: Sequence[float]) -> tuple[float, ...]:
        if len(values) != len(self._scales):
            raise CommandError(codes.COMMAND_VALUES(count=len(values), joints=len(self._scales)))
        # Nine decimals are finer than any encoder, and pi/2 becomes 90.00.
        return tuple([round(value / scale, 9) for value, scale in zip(values, self._scales, strict=True)])


def _append_event(record: Record, unit: Unit, time_s: float | None, events: list[ControllerEvent]) -> None:
    match record:
        case Error(number, text):
            events.append(Refused(number, one_line(text)))
        case Status(words):
            said, unknown = _parse_status(words)
            events.append(StatusReceived(*said, time_s))
            if unknown:
                events.append(UnknownReceived("STATUS", unknown, unit.data, time_s))
        case Unknown(type_name, items):
            events.append(UnknownReceived(type_name, items, unit.data, time_s))
        case Command(words):
            # Commands from a controller have no effect: published raw.
            events.append(UnknownReceived("COMMAND", words, unit.data, time_s))
        case RelativePositions(values):
            items = tuple(map(write_number, values))
            events.append(UnknownReceived("RELATIVE.DEG", items, unit.data, time_s))


# A controller repeats the same few status records.
@lru_cache(maxsize=64)
def _parse_status(
    words: tuple[str, ...],
) -> tuple[tuple[Activity | None, Mode | None, bool, bool], tuple[str, ...]]:
    """Return a status record's values, and its unknown words.

    `homed` and `trace` have no opposite word, so their absence means no. Of contradictory words the one that
    forbids motion counts; if none forbids motion, the activity is unknown.
    """
    said = {_ACTIVITIES[word] for word in words if word in _ACTIVITIES}
    modes = {_MODES[word] for word in words if word in _MODES}
    forbid = [each for each in (Activity.FAULT, Activity.STOPPED) if each in said]
    activity = said.pop() if len(said) == 1 else next(iter(forbid), None)
    mode = Mode.LOCAL if Mode.LOCAL in modes else Mode.REMOTE if modes else None
    unknown = tuple(word for word in words if word not in ("homed", "trace", *_ACTIVITIES, *_MODES))
    return (activity, mode, "homed" in words, "trace" in words), unknown
