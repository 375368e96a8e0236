"""What a controller tells, onto the mesh: every unit at once, nothing dated anew, nothing invented.

`on_event` runs straight from the socket's callback: it publishes and keeps the newest, nothing else.
"""

from collections.abc import Callable

from bus.publisher import Publisher
from bus.schemas.robomesh_pb2 import Event
from protocol_gateway.driver import (
    Activity,
    ControllerEvent,
    JointsReceived,
    MalformedReceived,
    Refused,
    StatusReceived,
    UnknownReceived,
)
from protocol_gateway.journal import Journal
from protocol_gateway.link import Received
from protocol_gateway.motion import PositionWatch
from protocol_gateway.states import joint_states, raw_record
from robots.joints import Joints

_SLOW_S = 0.1
_FAULT = 9  # the protocol's ERROR number for a fault

_S = Event.Severity


class Telemetry:
    """The newest of what one controller tells, and its publication.

    Attributes:
        status: Newest; all unknown after the link was lost, for a controller may come back another.
        positions: Newest [rad] or [m]; None: not told since the link came up.
        fault: Text of the fault, while there is one.
        watch: Sees motion in the positions.
    """

    def __init__(
        self,
        joints: Joints,
        *,
        fast: Publisher,
        slow: Publisher,
        raw: Publisher,
        journal: Journal,
        on_status: Callable[[], None],
        on_refused: Callable[[], None],
    ) -> None:
        self._joints = joints
        self._fast = fast
        self._slow = slow
        self._raw = raw
        self._journal = journal
        self._on_status = on_status
        self._on_refusal = on_refused
        self._next_slow_s = 0.0
        self.watch = PositionWatch(joints.types)
        self.status = StatusReceived()
        self.positions: tuple[float, ...] | None = None
        self.controller_time_s: float | None = None
        self.fault = ""

    def forget(self) -> None:
        """The link was lost: what was known is not known any more."""
        self.status = StatusReceived()
        self.positions = None
        self.controller_time_s = None
        self.fault = ""
        self.watch.forget()

    def on_event(self, event: ControllerEvent, received: Received) -> None:
        """Publish an event of the driver's and keep what it tells."""
        match event:
            case JointsReceived():
                self._on_joints(event, received)
            case StatusReceived():
                if event.controller_time_s is not None:
                    self.controller_time_s = event.controller_time_s
                if any(each is not None for each in _told(event)):  # not the time alone
                    self._on_told(event)
            case UnknownReceived():
                self._raw.put(raw_record(event, received.wall_ns), source_time_ns=received.wall_ns)
            case MalformedReceived(offset, text, reason):
                self._journal.say(
                    _S.WARNING,
                    "unit.malformed",
                    f"a unit of the controller's is malformed and was left out: {reason}",
                    offset=offset,
                    bytes=text,
                    reason=reason,
                )
            case Refused(number, text):
                self._on_refused(number, text)

    def _on_told(self, status: StatusReceived) -> None:
        changed = _told(status) != _told(self.status)
        self.status = status
        if status.activity is not Activity.FAULT:
            self.fault = ""
        if changed:
            self._on_status()

    def _on_joints(self, joints: JointsReceived, received: Received) -> None:
        expected, got = len(self._joints), len(joints.positions)
        if got != expected:
            self._journal.say(
                _S.ERROR,
                "joints.count",
                f"the controller tells {got} joints, the description has {expected}: nothing is published; "
                "is it the right robot in the site file?",
                got=got,
                expected=expected,
            )
            return
        self.positions = joints.positions
        if joints.controller_time_s is not None:
            self.controller_time_s = joints.controller_time_s
        message = joint_states(self._joints.names, joints, received.wall_ns)
        self._fast.put(message, source_time_ns=received.wall_ns)
        if received.monotonic_s >= self._next_slow_s:
            # In step with the grid, so that 100 Hz gives 10 Hz and not 9; after a gap it begins anew.
            self._next_slow_s = max(self._next_slow_s + _SLOW_S, received.monotonic_s + _SLOW_S / 2)
            self._slow.put(message, source_time_ns=received.wall_ns)
        self.watch.see(joints.positions, received.monotonic_s)

    def _on_refused(self, number: int, text: str) -> None:
        self._on_refusal()
        if number == _FAULT:
            self.fault = text
            self._on_status()
        self._journal.say(
            _S.WARNING,
            "controller.refused",
            f"the controller refused a unit: {text or 'no reason given'} (error {number})",
            number=number,
        )


def _told(status: StatusReceived) -> tuple[object, ...]:
    return status.activity, status.mode, status.homed, status.trace
