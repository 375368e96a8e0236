"""Publication of what a controller reports, immediately, with its own time stamp.

Every unit of a moving arm is published, and some of a resting one (`thinning`); all of them are evaluated.

`on_event` runs in the socket's callback: it only publishes and keeps the newest values.
"""

from collections.abc import Callable

from protocol_gateway.link.link import EventTime
from protocol_gateway.link.motion import MotionDetector, is_moving
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    AxesUndeclared,
    ControllerEvent,
    JointsReceived,
    MalformedReceived,
    Mode,
    MotionImpossible,
    RecoverAnswered,
    Refused,
    Severity,
    SignalsReceived,
    SoftwareReceived,
    StatusReceived,
    UnknownReceived,
)
from protocol_gateway.seam.text_limits import LONGEST_TEXT
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.telemetry.signals import Signals
from protocol_gateway.telemetry.state_messages import JointStatesMessage, raw_record
from protocol_gateway.telemetry.thinning import Thinning
from protocol_gateway.telemetry.watchdog import STALE_S, Watchdog
from robomesh import reason_codes as codes
from robomesh.publications.publisher import Publisher
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Event
from robomesh.texts import one_line
from robots.kinematics.joints import Joints

_SLOW_S = 0.1
_FAULT = 9  # the protocol's ERROR number for a fault

_S = Event.Severity
_SEVERITIES = {Severity.INFO: _S.INFO, Severity.WARNING: _S.WARNING, Severity.ERROR: _S.ERROR}
# Longer than the journal's rate limit of 5 s, which must not suppress the last event of a flapping state.
_BACK_AFTER_S = 6.0


class _Notice:
    """Debounced notice of a condition that may flap: its end is reported only after it was over for a while.

    Attributes:
        reported: The begin was reported, and not the end.
    """

    def __init__(self) -> None:
        self.reported = False
        self._over_s: float | None = None

    def update(self, now_s: float, *, holds: bool) -> bool | None:
        """Return True to report the begin, False to report the end, None to report nothing."""
        if holds:
            self._over_s = None
            news = None if self.reported else True
        else:
            self._over_s = now_s if self._over_s is None else self._over_s
            news = False if self.reported and now_s - self._over_s >= _BACK_AFTER_S else None
        self.reported = self.reported if news is None else news
        return news


class Telemetry:
    """Newest positions and status of one controller, and their publication.

    Positions and status expire independently, because a controller may stop sending only one of them.

    Attributes:
        motion_detector: Detects motion in the positions.
        controller_time_s: Time on the controller's own clock; None: it reports none.
        software: Version of the controller's software; empty: not reported since the link came up.
        undeclared_axes: Reason why its axes are more than the joints of the model; None: they are not.
        motion_impossible: Reason why its driver cannot move the arm; None: it can, or it only reads.

    Args:
        rests: Returns whether the arm rests and nothing is under way; None: every unit is published.
        stop_expected: Returns whether the gateway's own stop is the reason of a stopped arm at a time.
    """

    def __init__(
        self,
        joints: Joints,
        *,
        fast: Publisher,
        slow: Publisher,
        raw: Publisher,
        signals: Signals,
        journal: Journal,
        stale_after_s: float,
        status_stale_s: float = STALE_S,
        on_status: Callable[[], None],
        on_activity: Callable[[Activity | None, float], None],
        on_refused: Callable[[], None],
        stop_expected: Callable[[float], bool],
        rests: Callable[[], bool] | None = None,
    ) -> None:
        self._message = JointStatesMessage(joints.names)
        self._fast = fast
        self._slow = slow
        self._raw = raw
        self._signals = signals
        self._journal = journal
        self._on_status = on_status
        self._on_activity = on_activity
        self._on_refusal = on_refused
        self._stop_expected = stop_expected
        self._stale_after_s, self._status_stale_s = stale_after_s, status_stale_s
        self._next_slow_s = 0.0
        self._rests = rests
        self._thinning = Thinning(joints.types, stale_after_s)
        self.motion_detector = MotionDetector(joints.types)
        self._reported_software = ""
        self.forget()

    def forget(self) -> None:
        """Drop all values after the link was lost: another controller may answer next."""
        self._status = StatusReceived()
        self._status_watchdog = Watchdog(self._status_stale_s)
        self._activity_since_s = 0.0
        self._positions: tuple[tuple[float, ...], float] | None = None  # with their time
        self._fault = ""
        self._invalid: tuple[Reason, float] | None = None  # with the time of the newest such positions
        self._lost = (False, False)
        self._joints_notice, self._status_notice, self._stop_notice = _Notice(), _Notice(), _Notice()
        self.controller_time_s: float | None = None
        self.software = ""
        self.undeclared_axes: Reason | None = None
        self.motion_impossible: Reason | None = None
        self.motion_detector.forget()
        self._signals.forget()
        self._thinning.forget()

    def invalidate_positions(self, *, other_robot: bool) -> None:
        """Mark the positions as stale.

        Args:
            other_robot: The controller may belong to another robot now. Otherwise an arm that is elsewhere
                afterwards has moved.
        """
        if self._positions is not None:
            self._positions = self._positions[0], float("-inf")
        if other_robot:
            self.motion_detector.forget()

    def mark_invalid(self, why: Reason, now_s: float) -> None:
        """Note that positions cannot be the arm's, although they are published."""
        first = self.why_invalid(now_s)
        self._invalid = first or codes.JOINTS_INVALID(why), now_s
        if first is None:
            self._on_status()

    def why_invalid(self, now_s: float) -> Reason | None:
        """Return why newly published positions cannot be the arm's; None: they can."""
        if self._invalid is None or now_s - self._invalid[1] >= self._stale_after_s:
            return None
        return self._invalid[0]

    @property
    def thinned(self) -> int:
        """Number of joint states that were not published, because the arm rested."""
        return self._thinning.thinned

    def positions(self, now_s: float) -> tuple[float, ...] | None:
        """Return the newest positions [rad] or [m]; None: none since the link came up, or stale."""
        return None if self._positions is None or self.why_stale(now_s) else self._positions[0]

    def why_stale(self, now_s: float) -> Reason | None:
        """Return the reason if the positions are stale; None: they are current, or none were received."""
        if self._positions is None or now_s - self._positions[1] < self._stale_after_s:
            return None
        return codes.POSITIONS_STALE(seconds=self._stale_after_s)

    def status(self, now_s: float) -> StatusReceived:
        """Return the newest status; all values unknown once the watchdog has expired."""
        return StatusReceived() if self._status_watchdog.expired(now_s) else self._status

    def moving(self, now_s: float) -> bool | None:
        """Return whether the robot moves; None: unknown."""
        return is_moving(self.status(now_s).activity, self.motion_detector, self._activity_since_s)

    def fault(self, now_s: float) -> str:
        """Return the fault's text; empty: no fault."""
        return "" if self._status_watchdog.expired(now_s) else self._fault

    def check_timeouts(self, now_s: float) -> None:
        """Report positions or status that expired or returned, and publish signals that wait.

        Call it repeatedly while the link is up.
        """
        self._signals.publish_due(now_s)
        before, self._lost = (
            self._lost,
            (bool(self.why_stale(now_s)), self._status_watchdog.expired(now_s)),
        )
        positions, status = self._lost
        if positions and not before[0]:
            self.motion_detector.forget()
        news = self._joints_notice.update(now_s, holds=positions)
        if news is True:
            text = f"{self.why_stale(now_s)}: the robot's position is unknown, motion is refused"
            self._journal.report(_S.WARNING, "joints.gone", text)
        elif news is False:
            self._journal.report(_S.INFO, "joints.back", "joint positions are received again")
        news = self._status_notice.update(now_s, holds=status)
        if news is True:
            text = (
                f"the controller has sent no status for {self._status_stale_s:g} s: its status is unknown now"
            )
            self._journal.report(_S.WARNING, "status.gone", text)
        elif news is False:
            self._journal.report(_S.INFO, "status.back", "the controller sends its status again")
        if self._stop_notice.reported and not status:
            stopped = self._status.activity is Activity.STOPPED
            if self._stop_notice.update(now_s, holds=stopped) is False:
                text = "the controller's own stop is over"
                self._journal.report(_S.INFO, "controller.stopped.over", text)
        if self._lost != before:
            self._on_status()

    def on_event(self, event: ControllerEvent, received: EventTime) -> None:
        """Publish a driver's event and keep its values."""
        match event:
            case JointsReceived():
                self._on_joints(event, received)
            case StatusReceived():
                if event.controller_time_s is not None:
                    self.controller_time_s = event.controller_time_s
                if any(each is not None for each in event.values):  # not the time alone
                    self._status_watchdog.reset(event.values, received.monotonic_s)
                    self._on_controller_status(event, received.monotonic_s)
            case SignalsReceived():
                if event.controller_time_s is not None:
                    self.controller_time_s = event.controller_time_s
                self._signals.take(event, received)
            case UnknownReceived():
                record = raw_record(event, received.wall_ns)
                self._raw.put(record, source_time_ns=received.wall_ns, dated_by=received.clock)
            case MalformedReceived(offset, text, reason):
                self._journal.report(
                    _S.WARNING,
                    "unit.malformed",
                    f"a malformed unit from the controller was ignored: {reason}",
                    offset=offset,
                    bytes=text,
                    reason=reason,
                )
            case RecoverAnswered():
                self._on_recovery(event)
            case SoftwareReceived(version):
                self._on_software(one_line(version, LONGEST_TEXT))
            case AxesUndeclared(why):
                self.undeclared_axes = why
                self._on_status()
            case MotionImpossible(why):
                self.motion_impossible = why
                self._on_status()
            case Refused(number, text):
                self._on_refused(number, text)
            case AlarmReceived(severity, text, number):
                self._journal.report(
                    _SEVERITIES[severity],
                    "controller.alarm",
                    f"the controller says: {text}",
                    apart=number or text,
                    number=number,
                )

    def _on_software(self, version: str) -> None:
        if version != self.software:
            self.software = version
            self._on_status()
        if version != self._reported_software:
            self._reported_software = version
            text = f"the controller's software: {version}"
            self._journal.report(_S.INFO, "controller.software", text, software=version)

    def _on_recovery(self, event: RecoverAnswered) -> None:
        code = {True: codes.RECOVER_ANSWERED, False: codes.RECOVER_REFUSED, None: codes.RECOVER_UNKNOWN}
        why = code[event.accepted](
            recovery=event.recovery.value, detail=one_line(event.answer, LONGEST_TEXT) or "-"
        )
        severity = _S.INFO if event.accepted else _S.WARNING
        self._journal.report(
            severity, why.code, why.text, why=why, apart=why.text, recovery=event.recovery.value
        )

    def _on_controller_status(self, status: StatusReceived, now_s: float) -> None:
        changed = status.values != self._status.values
        if status.activity is not self._status.activity:
            self._activity_since_s = now_s
        before, self._status = self._status, status
        if status.activity is not Activity.FAULT:
            self._fault = ""
        if changed:
            self._report_changes(before, status, now_s)
            self._on_status()
        positions_s = float("-inf") if self._positions is None else self._positions[1]
        self._on_activity(status.activity, min(now_s, positions_s))

    def _report_changes(self, before: StatusReceived, now: StatusReceived, now_s: float) -> None:
        if now.mode is Mode.LOCAL and before.mode is not Mode.LOCAL:
            text = "the controller is in local mode: only the operator at the controller can move the robot"
            self._journal.report(_S.WARNING, "controller.local", text)
        if now.mode is Mode.REMOTE and before.mode is Mode.LOCAL:
            self._journal.report(_S.INFO, "controller.remote", "the controller is in remote mode again")
        if now.activity is Activity.FAULT and before.activity is not Activity.FAULT:
            text = f"the controller has a fault: {self._fault or 'it does not say which'}"
            self._journal.report(_S.ERROR, "controller.fault", text)
        if now.activity is not Activity.STOPPED or before.activity in (None, Activity.STOPPED):
            return
        # A controller also reports the stop that the gateway has sent.
        if not self._stop_expected(now_s) and self._stop_notice.update(now_s, holds=True):
            why = codes.CONTROLLER_STOPPED_ITSELF()
            self._journal.report(_S.WARNING, "controller.stopped", why.text, why=why)

    def _on_joints(self, joints: JointsReceived, received: EventTime) -> None:
        self._positions = joints.positions, received.monotonic_s
        if joints.controller_time_s is not None:
            self.controller_time_s = joints.controller_time_s
        self.motion_detector.add(joints.positions, received.monotonic_s)
        rests = self._rests is not None and self._rests()
        if self._thinning.publishes(joints.positions, received.monotonic_s, rests=rests):
            self._publish(joints, received)

    def _publish(self, joints: JointsReceived, received: EventTime) -> None:
        message = self._message.fill(joints, received.wall_ns)
        self._fast.put(message, source_time_ns=received.wall_ns, dated_by=received.clock)
        if received.monotonic_s >= self._next_slow_s:
            # On a fixed grid, so that 100 Hz gives 10 Hz and not 9; a gap restarts the grid.
            self._next_slow_s = max(self._next_slow_s + _SLOW_S, received.monotonic_s + _SLOW_S / 2)
            self._slow.put(message, source_time_ns=received.wall_ns, dated_by=received.clock)

    def _on_refused(self, number: int, text: str) -> None:
        self._on_refusal()
        if number == _FAULT:
            self._fault = text
            self._on_status()
        self._journal.report(
            _S.WARNING,
            "controller.refused",
            f"the controller refused a unit: {text or 'no reason given'} (error {number})",
            number=number,
        )
