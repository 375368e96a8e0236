"""What a controller tells, onto the mesh: every unit at once, nothing dated anew, nothing invented.

`on_event` runs straight from the socket's callback: it publishes and keeps the newest, nothing else.
"""

from collections.abc import Callable

from protocol_gateway.drivers.driver import (
    Activity,
    ControllerEvent,
    JointsReceived,
    MalformedReceived,
    Mode,
    Refused,
    StatusReceived,
    UnknownReceived,
)
from protocol_gateway.journal import Journal
from protocol_gateway.link.link import Received
from protocol_gateway.motion import MotionDetector, is_moving
from protocol_gateway.state_messages import JointStatesMessage, raw_record
from protocol_gateway.watchdog import STALE_S, Watchdog
from robomesh import reason_codes as codes
from robomesh.publisher import Publisher
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Event
from robots.joints import Joints

_SLOW_S = 0.1
_FAULT = 9  # the protocol's ERROR number for a fault

_S = Event.Severity
# Longer than the journal's limit of a kind: what comes and goes must not leave the last word out.
_BACK_AFTER_S = 6.0


class _LossNotice:
    """Whether something is said to be gone; it is back when it has come for a while."""

    def __init__(self) -> None:
        self._reported_lost = False
        self._back_s: float | None = None

    def update(self, now_s: float, *, gone: bool) -> bool | None:
        """True: say that it is gone; False: that it is back; None: nothing."""
        if gone:
            self._back_s = None
            news = None if self._reported_lost else True
        else:
            self._back_s = now_s if self._back_s is None else self._back_s
            news = False if self._reported_lost and now_s - self._back_s >= _BACK_AFTER_S else None
        self._reported_lost = self._reported_lost if news is None else news
        return news


class Telemetry:
    """The newest of what one controller tells, and its publication.

    Each of both is known for a time of its own: a controller may go on with one and not with the other.

    Attributes:
        motion_detector: Sees motion in the positions.
        controller_time_s: On the controller's own clock; None: it does not tell.
    """

    def __init__(
        self,
        joints: Joints,
        *,
        fast: Publisher,
        slow: Publisher,
        raw: Publisher,
        journal: Journal,
        stale_after_s: float,
        on_status: Callable[[], None],
        on_activity: Callable[[Activity | None, float], None],
        on_refused: Callable[[], None],
    ) -> None:
        self._message = JointStatesMessage(joints.names)
        self._fast = fast
        self._slow = slow
        self._raw = raw
        self._journal = journal
        self._on_status = on_status
        self._on_activity = on_activity
        self._on_refusal = on_refused
        self._stale_after_s = stale_after_s
        self._next_slow_s = 0.0
        self.motion_detector = MotionDetector(joints.types)
        self.forget()

    def forget(self) -> None:
        """The link was lost: nothing is known any more, for a controller may come back another."""
        self._status = StatusReceived()
        self._status_watchdog = Watchdog()
        self._activity_since_s = 0.0
        self._positions: tuple[tuple[float, ...], float] | None = None  # and when they were so
        self._fault = ""
        self._gone = (False, False)
        self._joints_notice, self._status_notice = _LossNotice(), _LossNotice()
        self.controller_time_s: float | None = None
        self.motion_detector.forget()

    def forget_positions(self) -> None:
        """Count the positions as gone: the controller may be another robot's now."""
        if self._positions is not None:
            self._positions = self._positions[0], float("-inf")
        self.motion_detector.forget()

    def positions(self, now_s: float) -> tuple[float, ...] | None:
        """The newest [rad] or [m]; None: not told since the link came up, or not for the stale time."""
        return None if self._positions is None or self.positions_stale(now_s) else self._positions[0]

    def positions_stale(self, now_s: float) -> Reason | None:
        """Return that positions are not received any more; None: they are, or never were."""
        if self._positions is None or now_s - self._positions[1] < self._stale_after_s:
            return None
        return codes.POSITIONS_STALE(seconds=self._stale_after_s)

    def status(self, now_s: float) -> StatusReceived:
        """The newest; all unknown when it beat and has ceased to."""
        return StatusReceived() if self._status_watchdog.expired(now_s) else self._status

    def moving(self, now_s: float) -> bool | None:
        """Whether the robot moves; None: not known."""
        return is_moving(self.status(now_s).activity, self.motion_detector, now_s - self._activity_since_s)

    def fault(self, now_s: float) -> str:
        """Text of the fault, while there is one."""
        return "" if self._status_watchdog.expired(now_s) else self._fault

    def check_timeouts(self, now_s: float) -> None:
        """Say when positions or status come no more; to be called now and then while the link is up."""
        before, self._gone = (
            self._gone,
            (bool(self.positions_stale(now_s)), self._status_watchdog.expired(now_s)),
        )
        positions, status = self._gone
        if positions and not before[0]:
            self.motion_detector.forget()
        news = self._joints_notice.update(now_s, gone=positions)
        if news is True:
            text = f"{self.positions_stale(now_s)}: where the robot is is not known, motion is refused"
            self._journal.report(_S.WARNING, "joints.gone", text)
        elif news is False:
            self._journal.report(_S.INFO, "joints.back", "joint positions come again")
        news = self._status_notice.update(now_s, gone=status)
        if news is True:
            text = f"the controller's status has not come for {STALE_S:g} s: it is not known any more"
            self._journal.report(_S.WARNING, "status.gone", text)
        elif news is False:
            self._journal.report(_S.INFO, "status.back", "the controller's status comes again")
        if self._gone != before:
            self._on_status()

    def on_event(self, event: ControllerEvent, received: Received) -> None:
        """Publish an event of the driver's and keep what it tells."""
        match event:
            case JointsReceived():
                self._on_joints(event, received)
            case StatusReceived():
                if event.controller_time_s is not None:
                    self.controller_time_s = event.controller_time_s
                if any(each is not None for each in _told(event)):  # not the time alone
                    self._status_watchdog.reset(_told(event), received.monotonic_s)
                    self._on_controller_status(event, received.monotonic_s)
            case UnknownReceived():
                record = raw_record(event, received.wall_ns)
                self._raw.put(record, source_time_ns=received.wall_ns, dated_by=received.clock)
            case MalformedReceived(offset, text, reason):
                self._journal.report(
                    _S.WARNING,
                    "unit.malformed",
                    f"a unit of the controller's is malformed and was left out: {reason}",
                    offset=offset,
                    bytes=text,
                    reason=reason,
                )
            case Refused(number, text):
                self._on_refused(number, text)

    def _on_controller_status(self, status: StatusReceived, now_s: float) -> None:
        changed = _told(status) != _told(self._status)
        if status.activity is not self._status.activity:
            self._activity_since_s = now_s
        before, self._status = self._status, status
        if status.activity is not Activity.FAULT:
            self._fault = ""
        if changed:
            self._report_changes(before, status)
            self._on_status()
        positions_s = float("-inf") if self._positions is None else self._positions[1]
        self._on_activity(status.activity, min(now_s, positions_s))

    def _report_changes(self, before: StatusReceived, now: StatusReceived) -> None:
        if now.mode is Mode.LOCAL and before.mode is not Mode.LOCAL:
            text = "the controller is in local mode: people at it move the robot, and nobody from here"
            self._journal.report(_S.WARNING, "controller.local", text)
        if now.mode is Mode.REMOTE and before.mode is Mode.LOCAL:
            self._journal.report(_S.INFO, "controller.remote", "the controller is in remote mode again")
        if now.activity is Activity.FAULT and before.activity is not Activity.FAULT:
            text = f"the controller has a fault: {self._fault or 'it does not say which'}"
            self._journal.report(_S.ERROR, "controller.fault", text)

    def _on_joints(self, joints: JointsReceived, received: Received) -> None:
        self._positions = joints.positions, received.monotonic_s
        if joints.controller_time_s is not None:
            self.controller_time_s = joints.controller_time_s
        message = self._message.fill(joints, received.wall_ns)
        self._fast.put(message, source_time_ns=received.wall_ns, dated_by=received.clock)
        if received.monotonic_s >= self._next_slow_s:
            # In step with the grid, so that 100 Hz gives 10 Hz and not 9; after a gap it begins anew.
            self._next_slow_s = max(self._next_slow_s + _SLOW_S, received.monotonic_s + _SLOW_S / 2)
            self._slow.put(message, source_time_ns=received.wall_ns, dated_by=received.clock)
        self.motion_detector.add(joints.positions, received.monotonic_s)

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


def _told(status: StatusReceived) -> tuple[object, ...]:
    return status.activity, status.mode, status.homed, status.trace
