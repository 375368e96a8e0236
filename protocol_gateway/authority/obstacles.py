"""Why a command cannot go to a controller as it is now: its state, the joints' limits. No I/O.

    command                     link  mode  stopped, fault  positions  homed  limits
    --------------------------  ----  ----  --------------  ---------  -----  ------
    HOLD                        x
    RESET TRACE_ON TRACE_OFF    x     x
    SPEED                       x     x                                       1-100 %
    HOME                        x     x     x               not gone
    RESUME                      x     x     x, idle         x          x, or on hold
    RUN_PROGRAM                 x     x     x               x
    MOVE_ABSOLUTE MOVE_RELATIVE x     x     x               x          x      x

HOLD only ever makes a robot slower, so a mode that nobody knows does not forbid it.
"""

from dataclasses import dataclass, replace
from typing import TypeAlias

from bus.schemas.robomesh_pb2 import CommandRequest
from protocol_gateway.authority.rules import MOTION_COMMANDS, Answer, Why
from protocol_gateway.drivers.driver import (
    Activity,
    ControllerCommand,
    Hold,
    Home,
    Mode,
    MoveAbsolute,
    MoveRelative,
    Reset,
    Resume,
    Speed,
    StatusReceived,
    Trace,
)
from protocol_gateway.link.link import LinkState, LinkStatus
from robots.joints import Joints, violations

_C = CommandRequest.Command
_MOVES = frozenset({_C.MOVE_ABSOLUTE, _C.MOVE_RELATIVE})
_Obstacle: TypeAlias = tuple[Why, str]


@dataclass(frozen=True, kw_only=True)
class Controller:
    """What is known of a controller now.

    Attributes:
        positions: Where its joints are [rad] or [m]; None: not told, or not any more.
        positions_gone: That they are not told any more, in words; empty: they are, or never were.
        read_only: Why nothing is ever sent to it, and what would be right; empty: it may be sent to.
        accept_unknown: What it never tells and the site file says to do without: "mode", "homed".
    """

    link: LinkStatus
    status: StatusReceived
    fault: str = ""
    positions: tuple[float, ...] | None = None
    positions_gone: str = ""
    read_only: str = ""
    accept_unknown: frozenset[str] = frozenset()


def obstacle(request: CommandRequest, controller: Controller, joints: Joints) -> Answer | None:
    """Why the command cannot be sent: what, why and what next; None: it can."""
    found = (
        _link_obstacle(controller)
        or _mode_obstacle(request, controller)
        or _state_obstacle(request, controller)
        or _value_obstacle(request, controller, joints)
    )
    return None if found is None else Answer(False, f"Not sent: {found[1]}.", found[0])


def _link_obstacle(controller: Controller) -> _Obstacle | None:
    if controller.read_only:
        return Why.READ_ONLY, f"this robot is read-only: {controller.read_only}"
    text = controller.link.text
    match controller.link.state:
        case LinkState.DOWN:
            return Why.OTHER, f"the link to the controller is down ({text})"
        case LinkState.SILENT:
            return Why.OTHER, f"the controller is silent, where the robot is now is not known ({text})"
        case LinkState.UP:
            return None


def _mode_obstacle(request: CommandRequest, controller: Controller) -> _Obstacle | None:
    match controller.status.mode:
        case Mode.LOCAL:
            return Why.LOCAL_MODE, "the controller is in local mode: switch it to remote at the controller"
        case None if request.command != _C.HOLD and "mode" not in controller.accept_unknown:
            return Why.LOCAL_MODE, (
                "the controller does not tell whether it is in remote or local mode; for one that "
                'never does, the site file can say accept_unknown = ["mode"]'
            )
    return None


def _state_obstacle(request: CommandRequest, controller: Controller) -> _Obstacle | None:
    if request.command not in MOTION_COMMANDS:
        return None
    status = controller.status
    if status.activity is Activity.STOPPED:
        return Why.STOPPED, "the controller is stopped: see to it, then send RESET"
    if status.activity is Activity.FAULT:
        fault = controller.fault or "it does not say which"
        return Why.OTHER, f"the controller has a fault ({fault}): mend it, then send RESET"
    if status.activity is Activity.HOLDING and request.command != _C.RESUME:
        return Why.STOPPED, "a motion is on hold: RESUME it, or give it up with RESET"
    if controller.positions_gone:
        return Why.OTHER, f"where the robot is now is not known ({controller.positions_gone})"
    # Many an arm cannot tell where it is before it is homed; one that could and cannot any more is not moved.
    if controller.positions is None and request.command != _C.HOME:
        return Why.OTHER, "the controller has not told where the joints are"
    if request.command == _C.RESUME and status.activity is Activity.IDLE:
        return Why.OTHER, "nothing is on hold: there is no motion to resume"
    # A program may begin with homing; each of its steps is judged when its turn comes.
    if request.command in (_C.HOME, _C.RUN_PROGRAM) or status.homed:
        return None
    # What is on hold was judged when it began; it may be the way home.
    if request.command == _C.RESUME and status.activity is Activity.HOLDING:
        return None
    if status.homed is False:
        return Why.OTHER, "the robot is not homed: home it first (HOME)"
    if "homed" in controller.accept_unknown:
        return None
    return Why.OTHER, (
        "the controller does not tell whether the robot is homed: home it first (HOME); for a controller "
        'that never tells, the site file can say accept_unknown = ["homed"]'
    )


def _value_obstacle(request: CommandRequest, controller: Controller, joints: Joints) -> _Obstacle | None:
    if request.command == _C.SPEED:
        if not request.HasField("speed_percent"):
            return Why.LIMIT, "SPEED needs speed_percent, from 1 to 100"
        if not 1.0 <= request.speed_percent <= 100.0:
            return Why.LIMIT, f"speed {request.speed_percent:g} % is outside 1 to 100 %"
    if request.command not in _MOVES:
        return None
    count = len(request.joint_positions)
    if count != len(joints):
        names = ", ".join(joints.names)
        return Why.OTHER, f"{count} joint positions, but the robot has {len(joints)} joints ({names})"
    # Limits and constraints are linear: all of a straight path in joint space is within them when its end is.
    target = target_of(request, controller, joints)
    found = violations(joints, target) if target is not None else ()
    return (Why.LIMIT, "; ".join(found)) if found else None


def target_of(request: CommandRequest, controller: Controller, joints: Joints) -> tuple[float, ...] | None:
    """Where a command takes the joints [rad] or [m]; None: nowhere, or it is not known."""
    match request.command:
        case _C.HOME:
            return tuple(joints.home.tolist())
        case _C.MOVE_ABSOLUTE:
            return tuple(request.joint_positions)
        case _C.MOVE_RELATIVE if controller.positions is not None:
            pairs = zip(controller.positions, request.joint_positions, strict=True)
            return tuple(start + offset for start, offset in pairs)
    return None


def after(request: CommandRequest, controller: Controller, joints: Joints) -> Controller:
    """The controller as a command will leave it: so it is for the next one of the same unit."""
    status = controller.status
    match request.command:
        case _C.HOME:
            status = replace(status, homed=True)
        case _C.RESET:
            status = replace(status, activity=None)  # not stopped, and nothing is on hold
        case _C.HOLD:
            status = replace(status, activity=Activity.HOLDING)
        case _C.RESUME:
            status = replace(status, activity=Activity.MOVING)
    target = target_of(request, controller, joints)
    return replace(controller, status=status, positions=controller.positions if target is None else target)


def controller_command(request: CommandRequest) -> ControllerCommand:
    """A command as the driver takes it.

    Raises:
        ValueError: If it is none that a driver knows.
    """
    match request.command:
        case _C.HOME:
            return Home()
        case _C.HOLD:
            return Hold()
        case _C.RESUME:
            return Resume()
        case _C.RESET:
            return Reset()
        case _C.TRACE_ON:
            return Trace(on=True)
        case _C.TRACE_OFF:
            return Trace(on=False)
        case _C.SPEED:
            return Speed(percent=request.speed_percent)
        case _C.MOVE_ABSOLUTE:
            return MoveAbsolute(positions=tuple(request.joint_positions))
        case _C.MOVE_RELATIVE:
            return MoveRelative(offsets=tuple(request.joint_positions))
    raise ValueError(f"{_C.Name(request.command)} is not a controller's command")
