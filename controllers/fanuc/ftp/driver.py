"""Driver that reads a controller of FANUC by FTP: the files in which it writes its state, one at a time.

It is the slow way, for controllers without SNPX. The controller writes a file when it is read:

    PASV -> port -> the gateway connects there -> RETR -> the file's bytes, and 226

Each file is reported separately, with the time from its RETR to its end: contents of different files are
never combined. `controllers.fanuc.ftp.protocol` has all commands that can be sent.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from enum import Enum, auto
from pathlib import Path

from controllers.fanuc import codes as fanuc_codes
from controllers.fanuc import signals
from controllers.fanuc.axes import Axes, FanucSettings, signal_bits
from controllers.fanuc.data import Alarm
from controllers.fanuc.driver import alarm_of
from controllers.fanuc.ftp import file_signals, files
from controllers.fanuc.ftp import protocol as ftp
from controllers.fanuc.ftp.files import FilePosition, ListedAlarm, Reading, Steps
from controllers.fanuc.ftp.protocol import File, Reply, ReplyStream
from protocol_gateway.driver_parts.only_reads import OnlyReads, check_no_type_codes
from protocol_gateway.driver_parts.polling import Polling, Regular
from protocol_gateway.seam import (
    NOTHING,
    AxesUndeclared,
    Capabilities,
    Carries,
    Channel,
    Close,
    ControllerEvent,
    Effect,
    Effects,
    JointsReceived,
    MalformedReceived,
    Open,
    Report,
    Send,
    SetTimer,
    SoftwareReceived,
)
from protocol_gateway.seam.errors import GatewaySettingsError
from protocol_gateway.seam.secret_file import read_password
from robomesh import reason_codes
from robomesh.texts import one_line
from robots.kinematics.joints import JointType

FTP = Channel(name="ftp", carries=Carries.READING)
FILE = Channel(name="file", carries=NOTHING, brief=True)
"""Connection for one file, at a port that the controller names."""
TIMEOUT_S = 5.0
"""Time after which a file is given up, and with it the connection, whose state is then unknown."""

_PERIODS_S: Mapping[File, float] = {
    File.SIGNALS: 2.0,
    File.SAFETY: 2.0,
    File.ALARMS: 2.0,
    File.REGISTERS: 5.0,
    File.FRAMES: 10.0,
}
"""Time from one reading of a file to the next; CURPOS.DG has the site file's `rate`."""
# A value is known for this many periods.
_PERIODS_KNOWN = 3.0
_AGAIN_S, _LOG_IN_AGAIN_S = 5.0, 30.0
_MOST_ALARMS = 100


class _Step(Enum):
    """State of the connection."""

    CLOSED = auto()
    GREETING = auto()
    USER = auto()
    PASSWORD = auto()
    BINARY = auto()
    FOLDER = auto()
    IDLE = auto()
    PASSIVE = auto()
    """A port for the next file is awaited."""
    CONNECTING = auto()
    """The connection for the file is awaited."""
    READING = auto()


def fanuc_ftp_driver(
    joint_types: Sequence[JointType],
    codes: Mapping[int, str],
    *,
    relay: Callable[[bytes, bool, Hashable], None] | None = None,
    options: object = None,
) -> "FtpDriver":
    """Return the driver of a robot, after it has read the password's file.

    Raises:
        GatewaySettingsError: If the file cannot be used, the settings do not fit the model, or there are type
            codes.
    """
    settings = options if isinstance(options, FanucSettings) else FanucSettings()
    path = settings.password_file
    password = read_password(Path(path), "password_file") if path else ""
    return FtpDriver(joint_types, codes, options=settings, password=password)


class FtpDriver(OnlyReads):
    """Driver of FANUC's files by FTP (`protocol_gateway.seam.Driver`).

    Raises:
        GatewaySettingsError: If the settings do not fit the model, or there are type codes.
    """

    ports: frozenset[str] = frozenset()

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        options: FanucSettings,
        password: str = "",
    ) -> None:
        check_no_type_codes("fanuc-ftp", codes)
        self._settings = options
        try:
            self._user, self._password = ftp.user(options.user), ftp.password(password)
        except ValueError as error:
            raise GatewaySettingsError(f"fanuc user or password: {error}") from None
        self._axes = Axes(options, joint_types)
        self._io = {each: signals.io_signals(each) for each in map(signal_bits, options.io)}
        known = options.j23 is not None
        self.capabilities = Capabilities(
            commands=frozenset(),
            absolute=True,
            no_joints=None if known else fanuc_codes.AXES_UNDECLARED(),
            reports_pose=known,
            joint_mapping=self._axes.mapping,
            slow_hz=options.rate_hz,
        )
        self._periods = {File.POSITION: 1.0 / options.rate_hz, **_PERIODS_S}
        if not options.registers:
            del self._periods[File.REGISTERS]
        if not options.tools:
            del self._periods[File.FRAMES]
        # Two commands for each file. A new connection begins with a log-in and all files together.
        regular_hz = 2.0 * sum(1.0 / each for each in self._periods.values())
        self.requests_a_second = regular_hz + 2.0 * len(self._periods) + 4.0
        # Kept over a lost connection: alarms are not reported again.
        self._alarms: frozenset[ListedAlarm] = frozenset()
        self._waits = False
        self._begin()

    def _begin(self) -> None:
        self._step = _Step.CLOSED
        self._replies = ReplyStream()
        self._polling = Polling([Regular(file, each) for file, each in self._periods.items()], ())
        self._refused: set[File] = set()
        self._software = self._undeclared = ""
        self._tool: int | None = None
        self._invalid = False
        self._begin_file(0.0)

    def _begin_file(self, now_s: float) -> None:
        self._reading: Reading[list[ControllerEvent]] | None = None
        self._read_s = now_s
        self._whole = self._ended = False

    # -------------------------------------------------------------------------- seam

    def started(self, now_s: float) -> Effects:
        """Open the site file's port, which is 21 on a controller."""
        return (Open(FTP),)

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Wait for the controller's greeting, or read the file for which the connection is."""
        if channel == FTP:
            self._begin()
            self._step = _Step.GREETING
            return (Close(FILE), SetTimer(now_s + TIMEOUT_S))
        asked = self._polling.asked
        if self._step is not _Step.CONNECTING or asked is None:
            return (Close(FILE),)
        self._step = _Step.READING
        self._begin_file(now_s)
        self._reading = Reading(self._events(asked.read))
        return (Send(FTP, ftp.read(asked.read)),)

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Read replies, or the bytes of a file."""
        if channel != FTP:
            return self._receive_file(data, now_s)
        effects: list[Effect] = []
        try:
            for reply in self._replies.receive(data):
                effects += self._on_reply(reply, now_s)
        except ValueError as error:
            return (*effects, *self._leave(str(error), now_s))
        return effects

    def _receive_file(self, data: bytes, now_s: float) -> Effects:
        if self._reading is not None:
            try:
                self._reading.receive(data)
            except ValueError as error:
                return self._leave(str(error), now_s)
        return ()

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Connect again: neither a file nor the replies can be read from their middle."""
        return self._leave("it sent far too much", now_s)

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Note the end of a file, or of the connection; the link connects again."""
        if channel == FTP:
            self._step = _Step.CLOSED
            return (Close(FILE), SetTimer(None))
        if self._step is _Step.CONNECTING:
            return (Close(FILE), *self._leave("the port that it named for a file is not open", now_s))
        self._ended = True
        return (Close(FILE), *self._finish(now_s))

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Read the next file, give one up that did not come, or connect again."""
        if self._waits:
            self._waits = False
            return (Open(FTP),)
        if self._step is _Step.CLOSED:
            return ()
        if self._step is _Step.IDLE:
            return self._go_on(now_s)
        asked = self._polling.asked
        what = "its greeting or its answer to the log-in" if asked is None else asked.read.value
        lost: tuple[Effect, ...] = () if asked is None else (Report([], 0, lost=1),)
        return (*lost, *self._leave(f"{what} did not come within {TIMEOUT_S:g} s", now_s))

    def _leave(self, why: str, now_s: float, again_s: float = _AGAIN_S) -> Effects:
        """End the connection, and connect again later."""
        self._step, self._waits = _Step.CLOSED, True
        self._begin_file(now_s)
        return (Close(FILE), Close(FTP, one_line(why)), SetTimer(now_s + again_s))

    def _go_on(self, now_s: float) -> Sequence[Effect]:
        asked = self._polling.next_question(now_s)
        if asked is None:
            return (SetTimer(self._polling.wake_s()),)
        self._step = _Step.PASSIVE
        return (Send(FTP, ftp.PASSIVE), SetTimer(now_s + TIMEOUT_S))

    # ----------------------------------------------------------------------- replies

    def _on_reply(self, reply: Reply, now_s: float) -> Effects:
        match self._step, reply.code:
            case _Step.CLOSED, _:
                return ()
            case _, 421:
                return self._leave(f"it ends the connection: {reply}", now_s)
            case _Step.GREETING, 120:
                return ()
            case _Step.GREETING, 220:
                return self._say(_Step.USER, self._user)
            case _Step.USER, 331:
                return self._say(_Step.PASSWORD, self._password)
            case (_Step.USER, 230) | (_Step.PASSWORD, 230 | 202):
                return self._say(_Step.BINARY, ftp.BINARY)
            case ((_Step.USER | _Step.PASSWORD), _):
                why = f"it refuses the user {self._settings.user}: {reply}"
                return self._leave(why, now_s, _LOG_IN_AGAIN_S)
            case _Step.BINARY, 200:
                return self._say(_Step.FOLDER, ftp.ENTER_FOLDER)
            case _Step.FOLDER, (200 | 250):
                self._step = _Step.IDLE
                return self._go_on(now_s)
            case _Step.PASSIVE, 227 if reply.port is not None:
                self._step = _Step.CONNECTING
                return (Open(FILE, port=reply.port),)
            case _Step.READING, (125 | 150):
                return ()
            case _Step.READING, (226 | 250):
                self._whole = True
                return self._finish(now_s)
            case _Step.READING, code if code >= 400:
                return self._refusal(reply, now_s)
        step = self._step.name.lower()
        return self._leave(f"an unexpected reply (state {step}): {reply}", now_s)

    def _say(self, step: _Step, command: bytes) -> Effects:
        self._step = step
        return (Send(FTP, command),)

    def _finish(self, now_s: float) -> Effects:
        """Report the file once its connection has ended and the controller has confirmed it."""
        asked = self._polling.asked
        reading = self._reading
        if self._step is not _Step.READING or asked is None or reading is None:
            return ()
        if not (self._whole and self._ended):
            return ()
        self._polling.asked = None
        self._step = _Step.IDLE
        return (self._report(asked.read, reading), *self._go_on(now_s))

    def _refusal(self, reply: Reply, now_s: float) -> Effects:
        """Report once for each connection that the controller does not give a file."""
        asked, self._polling.asked = self._polling.asked, None
        assert asked is not None
        self._step = _Step.IDLE
        file = asked.read
        events: list[ControllerEvent] = []
        gone = reply.code >= 500
        if gone and file not in self._refused:
            self._refused.add(file)
            events.append(_malformed(b"", f"the controller does not give {file.value}: {reply}"))
        if gone and file is not File.POSITION:
            self._polling.drop(file)
        # Not a sign that the state is received.
        report = Report(events, 1, refusals=1, lost=0 if gone else 1)
        return (Close(FILE), report, *self._go_on(now_s))

    # ------------------------------------------------------------------------- files

    def _report(self, file: File, reading: Reading[list[ControllerEvent]]) -> Report:
        try:
            return Report(reading.result(), 1, asked_s=self._read_s)
        except ValueError as error:
            return Report([_malformed(reading.head, f"{file.value}: {error}")], 0)

    def _events(self, file: File) -> Steps[list[ControllerEvent]]:
        known_s = _PERIODS_KNOWN * self._periods[file]
        match file:
            case File.POSITION:
                position = yield from files.position(self._settings.group)
                return self._on_position(position, known_s)
            case File.SIGNALS:
                known = yield from files.inputs_and_outputs()
                reported = file_signals.of_inputs_and_outputs(known, self._io, known_s)
                return [file_signals.status_of(known), reported]
            case File.SAFETY:
                stops = yield from files.safety()
                return [file_signals.of_safety(stops, known_s)]
            case File.ALARMS:
                alarms = yield from files.active_alarms()
                return self._on_alarms(alarms)
            case File.REGISTERS:
                registers = yield from files.registers()
                return [file_signals.of_registers(registers, self._settings.registers, known_s)]
            case File.FRAMES:
                tools = yield from files.tools(self._settings.group)
                self._tool = tools.active
                return [file_signals.of_tools(tools, self._settings.tools, known_s)]

    def _on_position(self, position: FilePosition, known_s: float) -> list[ControllerEvent]:
        missing = [each + 1 for each in self._axes.used if each >= position.count]
        if missing and self._settings.j23 is not None:
            raise ValueError(
                f"axis {missing[0]} is declared, but group {self._settings.group} has {position.count}"
            )
        events: list[ControllerEvent] = []
        if position.axes is None and not self._invalid:
            events.append(
                _malformed(
                    self._reading.head if self._reading else b"", "a joint's position does not fit its field"
                )
            )
        self._invalid = position.axes is None
        if position.axes is not None and self._settings.j23 is not None:
            events.append(JointsReceived(self._axes.positions(position.axes)))
            events += self._look_for_axes(position.count)
        events.append(file_signals.of_position(position, known_s))
        if position.tool != self._tool and self._tool is not None:
            # The frame that was read is another tool's.
            self._tool = None
            events.append(file_signals.unknown_tool())
            if File.FRAMES not in self._refused:
                self._polling.ask_once(File.FRAMES)
        if position.software and position.software != self._software:
            self._software = position.software
            events.append(SoftwareReceived(self._software))
        return events

    def _look_for_axes(self, count: int) -> list[ControllerEvent]:
        """Report once the axes that no joint of the model has, and that were not declared."""
        known = {*(each + 1 for each in self._axes.used), *self._settings.other_axes}
        extra = ", ".join(str(each) for each in range(1, count + 1) if each not in known)
        if extra == self._undeclared:
            return []
        self._undeclared = extra
        return [AxesUndeclared(reason_codes.AXES_EXTRA(axes=extra) if extra else None)]

    def _on_alarms(self, found: Sequence[ListedAlarm]) -> list[ControllerEvent]:
        new = [each for each in dict.fromkeys(found) if each not in self._alarms]
        self._alarms = frozenset(found)
        events: list[ControllerEvent] = [
            alarm_of(Alarm(0, 0, -1, (), each.message, each.cause, each.severity))
            for each in new[:_MOST_ALARMS]
        ]
        return events


def _malformed(data: bytes, reason: str) -> MalformedReceived:
    return MalformedReceived(0, one_line(data.decode("latin-1")), one_line(reason))
