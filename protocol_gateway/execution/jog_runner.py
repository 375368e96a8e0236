"""Jogs: motion of the holder for as long as keep-alives arrive.

    JOG          plan and check the first part (worker process) -> evaluate -> audit on disk -> wait
    keep-alive   the first one begins the motion; each puts the deadline 150 ms after its arrival
    each part    plan and check from the robot's present positions -> evaluate -> controller's socket
    the end      HOLD -> at rest, RESET, which gives the rest of the motion up -> audit

A part is commanded when the robot is near enough to its last target: never more than 10 mm or 2 degrees
beyond its measured position. A new part replaces the running one, so the arm does not stop between them. A
jog ends with its release, without a keep-alive, with another command of its operator, at the end of its line,
and as a program does. The deadline is a timer of its own, because a check may take longer.
"""

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from protocol_gateway.authority import lease_rules
from protocol_gateway.authority.decisions import CheckVerdict, PlannedProgram
from protocol_gateway.authority.events import JogEnded, JogEnding, JogHeld, JogPartReady, StopRequested
from protocol_gateway.authority.lease_rules import not_sent, why_not_holder
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.checking.worker_messages import Extended, Positions
from protocol_gateway.execution.abort import abort_reason
from protocol_gateway.execution.control import Control, command_answer, refusal
from protocol_gateway.execution.motion_checks import MotionChecks
from protocol_gateway.seam import Activity
from protocol_gateway.seam.errors import CheckError
from protocol_gateway.telemetry.journal import Journal
from robomesh import reason_codes as codes
from robomesh.contract.enum_names import enum_word
from robomesh.contract.messages import reason_message
from robomesh.errors import RefusedError
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robots.kinematics.joints import Joints
from robots.programs.jog_steps import MOST_M_S, MOST_RAD_S, Jog
from robots.programs.statements import StepFrame

_C = schema.CommandRequest.Command
_J = schema.Jog

KEEP_ALIVE_S = 0.15
# The first keep-alive may arrive this late: before it, nothing moves.
FIRST_KEEP_ALIVE_S = 1.0
_POLL_S = 0.01
# A robot that does not move for this long after a command has ignored it.
_START_TIMEOUT_S = 2.0
# A robot that still moves this long after its hold has ignored it.
_HOLD_TIMEOUT_S = 2.0
# A controller that is idle for this long after a hold had nothing to hold.
_NOTHING_HELD_S = 0.5
_FRAMES = {_J.TOOL: StepFrame.TOOL, _J.BASE: StepFrame.BASE, _J.SITE: StepFrame.SITE}
# Ends that need no attention.
_ORDINARY = frozenset({codes.JOG_RELEASED.name, codes.JOG_COMMANDED.name, codes.JOG_NOT_HELD_DOWN.name})

log = logging.getLogger(__name__)


@dataclass
class _Run:
    """A jog that runs.

    Attributes:
        secret: Secret of the lease under which it runs.
        last_stop_id: Number of the newest stop at its start.
        percent: Speed before it; None: unknown.
        deadline_s: Time at which it ends without another keep-alive (monotonic).
        last: Newest commanded target [rad] or [m], `commanded` from the origin; None: nothing has moved.
        end: Why the line ends at `last`; None: it goes on, as far as is known.
        why: Why the jog ended; None: it runs.
    """

    id: int
    request: schema.Jog
    jog: Jog
    name: str
    operator: str
    secret: str
    last_stop_id: int
    percent: float | None
    origin: Positions
    rotary: bool
    begin_s: float
    deadline_s: float
    first: tuple[Extended, CheckVerdict] | None
    keep_alives: int = 0
    sequence: int = 0
    last: Positions | None = None
    commanded: float = 0.0
    moved: float = 0.0
    progress_s: float = 0.0
    end: Reason | None = None
    why: Reason | None = None
    warned: bool = False


class JogRunner:
    """Runner of one robot's jogs, one at a time.

    Args:
        controller: Returns the current state of the controller.
        can_jog: The driver declares what a jog needs.
        tool_speed: Greatest speed of the tool by the site file [m/s]; 0: no jogs.
    """

    def __init__(
        self,
        control: Control,
        checks: MotionChecks,
        *,
        joints: Joints,
        journal: Journal,
        controller: Callable[[], ControllerState],
        can_jog: bool,
        tool_speed: float,
    ) -> None:
        self._control, self._checks, self._joints = control, checks, joints
        self._journal, self._controller = journal, controller
        self._can_jog, self._tool_speed = can_jog, min(tool_speed, MOST_M_S)
        self._run: _Run | None = None
        self._ended: _Run | None = None
        # Id of the jog that is being prepared, and what cancels it.
        self._preparing: tuple[int, asyncio.Future[Reason]] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def running(self) -> schema.JogState | None:
        """State of the jog that runs; None: none runs."""
        if self._run is None:
            return None
        return schema.JogState(operator=self._run.operator, jog=self._run.request)

    # ---------------------------------------------------------------- requests

    async def begin(
        self, request: schema.CommandRequest, *, operator: str, source: str
    ) -> schema.CommandAnswer:
        """Plan a jog and start it; the answer means that its keep-alives are awaited.

        Raises:
            RefusedError: If it is refused, with the reason; the robot has not moved.
        """
        admission = self._control.admit(request, operator)
        refused, run, start = None, None, None
        if admission.repeat or not admission.answer.accepted:
            refused = None if admission.answer.accepted else admission.answer
        elif self._preparing is not None or self._run is not None:
            refused = not_sent(codes.JOG_RUNS())
        elif (problem := self._control.refusal_now(request)) is not None:
            refused = problem
        else:
            try:
                run = await self._prepare(request, operator)
                start = run.origin
            except CheckError as error:
                refused = not_sent(error.reason)
        program = None if run is None else PlannedProgram(name=run.name, targets=(), start=start, is_jog=True)
        answer = await self._control.attempt(
            [request], operator=operator, source=source, program=program, refused=refused
        )
        if not answer.accepted:
            raise refusal(answer)
        running = self._control.program
        if run is not None and running is not None and running.program is program:
            run.begin_s = run.progress_s = time.monotonic()
            run.deadline_s = run.begin_s + FIRST_KEEP_ALIVE_S
            self._run = run
            self._watch()
            self._task = asyncio.create_task(self._run_to_end(run))
        return command_answer(answer)

    def keep_alive(self, request: schema.JogRequest, *, operator: str) -> schema.JogAnswer:
        """Keep a jog alive, or release it; return how far it is.

        Raises:
            RefusedError: If it is not the holder's, not new, or of a jog that is not known.
        """
        authority = self._control.authority
        if not lease_rules.holds(authority, operator, request.lease):
            raise RefusedError(why_not_holder(authority, operator))
        if self._preparing is not None and self._preparing[0] == request.jog:
            cancelled = self._preparing[1]
            if request.release and not cancelled.done():
                cancelled.set_result(codes.JOG_RELEASED())
            return schema.JogAnswer(running=not request.release)
        run = next((each for each in (self._run, self._ended) if each and each.id == request.jog), None)
        if run is None:
            raise RefusedError(codes.JOG_UNKNOWN(id=request.jog))
        if request.sequence <= run.sequence:
            raise RefusedError(codes.JOG_SEQUENCE(sequence=request.sequence, last=run.sequence))
        run.sequence = request.sequence
        if run is self._run:
            # A busy gateway may handle a late keep-alive before the timer that should have ended the jog.
            self._check_deadline(run)
            if request.release:
                self._end(run, codes.JOG_RELEASED())
            elif run.why is None:
                run.keep_alives += 1
                run.deadline_s = time.monotonic() + KEEP_ALIVE_S
                self._watch()
        return self._answer(run)

    def _answer(self, run: _Run) -> schema.JogAnswer:
        answer = schema.JogAnswer(running=run is self._run, moved=run.moved, rotary=run.rotary)
        if run.why is not None:
            answer.text = run.why.text
            answer.reason.CopyFrom(reason_message(run.why))
        return answer

    async def close(self) -> None:
        """End the jog that runs."""
        if self._run is not None:
            self._end(self._run, codes.ENDED_GATEWAY())
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    # ------------------------------------------------------------- preparation

    async def _prepare(self, request: schema.CommandRequest, operator: str) -> _Run:
        """Plan and check the first part of a jog.

        Raises:
            CheckError: If the jog is refused.
        """
        jog = self._direction(request)
        status = self._controller().status
        if not self._can_jog:
            raise CheckError(codes.JOG_NO_DRIVER())
        if status.activity is None:
            raise CheckError(codes.JOG_NO_STATE())
        authority = self._control.authority
        with self._control.preparing_program() as cancelled:
            self._preparing = request.id, cancelled
            part = asyncio.ensure_future(self._checks.jog_part(jog, request=request))
            try:
                await asyncio.wait((part, cancelled), return_when=asyncio.FIRST_COMPLETED)
                if cancelled.done():
                    raise CheckError(cancelled.result())
                start, extended, check_verdict = part.result()
            finally:
                self._preparing = None
                part.cancel()
                await asyncio.gather(part, return_exceptions=True)
        if extended.target is None:
            raise CheckError(extended.end or codes.JOG_NOT_MOVING())
        return _Run(
            id=request.id,
            request=request.jog,
            jog=jog,
            name=_name(request.jog),
            operator=operator,
            secret=request.lease,
            last_stop_id=authority.last_stop_id,
            percent=authority.speed_percent,
            origin=start,
            rotary=jog.turns(self._joints),
            begin_s=0.0,
            deadline_s=0.0,
            first=(extended, check_verdict),
        )

    def _direction(self, request: schema.CommandRequest) -> Jog:
        """Return what a request asks for.

        Raises:
            CheckError: If a value is missing or out of range, or the site file forbids jogging.
        """
        if not request.HasField("jog"):
            raise CheckError(codes.JOG_MISSING())
        asked = request.jog
        if asked.frame == _J.JOINT:
            if not 1 <= asked.joint <= len(self._joints):
                raise CheckError(codes.JOG_JOINT(number=asked.joint, joints=len(self._joints)))
            frame, axis = None, asked.joint - 1
        elif asked.frame not in _FRAMES:
            raise CheckError(codes.JOG_FRAME())
        elif not _J.X <= asked.axis <= _J.YAW:
            raise CheckError(codes.JOG_AXIS())
        else:
            frame, axis = _FRAMES[asked.frame], asked.axis - 1
        if not self._tool_speed:
            raise CheckError(codes.JOG_FORBIDDEN())
        jog = Jog(frame=frame, axis=axis, speed=asked.speed, tool_speed=self._tool_speed)
        rotary = jog.turns(self._joints)
        most = MOST_RAD_S if rotary else MOST_M_S
        # A NaN fails every comparison.
        if not 0.0 < abs(asked.speed) <= most * (1 + 1e-9):
            scale, unit = (180 / math.pi, "°/s") if rotary else (1000.0, "mm/s")
            raise CheckError(codes.JOG_SPEED(speed=asked.speed * scale, most=most * scale, unit=unit))
        return jog

    # ----------------------------------------------------------------- running

    def _watch(self) -> None:
        """Set the timer to the deadline of the jog that runs."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        run = self._run
        if run is not None and run.why is None:
            left_s = max(0.0, run.deadline_s - time.monotonic())
            self._timer = asyncio.get_running_loop().call_later(left_s + 0.0005, self._check_deadline, run)

    def _check_deadline(self, run: _Run) -> None:
        """End a jog after its deadline."""
        if run is not self._run or run.why is not None or time.monotonic() < run.deadline_s:
            return
        if run.keep_alives:
            self._end(run, codes.JOG_NOT_ALIVE(ms=round(KEEP_ALIVE_S * 1000)))
        else:
            self._end(run, codes.JOG_NOT_HELD_DOWN())

    def _end(self, run: _Run, why: Reason) -> None:
        """Hold the robot, and send no further part."""
        if run.why is None:
            run.why = why
            self._control.handle(JogEnding(why))
            self._watch()

    async def _run_to_end(self, run: _Run) -> None:
        try:
            try:
                await self._send_parts(run)
            except asyncio.CancelledError:
                raise
            except Exception:
                log.exception("a jog failed")
                self._end(run, codes.JOG_FAILED())
            await self._come_to_rest(run)
        finally:
            why = run.why or codes.ENDED_GATEWAY()
            run.why = why
            ordinary = why.code in _ORDINARY or (run.end is not None and why == run.end)
            self._run, self._ended = None, run
            self._control.handle(
                JogEnded(
                    name=run.name,
                    operator=run.operator,
                    moved=run.moved,
                    rotary=run.rotary,
                    duration_s=time.monotonic() - run.begin_s,
                    keep_alives=run.keep_alives,
                    why=why,
                    failed=not ordinary,
                )
            )

    async def _send_parts(self, run: _Run) -> None:
        """Send one part after the other until the jog ends, or its line."""
        while run.why is None:
            why = self._why_not(run)
            if why is not None:
                self._end(run, why)
            elif run.end is not None and self._rests_at_last(run):
                run.why = run.end
                self._control.handle(JogEnding(run.end, hold=False))
            elif run.keep_alives and run.end is None:
                await self._send_part(run)
            await asyncio.sleep(_POLL_S)

    def _why_not(self, run: _Run) -> Reason | None:
        """Return why the robot must not go on; None: it may."""
        authority = self._control.authority
        why = abort_reason(authority, run.operator, run.secret, run.last_stop_id)
        program = self._control.program
        if why is None and program is not None and program.ending is not None:
            why = program.ending
        if why is None:
            refusal = self._control.refusal_now(schema.CommandRequest(command=_C.JOG))
            why = None if refusal is None else refusal.reason
        if why is None and time.monotonic() - run.progress_s > _START_TIMEOUT_S:
            why = None if self._rests_at_last(run) else codes.JOG_NOT_MOVING()
        return why

    async def _send_part(self, run: _Run) -> None:
        """Plan, check and send the next part, if the robot has made way for one."""
        requests = (schema.CommandRequest(command=_C.JOG),)
        async with self._checks.motion_lock(requests):
            try:
                extended, check_verdict = await self._part(run)
            except CheckError as error:
                self._end(run, error.reason)
                return
            self._follow(run, extended)
            self._check_deadline(run)
            if run.why is not None or extended.target is None:
                run.end = extended.end
                return
            part = JogPartReady(
                operator=run.operator,
                secret=run.secret,
                target=extended.target,
                percent=extended.percent,
                check_verdict=check_verdict,
            )
            problem: Reason | None = self._control.handle(part)
        if problem is not None:
            self._end(run, self._why_not(run) or problem)
            return
        run.last, run.commanded = extended.target, extended.commanded
        self._warn(run, check_verdict)

    async def _part(self, run: _Run) -> tuple[Extended, CheckVerdict]:
        """Return the next part; the first one was checked before the start, and must still hold."""
        if run.first is not None:
            (extended, check_verdict), run.first = run.first, None
            return extended, replace(check_verdict, start=run.origin)
        _, extended, check_verdict = await self._checks.jog_part(
            run.jog, origin=run.origin, last=run.last, commanded=run.commanded
        )
        return extended, check_verdict

    def _follow(self, run: _Run, extended: Extended) -> None:
        if abs(extended.moved - run.moved) > 1e-4 or extended.target is not None:
            run.progress_s = time.monotonic()
        run.moved = extended.moved

    def _warn(self, run: _Run, check_verdict: CheckVerdict) -> None:
        if check_verdict.warning is None or run.warned:
            return
        run.warned = True
        self._journal.report(
            schema.Event.Severity.WARNING,
            check_verdict.code,
            f"jog {run.name}: {check_verdict.warning}",
            why=check_verdict.warning,
        )

    def _rests_at_last(self, run: _Run) -> bool:
        return run.last is None or self._checks.is_resting_at(run.last)

    async def _come_to_rest(self, run: _Run) -> None:
        """Wait until the robot rests, give its held motion up, and measure how far it came."""
        held_s = time.monotonic()
        while run.last is not None and self._control.authority.stop is None:
            activity, waited_s = self._controller().status.activity, time.monotonic() - held_s
            if activity is Activity.HOLDING or (
                activity is Activity.IDLE and self._rests_long(run, waited_s)
            ):
                break
            if activity in (None, Activity.STOPPED, Activity.FAULT) and waited_s >= _NOTHING_HELD_S:
                break
            if waited_s >= _HOLD_TIMEOUT_S:
                why = codes.STOP_JOG_NOT_HELD(seconds=_HOLD_TIMEOUT_S)
                self._control.handle(StopRequested(by="gateway", reason=why, source="gateway"))
                break
            await asyncio.sleep(_POLL_S)
        await self._give_up(run)
        with contextlib.suppress(CheckError):
            _, extended, _ = await self._checks.jog_part(
                run.jog, origin=run.origin, last=run.last, commanded=run.commanded, more=False
            )
            run.moved = extended.moved

    def _rests_long(self, run: _Run, waited_s: float) -> bool:
        """Return whether a controller has been idle for so long that its hold does not follow any more."""
        return waited_s >= _NOTHING_HELD_S or (run.end is not None and run.why == run.end)

    async def _give_up(self, run: _Run) -> None:
        """Give the held motion up; return when the controller accepts motion again, or does not in time."""
        if run.last is None:
            return
        self._control.handle(JogHeld(run.percent))
        given_up_s = time.monotonic()
        while (
            self._controller().status.activity is Activity.HOLDING
            and self._control.authority.stop is None
            and time.monotonic() - given_up_s < _HOLD_TIMEOUT_S
        ):
            await asyncio.sleep(_POLL_S)


def _name(jog: schema.Jog) -> str:
    """Return a jog in words: "base x +"."""
    sign = "+" if jog.speed > 0 else "-"
    if jog.frame == _J.JOINT:
        return f"joint {jog.joint} {sign}"
    return f"{enum_word(_J.Frame, jog.frame)} {enum_word(_J.Axis, jog.axis)} {sign}"
