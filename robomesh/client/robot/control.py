"""Control of a robot by a program: a lease that lives only while the program does.

The lease is renewed while a call waits, and once more when the call returns, for 5 s. Nothing else renews it:
if the program hangs, is stopped or killed, the lease ends, and the gateway stops a motion that may still run.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self, TypeVar

from robomesh import reason_codes as codes
from robomesh.client.robot.commands import (
    CommandResult,
    JogResult,
    Progress,
    StopResult,
    numbers,
    program_text,
    request_stop,
)
from robomesh.client.robot.motion_reports import MotionReports
from robomesh.contract.keys import robot_key
from robomesh.errors import BusyError, MessageError, MotionError, NoAnswerError, RefusedError, RobomeshError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import one_line
from robomesh.wire.presence import OPERATOR, session_of
from robomesh.wire.session import Session

T = TypeVar("T")
log = logging.getLogger(__name__)

_A = schema.LeaseRequest
_C = schema.CommandRequest
_MOTIONS = (_C.HOME, _C.RESUME, _C.MOVE_ABSOLUTE, _C.MOVE_RELATIVE)

_AXES = {
    "x": schema.Jog.X,
    "y": schema.Jog.Y,
    "z": schema.Jog.Z,
    "roll": schema.Jog.ROLL,
    "pitch": schema.Jog.PITCH,
    "yaw": schema.Jog.YAW,
}
_FRAMES = {"tool": schema.Jog.TOOL, "base": schema.Jog.BASE, "site": schema.Jog.SITE}
# While a call waits; renewed four times in that time, so that the lease outlives late answers.
_WAITING_TTL_S = 2.0
# After a call: the longest that a gateway grants.
_IDLE_TTL_S = 5.0
_RENEWAL_TIMEOUT_S = 0.5
# A command that was delayed by more than this must not move the arm.
_ANSWER_S = 3.0
# The gateway plans and checks a whole program before it begins.
_PROGRAM_S = 60.0
# After the end of control, the gateway publishes the reason within this time.
_REASON_S = 1.5
# A stopped arm comes to rest within this time.
_REST_S, _POLL_S = 5.0, 0.2
_WARNING = "; mind: "
# Interval of a jog's keep-alives, and how many releases may go without an answer.
_KEEP_ALIVE_S, _KEEP_ALIVE_TIMEOUT_S, _MOST_UNANSWERED = 0.04, 0.5, 4


class AsyncArm:
    """A controlled arm, for asynchronous programs; an asynchronous context manager.

    Every motion call waits for the end of the motion, unless `wait=False`. If it is cancelled, or the block
    ends with an error while a motion runs, the robot is stopped.

    Raises:
        RefusedError: Of every call: the gateway refused it, with the reason's code.
        MotionError: Of a motion call: the motion ended before its target, with the reason's code.
        NoAnswerError: The gateway did not answer, or fell silent.

    Attributes:
        operator: Name that the robot's users see.
        stopped: Answer to the stop that ended an interrupted motion; None: there was none.
        progress: Callbacks while a command runs.
    """

    def __init__(
        self,
        session: Session,
        site: str,
        robot: str,
        operator: str,
        *,
        si: Callable[[Sequence[float]], Awaitable[Sequence[float]]],
        take: str = "",
    ) -> None:
        self._session, self.site, self.robot = session, site, robot
        self._si, self._take = si, one_line(take)
        self.progress = Progress()
        self.operator = operator
        self.stopped: StopResult | None = None
        self._lease = ""
        self._last_id = 0
        # Gateway's clock minus the monotonic clock, at least [ns].
        self._clock_ns = 0
        self._moving = False  # a motion or program was accepted, and its end was not seen yet
        self._accepted_s = 0.0
        self._runs_program = False
        self._reports: MotionReports | None = None
        self._close = contextlib.ExitStack()

    def __str__(self) -> str:
        return f"{self.site}/{self.robot}"

    def __repr__(self) -> str:
        return f"<arm of {self}, for {self.operator}>"

    # ---------------------------------------------------------------- control

    async def __aenter__(self) -> Self:
        with contextlib.ExitStack() as undo:
            identity = session_of(self.operator)
            token = self._session.declare_presence_of(self.site, self.robot, OPERATOR, identity)
            undo.callback(token.undeclare)
            reports = MotionReports(self._session, self.site, self.robot, self.operator)
            undo.callback(reports.close)
            action = _A.TAKE if self._take else _A.ACQUIRE
            request = _A(action=action, ttl_s=_IDLE_TTL_S, reason=self._take, session=identity)
            answer = await self._session.ask(self._lease_key, request)
            assert isinstance(answer, schema.LeaseAnswer)
            self._reports, self._lease = reports, answer.lease
            self._set_clock(answer)
            self._close = undo.pop_all()
        return self

    async def __aexit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        await self.leave(failed=error_type is not None)

    async def leave(self, *, failed: bool) -> None:
        """Release control.

        Args:
            failed: Stop a motion that may still run, instead of waiting for its end.
        """
        with self._close:
            try:
                if failed:
                    await self._stop_if_moving("its program ended with an error")
                else:
                    await self.wait()
            finally:
                with contextlib.suppress(RobomeshError):
                    release = _A(action=_A.RELEASE, lease=self._lease)
                    await self._session.ask(self._lease_key, release, timeout_s=1.0)

    async def renew(self) -> None:
        """Keep control for another 5 s.

        Raises:
            RefusedError: If control has ended.
        """
        await self._renew(_IDLE_TTL_S)

    # ---------------------------------------------------------------- motions

    async def home(self, *, wait: bool = True) -> CommandResult:
        """Home the robot."""
        return await self._motion(_C(command=_C.HOME), wait=wait)

    async def move_joints(self, positions: Sequence[float], *, wait: bool = True) -> CommandResult:
        """Move to joint positions [rad], of prismatic joints [m]."""
        return await self._motion(_C(command=_C.MOVE_ABSOLUTE, joint_positions=numbers(positions)), wait=wait)

    async def move_joints_deg(self, positions: Sequence[float], *, wait: bool = True) -> CommandResult:
        """Move to joint positions in degrees, of prismatic joints in mm.

        Raises:
            NoAnswerError: Also if the robot has no description to convert them with.
        """
        return await self.move_joints(await self._si(numbers(positions)), wait=wait)

    async def move_joints_by(self, distances: Sequence[float], *, wait: bool = True) -> CommandResult:
        """Move every joint by a distance [rad], prismatic joints [m]."""
        return await self._motion(_C(command=_C.MOVE_RELATIVE, joint_positions=numbers(distances)), wait=wait)

    async def move_joints_by_deg(self, distances: Sequence[float], *, wait: bool = True) -> CommandResult:
        """Move every joint by a distance in degrees, prismatic joints in mm."""
        return await self.move_joints_by(await self._si(numbers(distances)), wait=wait)

    async def run(self, program: str | Path, *, name: str = "", wait: bool = True) -> CommandResult:
        """Run a teach program: its text, or the path of its file.

        Args:
            name: Name for display; by default the file's.
        """
        name = name or (program.stem if isinstance(program, Path) else "")
        request = _C(command=_C.RUN_PROGRAM, program=program_text(program), program_name=name)
        return await self._motion(request, wait=wait)

    async def resume(self, *, wait: bool = True) -> CommandResult:
        """Resume the motion that `hold` paused."""
        return await self._motion(_C(command=_C.RESUME), wait=wait)

    async def jog(
        self, axis: str | int, speed: float, *, held: Callable[[], bool], frame: str = "base"
    ) -> JogResult:
        """Jog while `held` returns true: the tool on a straight line or about an axis, or one joint.

        A keep-alive follows every call of `held`, about 25 times a second. The gateway holds the robot if
        none arrives for 150 ms, so `held` must return quickly.

        Args:
            axis: "x", "y", "z", "roll", "pitch" or "yaw" (about x, y, z); or a joint's number, from 1.
            speed: The greatest speed [m/s] or [rad/s]; negative: in the other direction.
            held: Returns whether the operator still holds the button down; a blocking arm calls it on another
                thread.
            frame: "tool", "base" or "site"; not used for a joint.

        Raises:
            MessageError: If there is no such axis or frame.
        """
        request = _C(command=_C.JOG, jog=_direction(axis, frame, speed))
        return await self._guarded(self._jog(request, held))

    async def wait(self) -> None:
        """Wait for the end of the motion or program that a call with `wait=False` started.

        Raises:
            MotionError: If it ended before its target.
        """
        if self._moving:
            await self._guarded(self._until_ended())

    # --------------------------------------------------------- other commands

    async def hold(self) -> CommandResult:
        """Pause the motion."""
        return await self._other(_C(command=_C.HOLD))

    async def speed(self, percent: float) -> CommandResult:
        """Set the speed of motions, 1 to 100 %."""
        return await self._other(_C(command=_C.SPEED, speed_percent=percent))

    async def trace(self, on: bool) -> CommandResult:
        """Start or end the controller's trace, which the recorder records."""
        return await self._other(_C(command=_C.TRACE_ON if on else _C.TRACE_OFF))

    async def reset(self, stop_id: int | None = None) -> CommandResult:
        """Clear a latched stop, after its cause was removed; wait until the robot has come to rest.

        Args:
            stop_id: Number of the stop; None: the one that is latched now.
        """
        if stop_id is None:
            state = await self._session.last(self._key("controller"))
            stop_id = state.stop.id if isinstance(state, schema.ControllerState) else 0
        deadline_s = time.monotonic() + _REST_S
        while True:
            try:
                return await self._other(_C(command=_C.RESET, stop_id=stop_id))
            except RefusedError as error:
                if error.code != codes.STOP_MOVING.name or time.monotonic() > deadline_s:
                    raise
            await asyncio.sleep(_POLL_S)

    async def recover(self, recovery: str, *, reason: str, looked: bool) -> CommandResult:
        """Bring the controller back after its own stop or fault; no motion is resumed.

        The site file must allow the action by name (`recover`). It is sent once. The answer says only that it
        was sent: the robot's state shows the effect.

        Args:
            recovery: "unlock_protective_stop", "power_on", "brake_release", ...
            reason: Reason for the audit log and the event.
            looked: A person at the robot has looked, and found the cause. Without it, it is refused.

        Raises:
            MessageError: If there is no such recovery.
        """
        known = [name.lower() for name in schema.Recover.Recovery.keys()[1:]]
        if recovery not in known:
            raise MessageError(f"no recovery {recovery!r}: use {', '.join(known)}")
        recover = schema.Recover(recovery=recovery.upper(), reason=one_line(reason), looked=looked)
        return await self._other(_C(command=_C.RECOVER, recover=recover))

    async def stop(self, reason: str = "") -> StopResult:
        """Request a stop, which latches. A stop request is not an emergency stop."""
        result = await request_stop(self._session, self.site, self.robot, self.operator, reason)
        self._moving = False
        return result

    async def _other(self, request: schema.CommandRequest) -> CommandResult:
        return await self._guarded(self._command(request))

    async def _command(self, request: schema.CommandRequest) -> CommandResult:
        """Send a command, and return its answer."""
        self._last_id += 1
        within_s = _PROGRAM_S if request.command == _C.RUN_PROGRAM else _ANSWER_S
        request.lease, request.id = self._lease, self._last_id
        request.not_after.FromNanoseconds(time.monotonic_ns() + self._clock_ns + round(within_s * 1e9))
        answer = await self._renewed(
            self._session.ask(self._key(f"command/{self.operator}"), request, timeout_s=within_s)
        )
        assert isinstance(answer, schema.CommandAnswer)
        if not answer.accepted:
            raise RefusedError(answer.text)
        # An earlier gateway has the warning only in its sentence.
        return CommandResult(answer.text, answer.warning.text or answer.text.partition(_WARNING)[2])

    async def _motion(self, request: schema.CommandRequest, *, wait: bool) -> CommandResult:
        return await self._guarded(self._start(request, wait=wait))

    async def _start(self, request: schema.CommandRequest, *, wait: bool) -> CommandResult:
        answer = await self._accepted(request)
        if wait:
            self.progress.on_accepted(answer)
            await self._until_ended()
            return replace(answer, text="done")
        return answer

    async def _accepted(self, request: schema.CommandRequest) -> CommandResult:
        """Send a command that begins a motion, a program or a jog."""
        if self._reports is None:
            raise MessageError(f"{self} is not in control: use `with robot.control(...) as arm`")
        self._reports.forget()
        # Until the answer, the motion may or may not run.
        moved, self._moving = self._moving, True
        try:
            answer = await self._command(request)
        except RefusedError:
            self._moving = moved
            raise
        self._accepted_s = time.monotonic()
        self._runs_program = request.command == _C.RUN_PROGRAM
        return answer

    async def _jog(self, request: schema.CommandRequest, held: Callable[[], bool]) -> JogResult:
        await self._accepted(request)
        answer = await self._renewed(self._keep_alive(request.id, held))
        self._moving = False
        return JogResult(answer.moved, answer.rotary, answer.text, answer.reason.code)

    async def _keep_alive(self, jog: int, held: Callable[[], bool]) -> schema.JogAnswer:
        """Send keep-alives while `held`, then the release until the robot rests; return the last answer.

        An exception of `held` is a release, and is raised at rest.
        """
        unanswered, failure = 0, None
        request = schema.JogRequest(lease=self._lease, jog=jog)
        while True:
            sent_s = time.monotonic()
            request.sequence += 1
            try:
                request.release = request.release or not held()
            except Exception as error:
                request.release, failure = True, error
            try:
                answer = await self._session.ask(
                    self._key(f"jog/{self.operator}"), request, timeout_s=_KEEP_ALIVE_TIMEOUT_S
                )
            except (NoAnswerError, BusyError):
                # The gateway has held the robot meanwhile.
                request.release, unanswered = True, unanswered + 1
                if unanswered > _MOST_UNANSWERED:
                    raise
            else:
                assert isinstance(answer, schema.JogAnswer)
                if not answer.running:
                    if failure is not None:
                        raise failure
                    return answer
            await asyncio.sleep(max(0.0, sent_s + _KEEP_ALIVE_S - time.monotonic()))

    async def _guarded(self, waiting: Coroutine[Any, Any, T]) -> T:
        """Wait, and stop the robot if the program is interrupted."""
        try:
            result = await waiting
        except asyncio.CancelledError:
            await self._stop_if_moving(self.progress.stop_reason)
            raise
        except MotionError:
            self._moving = False
            raise
        if self.progress.is_alive():
            with contextlib.suppress(RobomeshError):  # the next command reports the end of control
                await self._renew(_IDLE_TTL_S)
        return result

    async def _until_ended(self) -> None:
        assert self._reports is not None
        if self._runs_program:
            ended = self._reports.program_ended(self._accepted_s, self.progress.on_step)
        else:
            ended = self._reports.motion_ended(self._accepted_s)
        await self._renewed(ended)
        self._moving = False

    async def _stop_if_moving(self, reason: str) -> None:
        if not self._moving:
            return
        try:
            self.stopped = await self.stop(reason)
        except RobomeshError as error:
            text = f"the stop failed: {error}; only the end of the lease stops it now"
            log.error("%s: %s", self, text)
            self.stopped = StopResult(0, False, text)

    # ---------------------------------------------------------------- renewal

    async def _renewed(self, waiting: Coroutine[Any, Any, T]) -> T:
        """Wait while renewing the lease.

        Raises:
            MotionError: If control ended first.
        """
        task = asyncio.create_task(waiting)
        renewing = asyncio.create_task(self._renew_while_alive())
        try:
            await asyncio.wait((task, renewing), return_when=asyncio.FIRST_COMPLETED)
            if not task.done():
                # The gateway's reason follows shortly, unless another session of that name has control.
                await asyncio.wait((task,), timeout=_REASON_S)
            if not task.done():
                reason = renewing.result().reason
                text = f"control ended before the motion did: {reason}"
                raise MotionError(codes.PROGRAM_CONTROL_ENDED(reason), text=text)
            return task.result()
        finally:
            for each in (task, renewing):
                each.cancel()
            await asyncio.gather(task, renewing, return_exceptions=True)

    async def _renew_while_alive(self) -> RefusedError:
        """Renew the lease until the gateway refuses; return its refusal."""
        while True:
            if self.progress.is_alive():
                try:
                    await self._renew(_WAITING_TTL_S)
                except (NoAnswerError, BusyError):
                    pass  # the lease outlives three late answers
                except RefusedError as error:
                    return error
            await asyncio.sleep(_WAITING_TTL_S / 4)

    async def _renew(self, ttl_s: float) -> None:
        renewal = _A(action=_A.RENEW, lease=self._lease, ttl_s=ttl_s)
        answer = await self._session.ask(self._lease_key, renewal, timeout_s=_RENEWAL_TIMEOUT_S)
        assert isinstance(answer, schema.LeaseAnswer)
        self._set_clock(answer)

    def _set_clock(self, answer: schema.LeaseAnswer) -> None:
        """Take over the gateway's clock, because over hours two monotonic clocks drift apart."""
        self._clock_ns = answer.now.ToNanoseconds() - time.monotonic_ns()

    @property
    def _lease_key(self) -> str:
        return self._key(f"lease/request/{self.operator}")

    def _key(self, name: str) -> str:
        return robot_key(self.site, self.robot, name)


def _direction(axis: str | int, frame: str, speed: float) -> schema.Jog:
    """Return a jog's message.

    Raises:
        MessageError: If there is no such axis or frame.
    """
    if isinstance(axis, int):
        return schema.Jog(frame=schema.Jog.JOINT, joint=max(axis, 0), speed=speed)
    if axis not in _AXES:
        raise MessageError(f"no axis {axis!r}: use {', '.join(_AXES)}, or a joint's number")
    if frame not in _FRAMES:
        raise MessageError(f"no frame {frame!r}: use {', '.join(_FRAMES)}")
    return schema.Jog(frame=_FRAMES[frame], axis=_AXES[axis], speed=speed)
