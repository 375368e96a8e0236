"""Driver that reads a controller of Universal Robots; it sends nothing but the greeting of RTDE.

`motion_driver` adds motion. RTDE has the state, the primary interface the alarms and messages. Neither takes
a seat of another client.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from types import MappingProxyType

from controllers.universal_robots.interfaces.modes import (
    ReportLevel,
    RobotMode,
    RuntimeState,
    SafetyMode,
    TextLevel,
)
from controllers.universal_robots.interfaces.packages import Malformed
from controllers.universal_robots.interfaces.primary import (
    Alarm,
    KeyMessage,
    Popup,
    PrimaryEvent,
    PrimaryStream,
    RuntimeFault,
)
from controllers.universal_robots.interfaces.rtde_messages import TextReceived
from controllers.universal_robots.interfaces.rtde_reader import Failed, Ready, RtdeReader
from controllers.universal_robots.interfaces.state import OUTPUTS, ControllerState
from controllers.universal_robots.settings import UniversalRobotsSettings
from controllers.universal_robots.signals import SignalReports
from protocol_gateway.driver_parts.only_reads import OnlyReads, check_no_type_codes
from protocol_gateway.seam import (
    NOTHING,
    Activity,
    AlarmReceived,
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
    Severity,
    SoftwareReceived,
    StatusReceived,
    homed_by_nature,
)
from protocol_gateway.seam.errors import GatewaySettingsError
from robots.kinematics.joints import JointType

RTDE = Channel(name="rtde", carries=Carries.READING)
PRIMARY = Channel(name="primary", carries=NOTHING)
# The port for reading only, which takes no program.
_OPEN_PRIMARY = Open(PRIMARY, 30011)
JOINTS = 6

# The arm follows its targets closely, and robomesh computes the tool's speed itself.
_NOT_READ = frozenset({"target_q", "actual_TCP_speed", "tool_mode"})
OUTPUT_FIELDS = {name: kind for name, kind in OUTPUTS.items() if name not in _NOT_READ}
_RETRY_S = 2.0
# A fault needs a restart of the controller's safety; a stop needs a person at the robot.
_FAULTS = frozenset({SafetyMode.VIOLATION, SafetyMode.FAULT, SafetyMode.UNDEFINED})
_MAY_MOVE = frozenset({SafetyMode.NORMAL, SafetyMode.REDUCED, SafetyMode.RECOVERY})
_HELD = frozenset({RuntimeState.PAUSING, RuntimeState.PAUSED})
_AT_REST = frozenset({RuntimeState.STOPPED})
# Of an alarm; messages for UR's own developers are left out.
_LEVELS: Mapping[int, Severity] = MappingProxyType(
    {
        ReportLevel.INFO: Severity.INFO,
        ReportLevel.WARNING: Severity.WARNING,
        ReportLevel.VIOLATION: Severity.ERROR,
        ReportLevel.FAULT: Severity.ERROR,
        ReportLevel.CRITICAL_FAULT: Severity.ERROR,
    }
)
_SEVERITIES: Mapping[int, Severity] = MappingProxyType(
    {
        TextLevel.EXCEPTION: Severity.ERROR,
        TextLevel.ERROR: Severity.ERROR,
        TextLevel.WARNING: Severity.WARNING,
        TextLevel.INFO: Severity.INFO,
    }
)


class RtdeDriver(OnlyReads):
    """Driver of RTDE and the primary interface (`protocol_gateway.seam.Driver`).

    Raises:
        GatewaySettingsError: If the model has not six rotary joints, or there are type codes.
    """

    ports = frozenset({PRIMARY.name, "scripts", "dashboard"})
    capabilities = Capabilities(commands=frozenset(), absolute=True, reports_pose=True, can_be_moved=True)
    # A greeting takes at most seven requests.
    requests_a_second = 10.0

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        if [*joint_types] != [JointType.ROTARY] * JOINTS:
            raise GatewaySettingsError(
                f"protocol 'rtde': a robot of Universal Robots has {JOINTS} rotary joints, this model has "
                f"{len(joint_types)} joints: choose its own model"
            )
        check_no_type_codes("rtde", codes)
        self._settings = (
            options if isinstance(options, UniversalRobotsSettings) else UniversalRobotsSettings()
        )
        self._reader = RtdeReader(self._settings.rate_hz, OUTPUT_FIELDS)
        self._primary = PrimaryStream()
        self._signals = SignalReports()
        self._left: dict[str, Open] = {}

    def started(self, now_s: float) -> Effects:
        """Connect to the site file's port, which is 30004 on a controller, and to the primary interface."""
        self._left = {}
        return (Open(RTDE), _OPEN_PRIMARY)

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Greet by RTDE; the primary interface sends unasked."""
        if channel is PRIMARY:
            self._primary = PrimaryStream()
            return ()
        self._signals = SignalReports()
        return (Send(RTDE, self._reader.connected()),)

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Report what the next bytes say, and go on with the greeting."""
        return self._messages(data, now_s) if channel is PRIMARY else self._states(data, now_s)

    def _states(self, data: bytes, now_s: float) -> Effects:
        events: list[ControllerEvent] = []
        followed: list[Effect] = []
        units = 0
        failure = ""
        for event in self._reader.receive(data):
            match event:
                case ControllerState():
                    units += 1
                    events += joints_of(event), self._status(event, now_s)
                    followed += self._follow(event, now_s)
                    if (signals := self._signals.of(event)) is not None:
                        events.append(signals)
                case TextReceived(level, text, source):
                    severity = _SEVERITIES.get(level, Severity.WARNING)
                    events.append(AlarmReceived(severity, f"{source}: {text}" if source else text))
                case Malformed(offset, text, reason, fatal):
                    events.append(MalformedReceived(offset, text, reason))
                    failure = reason if fatal else failure
                case Failed(reason):
                    failure = reason
                case Ready(version):
                    events.append(SoftwareReceived(str(version)))
        effects: list[Effect] = [Report(events, units), *followed]
        if asked := self._reader.to_send():
            effects.append(Send(RTDE, asked))
        if failure:
            effects += self._leave(RTDE, failure, now_s)
        return effects

    def _status(self, state: ControllerState, now_s: float) -> StatusReceived:
        """Return the status that a state reports."""
        return status_of(state)

    def _follow(self, state: ControllerState, now_s: float) -> Effects:
        """Do what a new state requires: nothing."""
        return ()

    def _messages(self, data: bytes, now_s: float) -> Effects:
        events: list[ControllerEvent] = []
        failure = ""
        for event in self._primary.receive(data):
            if isinstance(event, Malformed):
                events.append(MalformedReceived(event.offset, event.text, event.reason))
                failure = event.reason if event.fatal else failure
            elif (alarm := alarm_of(event)) is not None:
                events.append(alarm)
        effects: list[Effect] = [Report(events, 0)] if events else []
        if failure:
            effects += self._leave(PRIMARY, failure, now_s)
        return effects

    def _leave(self, channel: Channel, why: str, now_s: float) -> Effects:
        """End a connection that cannot be read any further, and connect again later."""
        self._left[channel.name] = _OPEN_PRIMARY if channel is PRIMARY else Open(RTDE)
        return (Close(channel, why), SetTimer(now_s + _RETRY_S))

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Connect again: the stream cannot be read from its middle."""
        return self._leave(channel, "it sent far too much", now_s)

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Do nothing: the link connects again."""
        return ()

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Connect again after a failure."""
        left, self._left = self._left, {}
        return tuple(left.values())


def alarm_of(event: PrimaryEvent) -> AlarmReceived | None:
    """Return an event of the primary interface as an alarm; None: not an alarm.

    The safety mode also comes by RTDE.
    """
    match event:
        case Alarm(level=level, text=text) if level in _LEVELS:
            return AlarmReceived(_LEVELS[level], f"{event.name} {text}".rstrip(), event.name)
        case KeyMessage(title=title, text=text):
            return AlarmReceived(Severity.INFO, f"{title} {text}".rstrip())
        case RuntimeFault(line=line, column=column, text=text):
            return AlarmReceived(Severity.ERROR, f"script, line {line}, column {column}: {text}")
        case Popup(title=title, text=text, warning=warning, error=error):
            severity = Severity.ERROR if error else Severity.WARNING if warning else Severity.INFO
            return AlarmReceived(severity, f"{title}: {text}" if title else text)
    return None


def joints_of(state: ControllerState) -> JointsReceived:
    """Return the joint positions of a state."""
    return JointsReceived(state.positions, state.velocities, state.timestamp_s)


def status_of(state: ControllerState) -> StatusReceived:
    """Return the status of a state."""
    activity = activity_of(state)
    return StatusReceived(activity, homed=homed_by_nature(activity), controller_time_s=state.timestamp_s)


def activity_of(state: ControllerState) -> Activity | None:
    """Return what the arm does; None: unknown.

    A program that plays may wait, and moves without notice, so it counts as motion.
    """
    if state.safety_mode in _FAULTS:
        return Activity.FAULT
    if state.safety_mode is not None and state.safety_mode not in _MAY_MOVE:
        return Activity.STOPPED
    if state.robot_mode is not None and state.robot_mode != RobotMode.RUNNING:
        # Freedrive moves the arm by hand; without power, or with brakes on, somebody must act first.
        return Activity.MOVING if state.robot_mode == RobotMode.BACKDRIVE else Activity.STOPPED
    if state.runtime_state is None:
        return None
    if state.runtime_state in _HELD:
        return Activity.HOLDING
    return Activity.IDLE if state.runtime_state in _AT_REST else Activity.MOVING
