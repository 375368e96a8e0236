"""Preconditions of commands: the controller's state and the joint limits. No I/O.

    command                     link  mode  stopped, fault  positions  homed  limits
    --------------------------  ----  ----  --------------  ---------  -----  ------
    HOLD                        x
    RESET TRACE_ON TRACE_OFF    x     x
    SPEED                       x     x                                       1-100 %
    HOME                        x     x     x               not stale
    RESUME                      x     x     x, idle         x          x, or on hold
    RUN_PROGRAM                 x     x     x               x
    RECOVER                     x     x     rests, no hold                    reason
    JOG                         x     x     x               x          x
    MOVE_ABSOLUTE MOVE_RELATIVE x     x     x               x          x      x

A command that the driver does not have is refused before, and motion while a stop could not be sent. HOLD can
only slow a robot down, so an unknown mode does not forbid it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from protocol_gateway.authority.lease_rules import MOTION_COMMANDS, Answer, not_sent
from protocol_gateway.link.link import LinkState, LinkStatus
from protocol_gateway.seam import (
    COMMANDS,
    Activity,
    Capabilities,
    ControllerCommand,
    Hold,
    Home,
    Mode,
    MoveAbsolute,
    MoveRelative,
    Recover,
    Recovery,
    Reset,
    Resume,
    Speed,
    StatusReceived,
    StopEnds,
    Trace,
)
from robomesh import reason_codes as codes
from robomesh.contract.enum_names import enum_name
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest
from robomesh.schemas.robomesh_pb2 import Recover as RecoverMessage
from robots.kinematics.joints import Joints, violations

_C = CommandRequest.Command
_MOVES = frozenset({_C.MOVE_ABSOLUTE, _C.MOVE_RELATIVE})
_KINDS: dict[CommandRequest.Command, type[ControllerCommand]] = {
    _C.HOME: Home,
    _C.HOLD: Hold,
    _C.RESUME: Resume,
    _C.RESET: Reset,
    _C.TRACE_ON: Trace,
    _C.TRACE_OFF: Trace,
    _C.SPEED: Speed,
    _C.MOVE_ABSOLUTE: MoveAbsolute,
    _C.MOVE_RELATIVE: MoveRelative,
    # The gateway sends the steps of these as motions.
    _C.RUN_PROGRAM: MoveAbsolute,
    _C.JOG: MoveAbsolute,
}

# Both have the same names.
_RECOVERIES: dict[RecoverMessage.Recovery, Recovery] = {
    getattr(RecoverMessage, each.name): each for each in Recovery
}

_EVERYTHING = Capabilities(commands=COMMANDS, jogs=True)


@dataclass(frozen=True, kw_only=True)
class ControllerState:
    """Current state of a controller.

    Attributes:
        positions: Joint positions [rad] or [m]; None: none received, or stale.
        positions_stale: Reason if positions are stale; None: they are current, or none were received.
        unproven: Reason why the joints that it sends may not be those of the model, so that `positions` has
            none; None: they are.
        invalid: Reason why joints that were published, unproven, cannot be right; None: they can.
        software: Version of its software, in its words; empty: not reported.
        software_unknown: Reason why it must be reported before a motion is sent; None: it need not be.
        reports_set_up: It reports tool, payload or frame.
        set_up: Reason why motions are not checked for what the arm carries now: somebody has changed tool,
            payload or frame at the controller; None: they are.
        read_only: Reason why nothing is sent to it; None: commands may be sent.
        capabilities: What its driver can do.
        stop_arrives: What carries its stop is connected.
        stop_ends: Motion that a stop request ends now; None: it does not arrive, or would be refused.
        accept_unknown: States that it never reports and the site file does not require: "mode", "homed".
        recover: Recoveries that the site file allows.
    """

    link: LinkStatus
    status: StatusReceived
    fault: str = ""
    positions: tuple[float, ...] | None = None
    positions_stale: Reason | None = None
    unproven: Reason | None = None
    invalid: Reason | None = None
    software: str = ""
    software_unknown: Reason | None = None
    reports_set_up: bool = False
    set_up: Reason | None = None
    read_only: Reason | None = None
    capabilities: Capabilities = _EVERYTHING
    stop_arrives: bool = True
    stop_ends: StopEnds | None = StopEnds.ANY
    accept_unknown: frozenset[str] = frozenset()
    recover: frozenset[Recovery] = frozenset()


def refusal_now(request: CommandRequest, controller: ControllerState, joints: Joints) -> Answer | None:
    """Return the refusal of a command that cannot be sent now; None: it can."""
    found = (
        _link_obstacle(controller)
        or _ability_obstacle(request, controller)
        or _stop_obstacle(request, controller)
        or _mode_obstacle(request, controller)
        or _state_obstacle(request, controller)
        or _value_obstacle(request, controller, joints)
    )
    return None if found is None else not_sent(found)


def _link_obstacle(controller: ControllerState) -> Reason | None:
    if controller.read_only is not None:
        return codes.ROBOT_READ_ONLY(controller.read_only)
    match controller.link.state:
        case LinkState.DOWN:
            return codes.LINK_DOWN(controller.link.reason)
        case LinkState.SILENT:
            return codes.LINK_SILENT(controller.link.reason)
        case LinkState.UP:
            return None


def _ability_obstacle(request: CommandRequest, controller: ControllerState) -> Reason | None:
    capabilities = controller.capabilities
    if request.command == _C.RECOVER:
        return _recovery_obstacle(request, controller)
    if _kind(request.command, capabilities) in capabilities.commands:
        return None
    if request.command == _C.HOME and capabilities.absolute:
        return codes.ROBOT_HOMED_BY_NATURE()
    return codes.COMMAND_NOT_THERE(command=enum_name(_C, request.command))


def _recovery_obstacle(request: CommandRequest, controller: ControllerState) -> Reason | None:
    if request.recover.recovery == RecoverMessage.CONFIRM_TOOL:
        return None if controller.set_up is not None else codes.RECOVER_UNCHANGED()
    recovery = _RECOVERIES.get(request.recover.recovery)
    if recovery is None or recovery not in controller.capabilities.recoveries:
        named = "recovery" if recovery is None else recovery.value
        known = sorted(each.value for each in controller.capabilities.recoveries)
        return codes.RECOVER_NOT_THERE(recovery=named, known=", ".join(known) or "none")
    if recovery not in controller.recover:
        return codes.RECOVER_NOT_ALLOWED(recovery=recovery.value)
    return None


def recoveries_of(controller: ControllerState) -> list[RecoverMessage.Recovery]:
    """Return the recoveries that the controller has and the site file allows, and what can be confirmed."""
    allowed = controller.capabilities.recoveries & controller.recover
    found = [number for number, recovery in _RECOVERIES.items() if recovery in allowed]
    return [*found, RecoverMessage.CONFIRM_TOOL] if controller.reports_set_up else found


def _kind(command: CommandRequest.Command, capabilities: Capabilities) -> type[ControllerCommand] | None:
    """Return the driver's command for a command; None: it is unknown."""
    if command == _C.MOVE_RELATIVE and MoveRelative not in capabilities.commands:
        return MoveAbsolute
    return _KINDS.get(command)


def _stop_obstacle(request: CommandRequest, controller: ControllerState) -> Reason | None:
    moves = request.command in MOTION_COMMANDS
    return codes.STOP_WOULD_NOT_ARRIVE() if moves and not controller.stop_arrives else None


def commands_of(controller: ControllerState) -> Sequence[CommandRequest.Command]:
    """Return the commands of the mesh that can be executed with a controller."""
    capabilities = controller.capabilities
    found = [
        command
        for command in _KINDS
        if _kind(command, capabilities) in capabilities.commands and (command != _C.JOG or capabilities.jogs)
    ]
    return [*found, _C.RECOVER] if recoveries_of(controller) else found


def _mode_obstacle(request: CommandRequest, controller: ControllerState) -> Reason | None:
    match controller.status.mode:
        case Mode.LOCAL:
            return codes.CONTROLLER_LOCAL()
        case None if request.command != _C.HOLD and "mode" not in controller.accept_unknown:
            return codes.CONTROLLER_MODE_UNKNOWN()
    return None


def _state_obstacle(request: CommandRequest, controller: ControllerState) -> Reason | None:
    if request.command == _C.RECOVER:
        match controller.status.activity:
            case Activity.HOLDING:
                # A held motion could go on after a recovery.
                return codes.RECOVER_HELD()
            case Activity.MOVING | Activity.HOMING:
                return codes.RECOVER_MOVES()
        return None
    if request.command not in MOTION_COMMANDS:
        return None
    status = controller.status
    if status.activity is Activity.STOPPED:
        return codes.CONTROLLER_STOPPED()
    if status.activity is Activity.FAULT:
        return codes.CONTROLLER_FAULT(fault=controller.fault or "it does not say which")
    if status.activity is Activity.HOLDING and request.command != _C.RESUME:
        return codes.CONTROLLER_HOLDING()
    if controller.software_unknown is not None:
        return controller.software_unknown
    if (unknown := controller.unproven or controller.positions_stale) is not None:
        return codes.POSITIONS_UNKNOWN(unknown)
    # Many arms have no positions before they are homed. An arm with stale positions is not moved.
    if controller.positions is None and request.command != _C.HOME:
        return codes.POSITIONS_NONE()
    if request.command == _C.RESUME and status.activity is Activity.IDLE:
        return codes.CONTROLLER_NOT_HOLDING()
    # A program may begin with homing; each step is evaluated before it is sent.
    if request.command in (_C.HOME, _C.RUN_PROGRAM) or status.homed:
        return None
    # A held motion was evaluated when it began; it may be the homing itself.
    if request.command == _C.RESUME and status.activity is Activity.HOLDING:
        return None
    if status.homed is False:
        return codes.ROBOT_NOT_HOMED()
    return None if "homed" in controller.accept_unknown else codes.ROBOT_HOMED_UNKNOWN()


def _value_obstacle(request: CommandRequest, controller: ControllerState, joints: Joints) -> Reason | None:
    if request.command == _C.SPEED:
        if not request.HasField("speed_percent"):
            return codes.SPEED_MISSING()
        if not 1.0 <= request.speed_percent <= 100.0:
            return codes.SPEED_OUTSIDE(value=request.speed_percent)
    if request.command == _C.RECOVER and not request.recover.reason.strip():
        return codes.RECOVER_REASON()
    if request.command == _C.RECOVER and not request.recover.looked:
        return codes.RECOVER_LOOKED()
    if request.command not in _MOVES:
        return None
    count = len(request.joint_positions)
    if count != len(joints):
        return codes.JOINT_COUNT(count=count, joints=len(joints), names=", ".join(joints.names))
    # Limits and constraints are linear: a straight path in joint space is within them if its end is.
    target = target_of(request, controller, joints)
    found = violations(joints, target) if target is not None else ()
    return codes.JOINTS_OUTSIDE(*found) if found else None


def target_of(
    request: CommandRequest, controller: ControllerState, joints: Joints
) -> tuple[float, ...] | None:
    """Return the joint positions after a command [rad] or [m]; None: no motion, or unknown."""
    match request.command:
        case _C.HOME:
            return tuple(joints.home.tolist())
        case _C.MOVE_ABSOLUTE:
            return tuple(request.joint_positions)
        case _C.MOVE_RELATIVE if controller.positions is not None:
            pairs = zip(controller.positions, request.joint_positions, strict=True)
            return tuple(start + offset for start, offset in pairs)
    return None


def predicted(request: CommandRequest, controller: ControllerState, joints: Joints) -> ControllerState:
    """Return the controller's expected state after a command, for the next command of the same unit."""
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


def controller_commands(
    requests: Sequence[CommandRequest], controller: ControllerState, joints: Joints
) -> list[ControllerCommand]:
    """Convert commands of one unit for the driver; one without `MoveRelative` gets targets.

    Raises:
        ValueError: If drivers do not know a command.
    """
    found: list[ControllerCommand] = []
    absolute = MoveRelative not in controller.capabilities.commands
    for request in requests:
        target = target_of(request, controller, joints)
        if absolute and request.command == _C.MOVE_RELATIVE and target is not None:
            found.append(MoveAbsolute(target))
        else:
            found.append(controller_command(request))
        controller = predicted(request, controller, joints)
    return found


def controller_command(request: CommandRequest) -> ControllerCommand:
    """Convert a command for the driver.

    Raises:
        ValueError: If drivers do not know the command.
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
        case _C.RECOVER if request.recover.recovery in _RECOVERIES:
            return Recover(_RECOVERIES[request.recover.recovery])
    raise ValueError(f"{enum_name(_C, request.command)} is not a controller's command")
