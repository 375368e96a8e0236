"""The end of an operator's motion or program, as the robot's gateway reports it."""

import asyncio
import time
from collections.abc import Callable

from robomesh import reason_codes as codes
from robomesh.contract.keys import robot_key
from robomesh.contract.messages import received_reason
from robomesh.errors import MotionError, NoAnswerError
from robomesh.publications.subscription import Sample, Subscription
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session

# The gateway publishes `lease` and `program` each second.
_SILENCE_S = 5.0
# The publication of a motion's beginning arrives before or shortly after the answer to its command.
_BEGINS_S = 1.5


class MotionReports:
    """The gateway's reports of the motions and programs of one operator."""

    def __init__(self, session: Session, site: str, robot: str, operator: str) -> None:
        self._session, self._operator, self._robot = session, operator, f"{site}/{robot}"
        self._controller_key = robot_key(site, robot, "controller")
        self._leases = session.subscribe(robot_key(site, robot, "lease"), newest=50)
        self._programs = session.subscribe(robot_key(site, robot, "program"), newest=200)

    def close(self) -> None:
        """Unsubscribe."""
        self._leases.close()
        self._programs.close()

    def forget(self) -> None:
        """Discard the reports from before a command."""
        for subscription in (self._leases, self._programs):
            while subscription.take(awaited=True) is not None:
                pass

    async def motion_ended(self, accepted_s: float) -> None:
        """Wait until the gateway reports that the operator's motion has ended.

        Args:
            accepted_s: Monotonic time of the answer to its command [s].

        Raises:
            MotionError: If the robot did not arrive: another operator has control, or it was stopped.
            NoAnswerError: If the gateway fell silent.
        """
        has_moved = False
        while True:
            sample = await self._next(self._leases, f"only its dead-man stop can stop {self._robot} now")
            lease = sample.message()
            assert isinstance(lease, schema.Lease)
            if not sample.live:
                continue
            if lease.holder != self._operator:
                reason = received_reason(lease.ended_reason) if lease.HasField("ended_reason") else None
                text = f"control ended before the motion did: {lease.ended or 'for an unknown reason'}"
                raise MotionError(codes.PROGRAM_CONTROL_ENDED(reason or codes.ENDED_UNKNOWN()), text=text)
            has_moved = has_moved or lease.motion
            if not lease.motion and (has_moved or time.monotonic() - accepted_s > _BEGINS_S):
                await self._raise_if_stopped()
                return

    async def program_ended(self, accepted_s: float, on_step: Callable[[schema.ProgramState], None]) -> None:
        """Wait until the gateway reports that the program is done and the robot at rest.

        Args:
            accepted_s: Monotonic time of the answer to its command [s].
            on_step: Called with each new line.

        Raises:
            MotionError: If the program ended before.
            NoAnswerError: If the gateway fell silent.
        """
        line, has_run = 0, False
        while True:
            sample = await self._next(self._programs, f"the state of {self._robot} is unknown")
            program = sample.message()
            assert isinstance(program, schema.ProgramState)
            if not sample.live:
                continue
            if program.outcome == schema.ProgramState.RUNNING:
                has_run = True
                if program.line != line:
                    line = program.line
                    on_step(program)
            elif not has_run and time.monotonic() - accepted_s < _BEGINS_S:
                continue  # of an earlier program
            elif program.outcome == schema.ProgramState.DONE:
                # The robot may still move to the last target: releasing control now would stop it.
                return await self.motion_ended(accepted_s)
            else:
                raise _ended_early(program, line)

    async def _next(self, subscription: Subscription, consequence: str) -> Sample:
        try:
            async with asyncio.timeout(_SILENCE_S):
                return await anext(subscription)
        except (TimeoutError, StopAsyncIteration):
            raise NoAnswerError(
                codes.GATEWAY_SILENT(robot=self._robot, seconds=_SILENCE_S),
                text=f"the gateway fell silent: {consequence}",
            ) from None

    async def _raise_if_stopped(self) -> None:
        state = await self._session.last(self._controller_key)
        if not isinstance(state, schema.ControllerState):
            return
        reason: Reason | None = None
        if state.HasField("stop"):
            why = state.stop.reason or "stop request"
            reason = codes.PROGRAM_STOPPED(by=state.stop.by, reason=why)
        elif state.fault:
            reason = codes.CONTROLLER_FAULT(fault=state.fault)
        if reason is not None:
            raise MotionError(reason)


def _ended_early(program: schema.ProgramState, line: int) -> MotionError:
    """Return the error of a program that ended early, last seen at a line."""
    if program.outcome == schema.ProgramState.ENDED:
        text = f"ended at line {program.line}: {program.text}"
        return MotionError(received_reason(program.reason), text=text)
    seen = f", which was last seen at line {line}" if line else ""
    text = f"the gateway restarted, so the program no longer runs{seen}"
    return MotionError(codes.ENDED_GATEWAY(), text=text)
