"""Evaluation of commands against lease, stop, program and the controller's state. No I/O."""

from dataclasses import dataclass, replace

from protocol_gateway.authority.admission import (
    Admission,
    admit_all,
    after_command,
    deadline_refusal,
    stop_refusal,
    wait_refusal,
)
from protocol_gateway.authority.audit_entry import MESH
from protocol_gateway.authority.decisions import PlannedProgram, Snapshot
from protocol_gateway.authority.events import CommandsRequested
from protocol_gateway.authority.lease_rules import MOTION_COMMANDS, Answer, Authority, Now, holds, not_sent
from protocol_gateway.authority.preconditions import ControllerState, predicted, refusal_now
from protocol_gateway.seam import Activity
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest
from robots.kinematics.joints import Joints

_C = CommandRequest.Command

# A controller may still report a stop for this long after its reset.
RESET_SHOWS_WITHIN_S = 0.3


@dataclass(frozen=True, kw_only=True)
class RunningProgram:
    """Program or jog that moves the robot.

    Attributes:
        done: Number of targets that were sent to the controller.
        held: HOLD was sent, and no RESUME since.
        given_up: RESET was sent while the program was held, so the rest of it must not run.
        ending: Why a jog ends: nothing more of it is sent; None: it goes on.
    """

    program: PlannedProgram
    done: int = 0
    held: bool = False
    given_up: bool = False
    ending: Reason | None = None

    @property
    def ahead(self) -> tuple[tuple[float, ...], ...]:
        """Targets after the current motion [rad] or [m]."""
        return self.program.targets[self.done :]

    def after(self, request: CommandRequest, controller: ControllerState) -> "RunningProgram":
        """Return the program after a command was sent, before which the controller was in a state."""
        match request.command:
            case _C.HOLD | _C.RESUME:
                return replace(self, held=request.command == _C.HOLD)
            case _C.RESET:
                holding = controller.status.activity is Activity.HOLDING
                return replace(self, given_up=self.held or holding)
        return self


def admit_commands(command: CommandsRequested, authority: Authority, now: Now) -> Admission:
    """Evaluate whether commands are the holder's, in time and new, and no stop forbids them."""
    if not command.step:
        return admit_all(authority, command.requests, operator=command.operator, now=now)
    held = holds(authority, command.operator, command.requests[0].lease)
    return Admission(Answer(True, "") if held else not_sent(codes.COMMAND_CONTROL_ENDED()))


def refusal_of(
    command: CommandsRequested,
    authority: Authority,
    program: RunningProgram | None,
    seen: Snapshot,
    joints: Joints,
) -> Answer | None:
    """Return the refusal of commands, each evaluated after the previous ones; None: allowed.

    Args:
        program: Program that runs.
    """
    controller, refusal = seen.controller, None
    if command.held_up or not all(each.HasField("not_after") for each in command.requests):
        refusal = wait_refusal(command.arrived.monotonic_s, seen.now)
    motions = [each.command for each in command.requests if each.command in MOTION_COMMANDS]
    if len(motions) > 1 and _C.RESUME in motions:
        # Some controllers resume the held motion first, others drop it, so the path would be unknown.
        return not_sent(codes.COMMAND_TWO_UNITS())
    # A recovery comes from an operator only, who sees its outcome before the next command.
    by_program = command.step or command.source != MESH or len(command.requests) > 1
    if by_program and any(each.command == _C.RECOVER for each in command.requests):
        return not_sent(codes.RECOVER_PROGRAM())
    for request in command.requests:
        refusal = (
            refusal
            or deadline_refusal(request, seen.now)
            or stop_refusal(authority, request, seen.now)
            or _latch_refusal(request, seen)
            or _closed_refusal(request, seen)
            or (None if command.step else _program_refusal(request, program))
            or _recover_refusal(request, authority)
            or controller_refusal(request, authority, controller, seen, joints)
        )
        if refusal is not None:
            return refusal
        authority = after_command(authority, request)
        controller = predicted(request, controller, joints)
    return refusal


def controller_refusal(
    request: CommandRequest, authority: Authority, controller: ControllerState, seen: Snapshot, joints: Joints
) -> Answer | None:
    """Return the refusal of a command by the controller's state; None: allowed."""
    status, reset_s = controller.status, authority.reset_s
    just_reset = reset_s is not None and seen.now.monotonic_s - reset_s < RESET_SHOWS_WITHIN_S
    if just_reset and status.activity in (Activity.STOPPED, Activity.FAULT):
        # The controller still reports the stop that was just reset. If it is stopped, it refuses itself.
        controller = replace(controller, status=replace(status, activity=None))
    return refusal_now(request, controller, joints)


def refusal_meanwhile(
    command: CommandsRequested,
    authority: Authority,
    program: RunningProgram | None,
    seen: Snapshot,
    joints: Joints,
) -> Answer | None:
    """Return the refusal of commands after their audit entry was written; None: send them."""
    if not holds(authority, command.operator, command.requests[0].lease):
        return not_sent(codes.COMMAND_CONTROL_ENDED_MEANWHILE())
    overtaken = _overtaken_by_hold(command, authority, program)
    return overtaken or refusal_of(command, authority, program, seen, joints)


def _overtaken_by_hold(
    command: CommandsRequested, authority: Authority, program: RunningProgram | None
) -> Answer | None:
    if not command.moves:
        return None
    if command.step:
        held = program is not None and (program.held or program.given_up)
    else:
        held = authority.lease is not None and authority.lease.last_id > command.requests[-1].id
    return not_sent(codes.COMMAND_HELD()) if held else None


def _latch_refusal(request: CommandRequest, seen: Snapshot) -> Answer | None:
    if seen.latch_problem is None or request.command not in MOTION_COMMANDS:
        return None
    return not_sent(codes.COMMAND_NOT_LATCHED(seen.latch_problem))


def _closed_refusal(request: CommandRequest, seen: Snapshot) -> Answer | None:
    if seen.closed is None or request.command not in MOTION_COMMANDS | {_C.RECOVER}:
        return None
    return not_sent(seen.closed)


def _program_refusal(request: CommandRequest, program: RunningProgram | None) -> Answer | None:
    # The check of a program holds only at its speed.
    if program is None or request.command not in MOTION_COMMANDS | {_C.SPEED, _C.RECOVER}:
        return None
    if program.program.is_jog:
        return not_sent(codes.JOG_RUNS())
    if request.command == _C.RESUME:
        return None
    return not_sent(codes.COMMAND_PROGRAM_RUNS(name=program.program.name))


def _recover_refusal(request: CommandRequest, authority: Authority) -> Answer | None:
    """Return the refusal of a recovery that could meet motion; None: the robot is seen to rest."""
    if request.command != _C.RECOVER:
        return None
    if authority.motion is not None:
        return not_sent(codes.RECOVER_HELD() if authority.motion.held else codes.RECOVER_MOVES())
    return None if authority.moving is False else not_sent(codes.RECOVER_MOVES())
