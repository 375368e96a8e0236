"""Driver of controllers that speak the unit protocol: SI above, degrees and millimetres below.

A controller of the paper's own kind sends only ABSOLUTE.DEG. Everything else is optional.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from protocol_gateway.core.codes import code_table
from protocol_gateway.core.records import (
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
from protocol_gateway.core.scales import si_scales
from protocol_gateway.core.stream import Malformed, Unit, UnitStream, printable
from protocol_gateway.driver import (
    Activity,
    ControllerCommand,
    ControllerEvent,
    Hold,
    Home,
    JointsReceived,
    MalformedReceived,
    Mode,
    MoveAbsolute,
    MoveRelative,
    Refused,
    Reset,
    Resume,
    Speed,
    StatusReceived,
    Stop,
    Trace,
    UnknownReceived,
)
from protocol_gateway.errors import CommandError, UnitFormatError
from protocol_gateway.texts import one_line
from robots.joints import JointType

_ACTIVITIES = {activity.value: activity for activity in Activity}
_MODES = {mode.value: mode for mode in Mode}
_WORDS = {Home: "home", Hold: "hold", Resume: "resume", Reset: "reset", Stop: "stop"}
_NO_CODES: Mapping[int, str] = MappingProxyType({})


class UnitDriver:
    """The unit protocol behind `protocol_gateway.driver.Driver`.

    Args:
        joint_types: One a joint, in the order of the controller's numbers.
        codes: The site file's table of type codes; empty: names.

    Raises:
        CodeTableError: If the table cannot be used.
    """

    def __init__(self, joint_types: Sequence[JointType], codes: Mapping[int, str] = _NO_CODES) -> None:
        self._table = code_table(codes)
        self._stream = UnitStream(self._table)
        self._scales = si_scales(joint_types)
        self.units_received = 0
        self.refusals_received = 0

    @property
    def can_stop(self) -> bool:
        """Whether there is a stop unit: a controller of codes does not know the word `stop`."""
        return self._table.can_say(_WORDS[Stop])

    def connected(self) -> None:
        """Forget the unfinished unit of the connection before."""
        self._stream = UnitStream(self._table)

    def receive(self, data: bytes) -> Sequence[ControllerEvent]:
        """Events of the next bytes, cut anywhere."""
        events: list[ControllerEvent] = []
        for received in self._stream.receive(data):
            match received:
                case Unit():
                    self._take(received, events)
                case Malformed(offset, text, reason):
                    events.append(MalformedReceived(offset, text, reason))
        return events

    def encode(self, command: ControllerCommand) -> bytes:
        """The unit that tells a command.

        Raises:
            CommandError: If it has the wrong joint count, or a number that is not finite.
        """
        try:
            return write_unit((self._record(command),), self._table)
        except UnitFormatError as error:
            raise CommandError(f"cannot be sent: {error}") from None

    # -------------------------------------------------------------- from the controller

    def _take(self, unit: Unit, events: list[ControllerEvent]) -> None:
        positions: list[tuple[float, ...]] = []
        velocities: list[tuple[float, ...]] = []
        time_s: float | None = None
        others: list[Record] = []
        for record in unit.records:
            match record:
                case AbsolutePositions(values) | Velocities(values):
                    # A unit is all or nothing: one record of the wrong length refuses it whole.
                    if len(values) != len(self._scales):
                        events.append(self._wrong_count(values, unit))
                        return
                    (positions if isinstance(record, AbsolutePositions) else velocities).append(
                        self._si(values)
                    )
                case Time(seconds):
                    time_s = seconds
                case _:
                    others.append(record)
        self.units_received += 1
        self.refusals_received += all(isinstance(record, Error) for record in unit.records)
        for index, values in enumerate(positions):
            events.append(
                JointsReceived(values, velocities[index] if index < len(velocities) else None, time_s)
            )
        for record in others:
            _tell(record, unit, time_s, events)
        if time_s is not None and not positions and not others:
            events.append(StatusReceived(controller_time_s=time_s))

    def _wrong_count(self, values: Sequence[float], unit: Unit) -> MalformedReceived:
        reason = f"{len(values)} values for {len(self._scales)} joints"
        return MalformedReceived(unit.offset, printable(unit.data), reason)

    def _si(self, values: Sequence[float]) -> tuple[float, ...]:
        return tuple([value * scale for value, scale in zip(values, self._scales, strict=True)])

    # ---------------------------------------------------------------- to the controller

    def _record(self, command: ControllerCommand) -> Record:
        match command:
            case MoveAbsolute(positions):
                return AbsolutePositions(self._legacy(positions))
            case MoveRelative(offsets):
                return RelativePositions(self._legacy(offsets))
            case Speed(percent):
                return Command((f"speed={write_number(percent)}",))
            case Trace(on):
                return Command(("trace" if on else "untrace",))
            case _:
                return Command((_WORDS[type(command)],))

    def _legacy(self, values: Sequence[float]) -> tuple[float, ...]:
        if len(values) != len(self._scales):
            raise CommandError(f"{len(values)} values for {len(self._scales)} joints")
        # Nine decimals are finer than any encoder, and keep pi/2 readable as 90.00.
        return tuple([round(value / scale, 9) for value, scale in zip(values, self._scales, strict=True)])


def _tell(record: Record, unit: Unit, time_s: float | None, events: list[ControllerEvent]) -> None:
    match record:
        case Error(number, text):
            events.append(Refused(number, one_line(text)))
        case Status(words):
            events.append(_status(words, time_s))
            if unknown := tuple(word for word in words if not _known(word)):
                events.append(UnknownReceived("STATUS", unknown, unit.data))
        case Unknown(type_name, items):
            events.append(UnknownReceived(type_name, items, unit.data))
        case Command(words):
            # A controller that sends a client's record commands nobody: shown raw.
            events.append(UnknownReceived("COMMAND", words, unit.data))
        case RelativePositions(values):
            events.append(UnknownReceived("RELATIVE.DEG", tuple(map(write_number, values)), unit.data))


def _known(word: str) -> bool:
    return word in _ACTIVITIES or word in _MODES or word in ("homed", "trace")


def _status(words: Sequence[str], time_s: float | None) -> StatusReceived:
    """A status record; `homed` and `trace` have no opposite word, so in a status their absence says no."""
    return StatusReceived(
        activity=next((_ACTIVITIES[word] for word in reversed(words) if word in _ACTIVITIES), None),
        mode=next((_MODES[word] for word in reversed(words) if word in _MODES), None),
        homed="homed" in words,
        trace="trace" in words,
        controller_time_s=time_s,
    )
