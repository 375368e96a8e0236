"""The progress of a command: its answer, then the end of its motion or program, unless Ctrl-C is first."""

import asyncio
import contextlib
import signal
import sys
from collections.abc import Iterator

from robomesh.keys import robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from services.command_line import discovery
from services.command_line.output import print_or_discard

# The gateway publishes `lease` and `program` each second.
_SILENCE_S = 5.0
_REASON_WITHIN_S = 1.5
_WARNING = "; mind: "


class Interrupted(Exception):
    """Ctrl-C was pressed."""


@contextlib.contextmanager
def interrupt() -> Iterator[asyncio.Event]:
    """Yield an event that Ctrl-C sets; enter before sending, because the arm may move before the answer."""
    interrupted = asyncio.Event()
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGINT, interrupted.set)
    try:
        yield interrupted
    finally:
        loop.remove_signal_handler(signal.SIGINT)


async def stop(session: Session, robot: discovery.Robot, operator: str, reason: str) -> tuple[bool, str]:
    """Request a stop; return whether the gateway sent it, and its text."""
    request = schema.StopRequest(by=operator, reason=reason)
    answer = await session.ask(robot_key(*robot, "stop"), request)
    assert isinstance(answer, schema.StopAnswer)
    return answer.sent, answer.text


async def answered(
    session: Session,
    key: str,
    request: schema.CommandRequest,
    interrupted: asyncio.Event,
    *,
    timeout_s: float,
) -> schema.CommandAnswer:
    """Return a command's answer.

    Raises:
        Interrupted: If Ctrl-C came first: the motion may still begin.
    """
    asked = asyncio.create_task(session.ask(key, request, timeout_s=timeout_s))
    pressed = asyncio.create_task(interrupted.wait())
    try:
        await asyncio.wait((asked, pressed), return_when=asyncio.FIRST_COMPLETED)
        if interrupted.is_set():
            raise Interrupted
        answer = await asked
    finally:
        asked.cancel()
        pressed.cancel()
        await asyncio.gather(asked, pressed, return_exceptions=True)
    assert isinstance(answer, schema.CommandAnswer)
    return answer


def warning_of(answer: schema.CommandAnswer) -> str:
    """Return the warning in an accepted command's answer; empty: none."""
    # An earlier gateway has the warning only in its sentence.
    return answer.warning.text or (answer.text.partition(_WARNING)[2] if answer.accepted else "")


async def until_done(
    session: Session,
    robot: discovery.Robot,
    operator: str,
    renewing: asyncio.Task[str],
    interrupted: asyncio.Event,
    *,
    runs: bool = False,
) -> tuple[bool, str]:
    """Wait until the gateway reports the end of the operator's motion or program.

    Raises:
        Interrupted: If Ctrl-C came first.
    """
    waiting = _program_ended(session, robot, operator) if runs else _motion_ended(session, robot, operator)
    ended = asyncio.create_task(waiting)
    pressed = asyncio.create_task(interrupted.wait())
    try:
        await asyncio.wait((ended, pressed, renewing), return_when=asyncio.FIRST_COMPLETED)
        if interrupted.is_set():
            raise Interrupted
        if renewing.done():
            # The gateway's reason follows shortly; not if another session of that name has control.
            await asyncio.wait((ended,), timeout=_REASON_WITHIN_S)
            if not ended.done():
                return False, f"control ended before the motion did: {await renewing}"
        return await ended or (True, "done")
    finally:
        ended.cancel()
        pressed.cancel()


async def _motion_ended(session: Session, robot: discovery.Robot, operator: str) -> tuple[bool, str] | None:
    """Wait for the end of the motion; return None if it ended well, else False and the reason."""
    leases = session.subscribe(robot_key(*robot, "lease"), newest=20)
    while True:
        try:
            async with asyncio.timeout(_SILENCE_S):
                sample = await anext(leases)
        except TimeoutError:
            return (
                False,
                f"the gateway fell silent: only its dead-man stop can stop {robot} now",
            )
        lease = sample.message()
        assert isinstance(lease, schema.Lease)
        if not sample.live:
            continue
        if lease.holder != operator:
            return False, f"control ended before the motion did: {lease.ended or 'for an unknown reason'}"
        if not lease.motion:
            return await _motion_result(session, robot)


async def _program_ended(session: Session, robot: discovery.Robot, operator: str) -> tuple[bool, str] | None:
    """Wait for the end of the program; return None if it is done, else False, the line and the reason."""
    states = session.subscribe(robot_key(*robot, "program"), newest=20)
    line = 0
    while True:
        try:
            async with asyncio.timeout(_SILENCE_S):
                sample = await anext(states)
        except TimeoutError:
            return False, f"the gateway fell silent: the state of {robot} is unknown. {_advice(robot)}"
        program = sample.message()
        assert isinstance(program, schema.ProgramState)
        if not sample.live:
            continue
        match program.outcome:
            case schema.ProgramState.OUTCOME_UNSPECIFIED:
                return False, _restarted(robot, line)
            case schema.ProgramState.ENDED:
                return False, f"ended at line {program.line}: {program.text}"
            case schema.ProgramState.DONE:
                # The robot may still move to the last target: releasing control now would stop it.
                return await _motion_ended(session, robot, operator)
        if program.line != line:
            line = program.line
            step = f"step {program.step} of {program.steps}"
            print_or_discard(f"{step}, line {line}: {program.statement}", sys.stderr)


def _restarted(robot: discovery.Robot, line: int) -> str:
    seen = f", which was last seen at line {line}" if line else ""
    return f"the gateway restarted, so the program no longer runs{seen}. {_advice(robot)}"


def _advice(robot: discovery.Robot) -> str:
    return (
        f"`robomesh send {robot} stop` makes sure that the robot stands still, "
        f"`robomesh send {robot} reset` lets it move again"
    )


async def _motion_result(session: Session, robot: discovery.Robot) -> tuple[bool, str] | None:
    state = await session.last(robot_key(*robot, "controller"))
    if isinstance(state, schema.ControllerState):
        if state.HasField("stop"):
            return False, f"stopped: {state.stop.reason or 'stop request'} by {state.stop.by}"
        if state.fault:
            return False, f"the controller has a fault: {state.fault}"
    return None
