"""Driver that reads a controller of Yaskawa by HSES; it only sends questions.

The controller sends only answers, without a time. Each answer is reported by itself, with the time of its
question: positions and status of different answers are never combined.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence

from controllers.yaskawa import codes as hses_codes
from controllers.yaskawa import data as payloads
from controllers.yaskawa import signals
from controllers.yaskawa.axes import Axes, YaskawaSettings, instance_of
from controllers.yaskawa.data import HELD, Alarm, DataType, Position, Status, Status1, Status2
from controllers.yaskawa.hses import Answer, Command, Read, Service, decode
from protocol_gateway.driver_parts.only_reads import check_no_type_codes
from protocol_gateway.driver_parts.polling import Polling, Regular
from protocol_gateway.driver_parts.polling_reader import PollingReader, malformed
from protocol_gateway.driver_parts.signal_names import of_bits, of_joints
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    AxesUndeclared,
    Capabilities,
    Carries,
    Channel,
    ControllerEvent,
    JointsReceived,
    Mode,
    Severity,
    SoftwareReceived,
    StatusReceived,
    homed_by_nature,
)
from robomesh import reason_codes
from robomesh.reasons import Reason
from robots.kinematics.joints import JointType

# Port 10040 of a controller.
HSES = Channel(name="hses", carries=Carries.READING, datagrams=True)
STATUS = Read(Command.STATUS, 1)
JOB = Read(Command.JOB, 1)
"""The master task."""
ALARMS = 4
"""Active alarms that can be asked for, the newest first."""

_STATUS_HZ = 5.0
# Of the tool's pose, job, torques, and each group of inputs or outputs.
_SIGNALS_HZ = 2.0
_TOOL_EACH_S = 1.0
_ALARMS_EACH_S = 1.0
# An axis that the model does not have is reported if it is further from 0 than an encoder at rest.
_SOME_PULSES = 10


class HsesDriver(PollingReader[Read, Answer]):
    """Driver of HSES (`protocol_gateway.seam.Driver`).

    Raises:
        GatewaySettingsError: If the settings do not fit the model, or there are type codes.
    """

    channel = HSES

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        check_no_type_codes("hses", codes)
        settings = options if isinstance(options, YaskawaSettings) else YaskawaSettings()
        self._group, instance = settings.group, instance_of(settings.group)
        self._position = Read(Command.POSITION, instance)
        # Robots only: a base or a station has no tool.
        self._pose = Read(Command.POSITION, 100 + instance) if settings.group[0] == "R" else None
        self._axis_names = Read(Command.AXES, instance)
        self._base_axes = Read(Command.AXES, instance + 10)
        self._declared_axes = {each - 1 for each in settings.other_axes}
        # Robots are numbered from 11 here, like their bases, and stations as elsewhere.
        self._system = Read(Command.SYSTEM, instance + 10 if settings.group[0] == "R" else instance)
        self._axes = Axes(settings, joint_types) if settings.pulses_per_degree else None
        self._torques = Read(Command.TORQUE, instance)
        self._io = {
            Read(Command.IO, group, 1, Service.SINGLE): signals.io_signals(group) for group in settings.io
        }
        self._loads = of_joints("load", "%", len(joint_types))
        self._rate_hz = settings.rate_hz
        self.capabilities = Capabilities(
            commands=frozenset(),
            absolute=True,
            no_joints=hses_codes.JOINTS_UNDECLARED() if self._axes is None else None,
            reports_pose=self._pose is not None,
            can_be_moved=settings.group[0] == "R",
            joint_mapping="" if self._axes is None else self._axes.mapping,
        )
        regular_hz = settings.rate_hz + _STATUS_HZ + _SIGNALS_HZ * (3 + len(self._io))
        # With a round of alarms each second, and the questions of a new connection.
        self.requests_a_second = regular_hz + ALARMS / _ALARMS_EACH_S + 2.0
        # Kept over a lost link, so that it is not reported again.
        self._alarms: set[Alarm] = set()
        self._error = False
        self._begin()

    def _begin(self) -> None:
        regular = [Regular(STATUS, 1.0 / _STATUS_HZ)]
        if self._axes is not None:
            regular.insert(0, Regular(self._position, 1.0 / self._rate_hz))
            regular.append(Regular(self._torques, 1.0 / _SIGNALS_HZ))
        others = (JOB, *self._io) if self._pose is None else (self._pose, JOB, *self._io)
        regular += [Regular(each, 1.0 / _SIGNALS_HZ) for each in others]
        once = [STATUS, self._system, self._axis_names]
        if self._group[0] == "R":
            once.append(self._base_axes)
        self._polling = Polling(regular, once)
        self._refused: set[Read] = set()
        self._names: Sequence[str] = ()
        self._base_names: Sequence[str] = ()
        self._undeclared: Reason | None = None
        self._round: set[Alarm] = set()
        self._next_round_s = self._next_tool_s = 0.0
        self._tool: int | None = None

    # ----------------------------------------------------------------------- answers

    def _answers(self, data: bytes) -> tuple[Answer | ValueError]:
        try:
            return (decode(data),)
        except ValueError as error:
            return (error,)

    def _refusal(self, question: Read, answer: Answer, received: bytes) -> list[ControllerEvent]:
        """Report once that the controller does not answer a question that is needed."""
        needed = question in (self._position, STATUS)
        if answer.unsupported and not needed:
            self._polling.drop(question)
        if not needed or question in self._refused:
            return []
        self._refused.add(question)
        of = f"the position of {self._group}" if question is self._position else "the status"
        return [malformed(received, f"the controller refuses to report {of}: {answer.error}")]

    def _events(self, question: Read, answer: Answer, now_s: float) -> list[ControllerEvent]:
        data = answer.data
        match question.command:
            case Command.POSITION if question == self._pose:
                return self._tool_pose(payloads.position(data))
            case Command.POSITION:
                return self._joints(payloads.position(data), now_s)
            case Command.STATUS:
                return self._status(payloads.status(data), now_s)
            case Command.ALARM:
                return self._alarm(question.instance, payloads.alarm(data))
            case Command.SYSTEM:
                return self._on_system(payloads.system(data))
            case Command.AXES if question == self._base_axes:
                self._base_names = payloads.axis_names(data)
                return self._look_for_axes({})
            case Command.AXES:
                self._names = payloads.axis_names(data)
                return self._look_for_axes({})
            case Command.JOB:
                return [signals.of_job(payloads.job(data))]
            case Command.TORQUE if self._axes is not None:
                return [signals.of_torques(self._loads, self._axes.used, payloads.torques(data))]
            case Command.IO:
                return [of_bits(self._io[question], payloads.io_byte(data))]
            case _:
                return []

    def _joints(self, position: Position, now_s: float) -> list[ControllerEvent]:
        if self._axes is None:
            return []
        if position.data_type != DataType.PULSES:
            raise ValueError(f"a position of type {position.data_type}; pulses, type 0, were asked for")
        events: list[ControllerEvent] = [JointsReceived(self._axes.positions(position.axes))]
        if position.tool != self._tool or now_s >= self._next_tool_s:
            self._tool, self._next_tool_s = position.tool, now_s + _TOOL_EACH_S
            events.append(signals.of_position(position))
        if self._names:
            existing = {each for each, name in enumerate(self._names) if name}
            if missing := [each + 1 for each in self._axes.used if each not in existing]:
                raise ValueError(
                    f"axis {missing[0]} is declared, but {self._group} of the controller has none"
                )
            return events
        moved = {each: str(each + 1) for each, at in enumerate(position.axes) if abs(at) > _SOME_PULSES}
        return [*events, *self._look_for_axes(moved)]

    def _tool_pose(self, position: Position) -> list[ControllerEvent]:
        if position.data_type not in (DataType.BASE, DataType.ROBOT):
            raise ValueError(
                f"a tool's pose of type {position.data_type}; 16 (base) and 17 (robot) can be used"
            )
        return [signals.of_pose(position)]

    def _look_for_axes(self, moved: Mapping[int, str]) -> list[ControllerEvent]:
        """Report once the axes that no joint of the model has, and that were not declared.

        Args:
            moved: Axes away from 0, for a controller that does not name its axes.
        """
        if self._axes is None:
            return []
        known = {*self._axes.used, *self._declared_axes}
        named = {each: name for each, name in enumerate(self._names) if name} or moved
        why = None
        if base := ", ".join(filter(None, self._base_names)):
            why = hses_codes.BASE_UNDECLARED(axes=base)
        elif extra := ", ".join(name for each, name in named.items() if each not in known):
            why = reason_codes.AXES_EXTRA(axes=extra)
        if why == self._undeclared:
            return []
        self._undeclared = why
        return [AxesUndeclared(why)]

    def _status(self, status: Status, now_s: float) -> list[ControllerEvent]:
        if not status.second & Status2.ALARM:
            self._alarms = set()
        elif now_s >= self._next_round_s:
            self._next_round_s = now_s + _ALARMS_EACH_S
            self._round = set()
            self._polling.ask_once(Read(Command.ALARM, 1))
        error, self._error = self._error, bool(status.second & Status2.ERROR)
        events: list[ControllerEvent] = [status_of(status), signals.of_status(status)]
        if self._error and not error:
            text = "the controller reports an error, which only its own display shows"
            events.append(AlarmReceived(Severity.WARNING, text))
        return events

    def _alarm(self, number: int, alarm: Alarm) -> list[ControllerEvent]:
        known = self._alarms | self._round
        if alarm.code:
            self._round.add(alarm)
        if alarm.code and number < ALARMS:
            self._polling.ask_once(Read(Command.ALARM, number + 1))
        else:
            self._alarms = self._round
        return [alarm_of(alarm)] if alarm.code and alarm not in known else []

    def _on_system(self, system: payloads.System) -> list[ControllerEvent]:
        model = f", model {system.model}" if system.model else ""
        return [SoftwareReceived(f"{system.software or 'unknown'}{model}")]


def status_of(status: Status) -> StatusReceived:
    """Return the status; the controller does not report capture."""
    activity = activity_of(status)
    return StatusReceived(activity, mode_of(status), homed_by_nature(activity))


def mode_of(status: Status) -> Mode | None:
    """Return where motions are started; None: unknown."""
    if status.first & Status1.REMOTE:
        return Mode.REMOTE
    return Mode.LOCAL if status.first & (Status1.TEACH | Status1.PLAY) else None


def activity_of(status: Status) -> Activity | None:
    """Return what the arm does; None: unknown.

    A job that runs may wait, and moves without notice, so it counts as motion. In teach mode with the servos
    on, an operator may move the arm at the pendant, which the status does not say.
    """
    first, second = status.first, status.second
    if second & Status2.ALARM:
        return Activity.FAULT
    if second & HELD:
        return Activity.HOLDING
    if first & Status1.RUNNING:
        return Activity.MOVING
    if not second & Status2.SERVO_ON:
        return Activity.STOPPED
    return None if first & Status1.TEACH else Activity.IDLE


def alarm_of(alarm: Alarm) -> AlarmReceived:
    """Return an alarm; each one stops the robot."""
    number = f"{alarm.code:04d}"
    text = f"{number} [{alarm.sub_code}] {alarm.name}".rstrip()
    return AlarmReceived(Severity.ERROR, text, number)
