"""A command on its way: its answer, then its motion or program to the end, unless Ctrl-C comes before."""

import asyncio
import contextlib
import signal
import sys
from collections.abc import Iterator

from robomesh.keys import robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from services.command_line import discovery

# `lease` and `program` beat each second: without them the gateway is gone.
_SILENCE_S = 5.0
_WORDS_S = 1.5
_MIND = "; mind: "


class Interrupted(Exception):
    """Ctrl-C, while something was waited for."""


@contextlib.contextmanager
def interrupt() -> Iterator[asyncio.Event]:
    """Set by Ctrl-C, from before the command leaves: the arm may move before its answer is here."""
    interrupted = asyncio.Event()
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGINT, interrupted.set)
    try:
        yield interrupted
    finally:
        loop.remove_signal_handler(signal.SIGINT)


async def stop(session: Session, robot: discovery.Robot, operator: str, reason: str) -> tuple[bool, str]:
    """Ask for a stop: whether it was sent, and the gateway's words."""
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
    """A command's answer.

    Raises:
        Interrupted: If Ctrl-C came first: what was asked for may yet begin.
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
    """Return what an accepted command's answer warns of; empty: nothing."""
    # An earlier gateway has the warning in its sentence alone.
    return answer.warning.text or (answer.text.partition(_MIND)[2] if answer.accepted else "")


async def until_done(
    session: Session,
    robot: discovery.Robot,
    operator: str,
    renewing: asyncio.Task[str],
    interrupted: asyncio.Event,
    *,
    runs: bool = False,
) -> tuple[bool, str]:
    """Wait until the gateway says that the holder's motion, or program, has ended.

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
            # The gateway's own words come right behind; a namesake may have control, and then none come.
            await asyncio.wait((ended,), timeout=_WORDS_S)
            if not ended.done():
                return False, f"control ended before the motion did: {await renewing}"
        return await ended or (True, "done")
    finally:
        ended.cancel()
        pressed.cancel()


async def _motion_ended(session: Session, robot: discovery.Robot, operator: str) -> tuple[bool, str] | None:
    """None: ended well; otherwise what ended it."""
    leases = session.subscribe(robot_key(*robot, "lease"), newest=20)
    while True:
        try:
            async with asyncio.timeout(_SILENCE_S):
                sample = await anext(leases)
        except TimeoutError:
            return (
                False,
                f"the gateway fell silent: nobody knows what {robot} does; the dead-man stop is its own",
            )
        lease = sample.message()
        assert isinstance(lease, schema.Lease)
        if not sample.live:
            continue
        if lease.holder != operator:
            return False, f"control ended before the motion did: {lease.ended or 'nobody says why'}"
        if not lease.motion:
            return await _how_it_ended(session, robot)


async def _program_ended(session: Session, robot: discovery.Robot, operator: str) -> tuple[bool, str] | None:
    """None: it is done; otherwise what ended it, and where."""
    states = session.subscribe(robot_key(*robot, "program"), newest=20)
    line = 0
    while True:
        try:
            async with asyncio.timeout(_SILENCE_S):
                sample = await anext(states)
        except TimeoutError:
            return False, f"the gateway fell silent: nobody knows what {robot} does. {_make_sure(robot)}"
        program = sample.message()
        assert isinstance(program, schema.ProgramState)
        if not sample.live:
            continue
        match program.outcome:
            case schema.ProgramState.OUTCOME_UNSPECIFIED:
                return False, _began_anew(robot, line)
            case schema.ProgramState.ENDED:
                return False, f"ended at line {program.line}: {program.text}"
            case schema.ProgramState.DONE:
                # At its last target, but it may move yet: to give control back now would stop it.
                return await _motion_ended(session, robot, operator)
        if program.line != line:
            line = program.line
            step = f"step {program.step} of {program.steps}"
            print(f"{step}, line {line}: {program.statement}", file=sys.stderr, flush=True)


def _began_anew(robot: discovery.Robot, line: int) -> str:
    seen = f", which was last seen at line {line}" if line else ""
    return f"the gateway began anew: nobody runs the program any more{seen}. {_make_sure(robot)}"


def _make_sure(robot: discovery.Robot) -> str:
    return (
        f"`robomesh send {robot} stop` makes sure that the robot stands, "
        f"`robomesh send {robot} reset` lets it move again"
    )


async def _how_it_ended(session: Session, robot: discovery.Robot) -> tuple[bool, str] | None:
    state = await session.last(robot_key(*robot, "controller"))
    if isinstance(state, schema.ControllerState):
        if state.HasField("stop"):
            return False, f"stopped: {state.stop.reason or 'stop request'} by {state.stop.by}"
        if state.fault:
            return False, f"the controller has a fault: {state.fault}"
    return None
