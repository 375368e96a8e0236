"""Driver that reads a controller of FANUC by SNPX.

A client reads words of memory. An assignment copies a position, an alarm or a variable into such words. With
the setting "own" the driver sends assignments, and each answer proves that they are still its own. It sends
only questions otherwise. The driver reports each answer separately, and never combines positions and status.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace

from controllers.fanuc import codes as fanuc_codes
from controllers.fanuc import data, signals
from controllers.fanuc.assignments import ALARMS, Block, SystemVariable, Variable
from controllers.fanuc.axes import Axes, FanucSettings, SignalBits, signal_bits
from controllers.fanuc.data import Alarm
from controllers.fanuc.signals import Operator
from controllers.fanuc.srtp import (
    NUMBERS,
    Answer,
    AnswerStream,
    Area,
    Assign,
    BeginSession,
    Clear,
    Connect,
    Question,
    Read,
)
from protocol_gateway.driver_parts.only_reads import check_no_type_codes
from protocol_gateway.driver_parts.pendant_text import text
from protocol_gateway.driver_parts.polling import Asked, Polling, Regular
from protocol_gateway.driver_parts.polling_reader import PollingReader, malformed
from protocol_gateway.driver_parts.signal_names import of_bits
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    AxesUndeclared,
    Capabilities,
    Carries,
    Channel,
    ControllerEvent,
    Effect,
    Effects,
    JointsReceived,
    Mode,
    Report,
    SetTimer,
    Severity,
    SoftwareReceived,
    StatusReceived,
    homed_by_nature,
)
from robomesh import reason_codes
from robots.kinematics.joints import JointType

# Port 60008 or 18245 of a controller.
SNPX = Channel(name="snpx", carries=Carries.READING)
TIMEOUT_S = 1.0
"""Time after which an answer is lost: %R gets slower while programs run."""
OPERATOR_OUTPUTS = SignalBits("UO", 1, 20)

_STATUS_HZ = 5.0
# Of the state, and of each group of inputs or outputs.
_SIGNALS_HZ = 2.0
_ALARMS_HZ = 1.0
_POSE_EACH_S = 0.1
# An axis that the model does not have is reported if it is further from 0 [degree] or [mm].
_SOME_DEGREES = 0.01
_PROOFS = 3
_MOST_ALARMS = 100


class SnpxDriver(PollingReader[Question, Answer]):
    """Driver of SNPX (`protocol_gateway.seam.Driver`).

    Raises:
        GatewaySettingsError: If the settings do not fit the model, or there are type codes.
    """

    channel = SNPX

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        check_no_type_codes("snpx", codes)
        settings = options if isinstance(options, FanucSettings) else FanucSettings()
        self._settings = settings
        self._table = settings.table
        self._axes = Axes(settings, joint_types)
        self._blocks = {_words(block): block for block in self._table.blocks}
        self._operator = _bits(OPERATOR_OUTPUTS)
        self._io: dict[Read, list[SignalBits]] = {}
        for each in map(signal_bits, settings.io):
            self._io.setdefault(_bits(each), []).append(each)
        self._io_signals = {each: signals.io_signals(each) for group in self._io.values() for each in group}
        known = settings.assignments is not None and settings.j23 is not None
        self.capabilities = Capabilities(
            commands=frozenset(),
            absolute=True,
            no_joints=None if known else fanuc_codes.AXES_UNDECLARED(),
            reports_pose=known,
            can_be_moved=True,
            joint_mapping=self._axes.mapping,
        )
        regular_hz = settings.rate_hz + _STATUS_HZ + _SIGNALS_HZ * (1 + len(self._io)) + _ALARMS_HZ
        # With the questions of a new connection.
        self.requests_a_second = regular_hz + 3.0 + len(self._table.assignments)
        # Kept over a lost link: alarms are not reported again, and a table that another client replaced is
        # not replaced again.
        self._alarms: frozenset[Alarm] = frozenset()
        self._table_lost = False
        self._declared = frozenset(settings.other_axes)
        self._axes_read: Sequence[float] = ()
        self._begin()

    def _begin(self) -> None:
        settings = self._settings
        own = settings.assignments == "own" and not self._table_lost
        regular: list[Regular[Question]] = [Regular(self._operator, 1.0 / _STATUS_HZ)]
        if own or settings.assignments == "pendant":
            rates = (settings.rate_hz, _SIGNALS_HZ, _ALARMS_HZ)
            regular += [Regular(each, 1.0 / hz) for each, hz in zip(self._blocks, rates, strict=True)]
        regular += [Regular(each, 1.0 / _SIGNALS_HZ) for each in self._io if each != self._operator]
        self._setup: list[Question] = [Connect(), BeginSession()]
        if own:
            self._setup += [Clear(), *map(Assign, self._table.assignments)]
        self._polling: Polling[Question] = Polling(regular, self._setup, timeout_s=TIMEOUT_S, numbers=NUMBERS)
        self._stream = AnswerStream()
        self._refused: frozenset[Variable] = frozenset()
        self._complaints: set[Question] = set()
        self._unproven: Counter[Read] = Counter()
        self._invalid = False
        self._software = self._undeclared = ""
        self._next_pose_s = 0.0

    # -------------------------------------------------------------------------- seam

    def _answers(self, data: bytes) -> Sequence[Answer | ValueError]:
        return self._stream.receive(data)

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Read on with the answer to the next question."""
        self._stream = AnswerStream()
        return super().skipped(channel, now_s)

    def _stop(self) -> None:
        self._polling = Polling((), ())

    def _go_on(self, now_s: float) -> Sequence[Effect]:
        before = self._polling.asked
        if before is not None and before.read in self._setup and now_s >= before.at_s + TIMEOUT_S:
            # A connection without its begin is of no use: the link finds it silent, and connects again.
            self._stop()
            return (SetTimer(None), Report([], 0, lost=1))
        return super()._go_on(now_s)

    # ----------------------------------------------------------------------- answers

    def _report(self, asked: Asked[Question], answer: Answer, received: bytes, now_s: float) -> Report:
        if answer.busy and asked.read in self._setup:
            # An incomplete begin is useless: the link finds the connection silent, and connects again.
            self._stop()
        report = super()._report(asked, answer, received, now_s)
        # Only what is read is a sign that the state is received.
        return report if isinstance(asked.read, Read) else replace(report, refusals=1)

    def _refusal(self, question: Question, answer: Answer, received: bytes) -> list[ControllerEvent]:
        """Report once for each connection that the controller does not do what was asked."""
        if isinstance(question, Assign):
            self._refused |= {question.assignment.variable}
            what = f"the assignment of {question.assignment.variable}"
        elif isinstance(question, Read):
            what = f"{question.count} elements of area 0x{question.area:02X} from {question.first}"
            if question in self._io and question != self._operator:
                self._polling.drop(question)
        else:
            what = "the begin of a connection"
            self._stop()
        if question in self._complaints:
            return []
        self._complaints.add(question)
        return [malformed(received, f"the controller refuses {what}: {answer.error}")]

    def _events(self, question: Question, answer: Answer, now_s: float) -> list[ControllerEvent]:
        if not isinstance(question, Read):
            return []
        words = answer.read(question)
        block = self._blocks.get(question)
        if block is not None:
            return self._of_block(question, block, words, now_s)
        bits = int.from_bytes(words, "little")
        events: list[ControllerEvent] = []
        if question == self._operator:
            events += _status(bits)
        for each in self._io.get(question, ()):
            shifted = bits >> (each.first_bit - question.first)
            events.append(of_bits(self._io_signals[each], shifted))
        return events

    def _of_block(self, question: Read, block: Block, words: bytes, now_s: float) -> list[ControllerEvent]:
        values = block.values(words)
        if values is None:
            return self._not_proven(question, words)
        self._unproven[question] = 0
        if block is self._table.position:
            return self._on_position(values[self._table.position_of], now_s)
        if block is self._table.state:
            reported = signals.of_state(self._table, values, self._refused)
            return [reported, *self._on_software(values[SystemVariable.SOFTWARE])]
        return self._on_alarms(next(iter(values.values())))

    def _not_proven(self, question: Read, words: bytes) -> list[ControllerEvent]:
        """Report once that words are not those of this table; never replace another's table twice."""
        self._unproven[question] += 1
        if self._settings.assignments == "own":
            if self._unproven[question] < _PROOFS:
                return []
            self._table_lost = True
            for each in self._blocks:
                self._polling.drop(each)
            advice = (
                "another client replaced the gateway's assignments, so the controller keeps one table for "
                "all; give each connection its own, or let an operator enter the assignments "
                "(docs/controllers/fanuc.md); the gateway sends no more of them until it is restarted"
            )
            return [malformed(words, advice)]
        if question in self._complaints:
            return []
        self._complaints.add(question)
        what = "the assignments at the pendant are not those of docs/controllers/fanuc.md"
        return [malformed(words, f"{what}: words from %R{question.first + 1}")]

    def _on_position(self, words: bytes, now_s: float) -> list[ControllerEvent]:
        position = data.position(words)
        events: list[ControllerEvent] = []
        if position.axes is None and not self._invalid:
            events.append(malformed(words, "the controller reports no valid, finite joint position"))
        self._invalid = position.axes is None
        self._axes_read = position.axes or ()
        if position.axes is not None and self._settings.j23 is not None:
            events.append(JointsReceived(self._axes.positions(position.axes)))
            events += self._look_for_axes(position.axes)
        if now_s >= self._next_pose_s:
            self._next_pose_s = now_s + _POSE_EACH_S
            events.append(signals.of_pose(position.cartesian))
        return events

    def _look_for_axes(self, axes: Sequence[float]) -> list[ControllerEvent]:
        """Report once the axes that no joint of the model has, that are not at 0, and were not declared."""
        extra = ", ".join(str(each) for each in self._other_than_joints(axes) if each not in self._declared)
        if extra == self._undeclared:
            return []
        self._undeclared = extra
        return [AxesUndeclared(reason_codes.AXES_EXTRA(axes=extra) if extra else None)]

    def _other_than_joints(self, axes: Sequence[float]) -> list[int]:
        """Return the numbers of axes, from 1, that no joint of the model has, and that are not at 0."""
        return [
            number
            for number, value in enumerate(axes, 1)
            if number - 1 not in self._axes.used and abs(value) > _SOME_DEGREES
        ]

    def _on_software(self, words: bytes) -> list[ControllerEvent]:
        """Report the version of the software once for each connection; without a text it is unknown."""
        version = text(words)
        if not version or version == self._software:
            return []
        self._software = version
        return [SoftwareReceived(version)]

    def _on_alarms(self, words: bytes) -> list[ControllerEvent]:
        found = data.alarms(words)
        events: list[ControllerEvent] = [alarm_of(each) for each in found if each not in self._alarms]
        # With as many as can be read, an older one may still be active.
        self._alarms = frozenset(found) | (self._alarms if len(found) == ALARMS else frozenset())
        if len(self._alarms) > _MOST_ALARMS:
            self._alarms = frozenset(found)
        return events


def _words(block: Block) -> Read:
    return Read(Area.WORDS, block.first_word - 1, block.words)


def _bits(bits: SignalBits) -> Read:
    first = bits.first_bit // 8 * 8
    count = bits.first_bit + bits.last - bits.first + 1 - first
    return Read(bits.area, first, -(-count // 8) * 8)


def _status(bits: int) -> list[ControllerEvent]:
    if not bits & (1 << OPERATOR_OUTPUTS.last) - 1:
        # Also a controller without these outputs has them all off.
        return [StatusReceived(), signals.unknown_operator()]
    activity = activity_of(bits)
    status = StatusReceived(activity, mode_of(bits), homed_by_nature(activity))
    return [status, signals.of_operator(bits)]


def mode_of(bits: int) -> Mode | None:
    """Return where motions are started; None: unknown, as with a fault or without enabling inputs."""
    if bits >> Operator.PENDANT_ENABLED & 1:
        return Mode.LOCAL
    return Mode.REMOTE if bits >> Operator.COMMANDS_ENABLED & 1 else None


def activity_of(bits: int) -> Activity | None:
    """Return what the arm does, from the operator panel's outputs; None: unknown.

    A program that runs may wait, and moves without notice, so it counts as motion. With the pendant enabled,
    an operator may jog the arm, which these outputs do not say.
    """
    if bits >> Operator.FAULT & 1:
        return Activity.FAULT
    if bits >> Operator.HELD & 1 or bits >> Operator.PAUSED & 1:
        return Activity.HOLDING
    if bits >> Operator.PROGRAM_RUNNING & 1:
        return Activity.MOVING
    if not bits >> Operator.SYSTEM_READY & 1:
        return Activity.STOPPED
    return None if bits >> Operator.PENDANT_ENABLED & 1 else Activity.IDLE


_NO_ALARM = 128


def alarm_of(alarm: Alarm) -> AlarmReceived:
    """Return an alarm; one with an unknown severity counts as an error."""
    name = alarm.severity_name.upper()
    if name.startswith("WARN") or (not name and alarm.severity == 0):
        severity = Severity.WARNING
    elif name.startswith("NONE") or (not name and alarm.severity == _NO_ALARM):
        severity = Severity.INFO
    else:
        severity = Severity.ERROR
    text = "; ".join(filter(None, (alarm.full_message, alarm.cause)))
    return AlarmReceived(severity, text, alarm.number)
