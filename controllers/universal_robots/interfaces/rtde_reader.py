"""Reader of one RTDE connection, without I/O and without a clock: the handshake, then states.

    sent                         answer
    -----------------------      ------------------------------------------------------
    protocol version 2           accepted; otherwise version 1 is requested
    version of URControl         3 (CB3): at most 125 Hz, 5 and above: at most 500 Hz
    set up outputs               types; without the unknown fields it is sent once more
    start                        accepted; then data packages

The reader never sets up inputs and never sends data, so it takes no input from another client.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from controllers.universal_robots.interfaces import rtde_messages as rtde
from controllers.universal_robots.interfaces.packages import Malformed, Package
from controllers.universal_robots.interfaces.rtde_messages import (
    NOT_FOUND,
    ControllerVersion,
    DataReceived,
    OutputsSetUp,
    PauseAnswered,
    ProtocolVersionAnswered,
    Recipe,
    RtdeEvent,
    RtdeStream,
    StartAnswered,
    TextReceived,
)
from controllers.universal_robots.interfaces.state import (
    OUTPUTS,
    REQUIRED,
    ControllerState,
    controller_state,
)


@dataclass(frozen=True, slots=True)
class Ready:
    """End of the handshake; states follow.

    Attributes:
        protocol_version: 1 or 2.
        frequency_hz: Requested states a second; None with version 1: every control cycle.
        missing: Fields that the controller does not have.
    """

    controller: ControllerVersion
    protocol_version: int
    frequency_hz: float | None
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Failed:
    """The controller cannot be read in this way; the connection has no further use."""

    reason: str


ReaderEvent: TypeAlias = Ready | ControllerState | TextReceived | Malformed | Failed


class RtdeReader:
    """Reader of consecutive connections to one controller.

    The caller sends `connected()` on a new connection, and after each `receive` the bytes of `to_send()`. It
    closes the connection after `Failed`, after a fatal `Malformed`, and if `Ready` takes too long.

    Args:
        frequency_hz: States a second; at most the controller's highest frequency is requested.
        fields: Output fields with their types; they contain the REQUIRED ones.
        registers: Names of those fields that are registers, for `ControllerState.registers`.
    """

    def __init__(
        self, frequency_hz: float, fields: Mapping[str, str] = OUTPUTS, *, registers: Sequence[str] = ()
    ) -> None:
        self._wanted_hz = frequency_hz
        self._fields = fields
        self._registers = registers
        self._connect()

    def _connect(self) -> None:
        self._stream = RtdeStream()
        self._names: tuple[str, ...] = tuple(self._fields)
        self._controller: ControllerVersion | None = None
        self._requested_version = 2
        self._frequency_hz: float | None = None
        self._missing: tuple[str, ...] = ()
        self._to_send = b""
        self._ready = self._failed = False

    @property
    def controller(self) -> ControllerVersion | None:
        """Version of the controller's software; None: not yet known."""
        return self._controller

    def connected(self) -> bytes:
        """Forget the previous connection; return the first request of a new one."""
        self._connect()
        return rtde.request_protocol_version(self._requested_version)

    def to_send(self) -> bytes:
        """Return the bytes to send now, once."""
        data, self._to_send = self._to_send, b""
        return data

    def receive(self, data: bytes) -> Sequence[ReaderEvent]:
        """Return the events of the next bytes, split anywhere."""
        events: list[ReaderEvent] = []
        for package in self._stream.receive(data):
            if self._failed:
                break
            message: RtdeEvent = package if isinstance(package, Malformed) else self._stream.decode(package)
            event = self._event(message, package)
            if event is not None:
                events.append(event)
            self._failed = isinstance(event, Failed)
        return events

    def _event(self, message: RtdeEvent, package: Package | Malformed) -> ReaderEvent | None:
        match message:
            case DataReceived(values):
                # Before the end of the handshake: a package of the previous start.
                return controller_state(values, self._registers) if self._ready else None
            case TextReceived() | Malformed():
                return message
            case ProtocolVersionAnswered(accepted) if self._controller is None:
                return self._version_answered(accepted)
            case ControllerVersion() if self._controller is None:
                self._controller = message
                if self._stream.version > 1:
                    self._frequency_hz = min(self._wanted_hz, message.highest_hz)
                self._set_up()
                return None
            case OutputsSetUp() if self._controller is not None and self._stream.recipe is None:
                return self._outputs_set_up(message)
            case StartAnswered(accepted) if self._stream.recipe is not None and not self._ready:
                return self._started(accepted)
            case PauseAnswered():
                return Failed("the controller paused the data, which was not requested")
            case _:
                return Malformed(package.offset, type(message).__name__, "an answer that was not requested")

    def _version_answered(self, accepted: bool) -> Failed | None:
        if accepted:
            self._stream.version = self._requested_version
            self._to_send += rtde.request_controller_version()
        elif self._requested_version > 1:
            self._requested_version -= 1
            self._to_send += rtde.request_protocol_version(self._requested_version)
        else:
            return Failed("the controller accepts neither protocol version 2 nor 1 of RTDE")
        return None

    def _set_up(self) -> None:
        self._to_send += rtde.set_up_outputs(self._names, self._frequency_hz)

    def _outputs_set_up(self, answer: OutputsSetUp) -> Failed | None:
        if len(answer.types) != len(self._names):
            return Failed(f"the controller sent {len(answer.types)} types for {len(self._names)} fields")
        types = dict(zip(self._names, answer.types, strict=True))
        unknown = tuple(name for name, kind in types.items() if kind == NOT_FOUND)
        if needed := [name for name in REQUIRED if name in unknown]:
            return Failed(f"the controller has no field {needed[0]}")
        other = next(
            (name for name, kind in types.items() if kind not in (NOT_FOUND, self._fields[name])), ""
        )
        if other:
            return Failed(
                f"the controller's field {other} has the type {types[other]}: must be {self._fields[other]}"
            )
        if unknown:
            self._missing += unknown
            self._names = tuple(name for name in self._names if name not in unknown)
            self._set_up()
            return None
        self._stream.recipe = Recipe(self._names, answer.types, answer.recipe_id, needed=REQUIRED)
        self._to_send += rtde.start()
        return None

    def _started(self, accepted: bool) -> Ready | Failed:
        if not accepted:
            return Failed("the controller refused to start the data")
        assert self._controller is not None
        self._ready = True
        return Ready(self._controller, self._stream.version, self._frequency_hz, self._missing)
