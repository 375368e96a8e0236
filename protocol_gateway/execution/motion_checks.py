"""Collision check of one robot's motions before they start, against the present state of its cell.

    policy    check passes   passes with warning   check fails     cannot be checked
    --------  -------------  --------------------  --------------  -----------------
    require   sent           sent, warned          refused         refused
    warn      sent           sent, warned          sent, warned    sent, warned
    off       motions are not checked; a program is, because the check plans its steps, with warnings only

The check covers the straight path in joint space from the robot's positions to its target, against fixtures,
its own links, and every other robot of the cell at its positions and along its commanded path.
"""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import replace

from protocol_gateway.authority.admission import LONGEST_WAIT_S, time_left_s
from protocol_gateway.authority.decisions import CheckVerdict
from protocol_gateway.authority.lease_rules import MOTION_COMMANDS, Answer, not_sent, refused
from protocol_gateway.authority.preconditions import ControllerState, predicted, target_of
from protocol_gateway.authority.robot_authority import RobotAuthority
from protocol_gateway.checking.cell_occupancy import CellOccupancy, Occupancy
from protocol_gateway.checking.checker import SHARE_OF_DEADLINE, Checker
from protocol_gateway.checking.policy import Policy
from protocol_gateway.checking.worker_messages import (
    Checked,
    CheckMotion,
    CheckProgram,
    Extended,
    ExtendJog,
    Positions,
)
from protocol_gateway.execution.clocks import read_clocks
from protocol_gateway.link.motion import has_arrived
from protocol_gateway.seam import Activity
from protocol_gateway.seam.errors import CheckError
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest
from robots.kinematics.joints import Joints
from robots.programs.jog_steps import Jog

_C = CommandRequest.Command
_CLOSE, _FAILED, _SKIPPED = "check.warning", "check.failed", "check.skipped"
# Noise in the positions of a robot at rest [rad] or [m].
_REST_TOLERANCE = 1e-3


class MotionChecks:
    """Check of one robot's motions and programs.

    Args:
        cell: Names of the robots of its cell, including its own.
        within_s: Longest check of a motion; None: by what the last ones took.
        checker: Worker process for motions.
        planner: Worker process for programs.
    """

    def __init__(
        self,
        name: str,
        policy: Policy,
        *,
        cell: Sequence[str],
        checker: Checker,
        planner: Checker,
        cell_occupancy: CellOccupancy,
        joints: Joints,
        robot_authority: RobotAuthority,
        controller: Callable[[], ControllerState],
        within_s: float | None = None,
    ) -> None:
        self.policy, self._within_s = policy, within_s
        self._name, self._cell = name, tuple(cell)
        self._checker, self._planner, self._cell_occupancy = checker, planner, cell_occupancy
        self._joints, self._robot_authority, self._controller = joints, robot_authority, controller
        cell_occupancy.add(name, self.occupancy)

    @property
    def why_cell_closed(self) -> Reason | None:
        """Reason why no robot of the cell may be controlled or moved now; None: they may."""
        return self._cell_occupancy.closed

    @property
    def problem(self) -> Reason | None:
        """Reason why motions cannot be checked now; None: they can, or need not."""
        if self.policy is Policy.OFF:
            return None
        return self._checker.problem(self._name) or self._controller().set_up

    @property
    def is_starting(self) -> bool:
        """True if motions cannot be checked only because the check is starting."""
        return self.policy is not Policy.OFF and self._checker.is_starting(self._name)

    def motion_lock(self, requests: Sequence[CommandRequest]) -> AbstractAsyncContextManager[None]:
        """Return the cell's motion lock for commands that move the robot, otherwise a null context."""
        moves = any(each.command in MOTION_COMMANDS for each in requests)
        # A robot without checks of its motions is still an obstacle for the other robots of its cell.
        meets = self.policy is not Policy.OFF or len(self._cell) > 1
        return self._cell_occupancy.motion_lock if moves and meets else contextlib.nullcontext()

    async def check(self, requests: Sequence[CommandRequest]) -> CheckVerdict:
        """Check commands that would be sent now."""
        moves = any(each.command in MOTION_COMMANDS and each.command != _C.RUN_PROGRAM for each in requests)
        if self.policy is Policy.OFF or not moves:
            return CheckVerdict()
        try:
            start = self._start(must_rest=self.policy is Policy.REQUIRE)
            others, left_out = self._others()
            checked = await self._checker.motion(
                CheckMotion(robot=self._name, start=start, targets=self._targets(requests), others=others),
                timeout_s=self._timeout_s(requests),
            )
        except CheckError as error:
            return self._not_checked(error.reason)
        return self._evaluate(checked, left_out, start, others)

    async def program(self, text: str) -> tuple[Checked, CheckVerdict]:
        """Plan and check a program from the robot's present positions.

        Raises:
            CheckError: If it could not be planned and checked, or not in time.
        """
        # The plan begins at these positions with any policy.
        start = self._start(must_rest=True)
        others, left_out = self._others()
        checked = await self._planner.program(
            CheckProgram(robot=self._name, text=text, start=start, others=others)
        )
        if not checked.readable:
            return checked, CheckVerdict(refusal=_refused("Not run", checked.refusals))
        # Each step is checked again before it is sent, against the other robots' state at that time.
        check_verdict = self._evaluate(checked, left_out, start, others, program=True)
        return checked, replace(check_verdict, start=start, others=None)

    async def jog_part(
        self,
        jog: Jog,
        *,
        origin: Positions | None = None,
        last: Positions | None = None,
        commanded: float = 0.0,
        more: bool = True,
        request: CommandRequest | None = None,
    ) -> tuple[Positions, Extended, CheckVerdict]:
        """Plan and check the next part of a jog; return also the robot's positions from which it was checked.

        With every policy but "off", what "require" refuses ends the jog.

        Args:
            origin: Positions where the jog began; None: it begins here, with the robot at rest.
            last: Newest commanded target; None: none yet.
            commanded: Its distance from the origin [m] or [rad].
            more: False: return only how far the robot is.
            request: The command that begins the jog; None: it runs.

        Raises:
            CheckError: If it could not be checked, or not in time.
        """
        start = self._start(must_rest=origin is None)
        others, left_out = ({}, None) if self.policy is Policy.OFF or not more else self._others()
        origin = origin or start
        extended = await self._checker.jog(
            ExtendJog(
                robot=self._name,
                jog=jog,
                origin=origin,
                measured=start,
                last=last or origin,
                commanded=commanded,
                others=others,
                collisions=self.policy is not Policy.OFF,
                more=more,
            ),
            timeout_s=self._timeout_s(() if request is None else (request,)),
        )
        if more and extended.uncovered and self.policy is Policy.REQUIRE:
            raise CheckError(codes.CHECK_REQUIRED(*_first_few(extended.uncovered)))
        warnings = (*extended.uncovered, *extended.warnings, *(() if left_out is None else (left_out,)))
        code = _SKIPPED if extended.uncovered or left_out else _CLOSE
        required = others if self.policy is Policy.REQUIRE else None
        return start, extended, CheckVerdict(warning=_combined(warnings), code=code, others=required)

    def occupancy(self) -> Occupancy:
        """Return the positions that this robot may occupy from now on."""
        controller, authority = self._controller(), self._robot_authority.authority
        if controller.positions is None:
            return Occupancy(unknown=codes.OTHER_NO_POSITION())
        motion = authority.motion
        program = self._robot_authority.program
        ahead = () if program is None else program.ahead
        if motion is not None and motion.waypoints:
            ahead = (*motion.waypoints, *ahead)
        elif motion is not None or _moves(controller, authority.moving):
            return Occupancy(unknown=codes.OTHER_MOVES())
        return Occupancy(path=(controller.positions, *ahead))

    def why_changed(self, check_verdict: CheckVerdict) -> Reason | None:
        """Return the reason if the cell has changed since a motion was checked; None: unchanged."""
        if check_verdict.start and not self.is_resting_at(check_verdict.start):
            return codes.ROBOT_MOVED()
        for name, checked in (check_verdict.others or {}).items():
            now = self._cell_occupancy.others(self._name, self._cell)[name]
            # A moving robot was checked along its whole path; a resting one must still be in its place.
            left = len(checked) == 1 and now.path and not self._near(now.path[0], checked[0])
            new_target = any(not any(self._near(target, was) for was in checked) for target in now.path[1:])
            if now.unknown or left or new_target:
                return codes.ROBOT_OTHER_MOVED(name=name)
        return None

    def _near(self, one: Positions, other: Positions) -> bool:
        return len(one) == len(other) and all(
            abs(a - b) <= _REST_TOLERANCE for a, b in zip(one, other, strict=True)
        )

    def is_resting_at(self, start: Positions) -> bool:
        """Return whether the robot rests at the positions where its motion was checked."""
        controller = self._controller()
        resting = not _moves(controller, self._robot_authority.authority.moving)
        return resting and has_arrived(start, controller.positions, self._joints.types)

    def _timeout_s(self, requests: Sequence[CommandRequest]) -> float:
        """Return how long a check may take: within the earliest deadline, so that the commands can be sent.

        Stops, HOLD and the end of a jog do not wait for it.
        """
        now = read_clocks()
        left_s = [time_left_s(each, now) for each in requests if each.HasField("not_after")]
        share_s = SHARE_OF_DEADLINE * min(left_s, default=LONGEST_WAIT_S)
        return max(0.0, min(share_s, self._within_s or self._checker.longest_s))

    def _start(self, *, must_rest: bool) -> Positions:
        """Return the robot's positions, from which a motion is checked.

        Args:
            must_rest: The robot must neither move nor be about to.

        Raises:
            CheckError: If the positions are unknown, or the robot moves but must rest.
        """
        controller, authority = self._controller(), self._robot_authority.authority
        if controller.positions is None:
            raise CheckError(codes.CHECK_NO_POSITION())
        if must_rest:
            motion = authority.motion
            arrived = motion is not None and has_arrived(
                motion.target, controller.positions, self._joints.types
            )
            if _moves(controller, authority.moving) or (motion and not motion.held and not arrived):
                # A controller's own motion, for example a demonstration, ends when a command arrives.
                required = self.policy is Policy.REQUIRE
                raise CheckError((codes.ROBOT_MOVES_STOP if required else codes.ROBOT_MOVES_HOME)())
        return controller.positions

    def _targets(self, requests: Sequence[CommandRequest]) -> tuple[Positions, ...]:
        """Return the targets of the commands, in order.

        Raises:
            CheckError: If the path of a held motion is unknown.
        """
        targets: list[Positions] = []
        controller = self._controller()
        for request in requests:
            if request.command == _C.RESUME:
                motion = self._robot_authority.authority.motion
                waypoints = () if motion is None else motion.waypoints
                if not waypoints:
                    raise CheckError(codes.CHECK_HELD_WAY_UNKNOWN())
                targets += waypoints
            elif (target := target_of(request, controller, self._joints)) is not None:
                targets.append(target)
            controller = predicted(request, controller, self._joints)
        return tuple(targets)

    def _others(self) -> tuple[dict[str, tuple[Positions, ...]], Reason | None]:
        """Return the known paths of the cell's other robots, and the reason for what the check leaves out.

        Raises:
            CheckError: If checks are required, and a path or what the arm carries is unknown.
        """
        set_up = self._controller().set_up
        if set_up is not None and self.policy is Policy.REQUIRE:
            raise CheckError(set_up)
        others = self._cell_occupancy.others(self._name, self._cell)
        unknown = [
            codes.CHECK_OTHER_UNKNOWN(each.unknown, name=name)
            for name, each in others.items()
            if each.unknown is not None
        ]
        if unknown and self.policy is Policy.REQUIRE:
            raise CheckError(codes.CHECK_OTHERS_UNKNOWN(*unknown))
        known = {name: each.path for name, each in others.items() if each.unknown is None}
        left_out = [codes.CHECK_OTHERS_LEFT_OUT(*unknown)] if unknown else []
        return known, _combined([*([] if set_up is None else [set_up]), *left_out])

    def _not_checked(self, *why: Reason) -> CheckVerdict:
        if self.policy is Policy.REQUIRE:
            return CheckVerdict(refusal=not_sent(codes.CHECK_REQUIRED(*why)))
        return CheckVerdict(warning=codes.CHECK_SKIPPED(*why), code=_SKIPPED)

    def _evaluate(
        self,
        checked: Checked,
        left_out: Reason | None,
        start: Positions,
        others: Mapping[str, tuple[Positions, ...]],
        *,
        program: bool = False,
    ) -> CheckVerdict:
        warnings = checked.warnings if left_out is None else (*checked.warnings, left_out)
        if self.policy is Policy.REQUIRE:
            if checked.uncovered:
                return self._not_checked(*_first_few(checked.uncovered))
            if checked.refusals and program:
                return CheckVerdict(refusal=_refused("Not run", _first_few(checked.refusals)))
            if checked.refusals:
                return CheckVerdict(refusal=not_sent(codes.CHECK_ON_ITS_WAY(*_first_few(checked.refusals))))
            return CheckVerdict(warning=_combined(warnings), start=start, others=others)
        code = _FAILED if checked.refusals else _SKIPPED if left_out or checked.uncovered else _CLOSE
        return CheckVerdict(warning=_combined((*checked.refusals, *checked.uncovered, *warnings)), code=code)


def _moves(controller: ControllerState, moving: bool | None) -> bool:
    # Before the first observation, only the activity that the controller reports counts.
    return bool(moving) or controller.status.activity in (Activity.MOVING, Activity.HOMING)


def _refused(what: str, reasons: Sequence[Reason]) -> Answer:
    return refused(reasons[0] if len(reasons) == 1 else codes.SEVERAL(*reasons), what=what)


def _combined(reasons: Sequence[Reason]) -> Reason | None:
    few = _first_few(reasons)
    return codes.SEVERAL(*few) if len(few) > 1 else few[0] if few else None


def _first_few(reasons: Sequence[Reason], most: int = 3) -> tuple[Reason, ...]:
    """Return the first reasons, and the number of the others."""
    more = [codes.CHECK_MORE(count=len(reasons) - most)] if len(reasons) > most else []
    return (*reasons[:most], *more)
