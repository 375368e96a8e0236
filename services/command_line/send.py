"""`robomesh send`: one command to a robot, under a lease that lives as long as its motion."""

import asyncio
import contextlib
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from math import radians

import typer

from bus.errors import BusError, NoAnswerError, RefusedError
from bus.keys import check_chunk, robot_key
from bus.schemas import robomesh_pb2 as schema
from bus.session import Session
from services.command_line import find
from services.errors import ServiceError

_Command = schema.CommandRequest
_Lease = schema.LeaseRequest
_TTL_S = 2.0
_LATEST_NS = 3_000_000_000
# `lease` beats each second: without it the gateway is gone.
_SILENCE_S = 5.0
_MOTIONS = (_Command.HOME, _Command.MOVE_ABSOLUTE, _Command.MOVE_RELATIVE, _Command.RESUME)
_WORDS = {
    ("home",): _Command.HOME,
    ("hold",): _Command.HOLD,
    ("resume",): _Command.RESUME,
    ("reset",): _Command.RESET,
    ("trace", "on"): _Command.TRACE_ON,
    ("trace", "off"): _Command.TRACE_OFF,
}
_USAGE = "home, stop, hold, resume, reset, trace on, trace off, speed N, or move Q... (degrees, mm)"


class WordsError(ServiceError):
    """Words that are no command."""


def run(robot: str, words: list[str], router: str, operator: str, as_json: bool) -> None:
    """Send; exit status 1 when it is refused."""
    if words != ["stop"]:
        _parse(words, None)  # before anything is asked of anybody
    accepted, text = find.run(_send(robot, words, router, check_chunk(operator or find.own_name())))
    if as_json:
        find.print_json({"accepted": accepted, "text": text})
    else:
        print(text)
    if not accepted:
        raise typer.Exit(1)


async def _send(name: str, words: list[str], router: str, operator: str) -> tuple[bool, str]:
    async with find.attached(router) as session:
        robot = await find.find(session, name)
        if words == ["stop"]:
            return await _stop(session, robot, operator)
        description = await session.last(robot_key(*robot, "description"))
        request = _parse(words, description if isinstance(description, schema.Description) else None)
        try:
            async with _control(session, robot, operator) as lease:
                request.lease = lease.lease
                request.id = 1
                # By the gateway's clock: what is held up on the way must not move an arm later.
                request.not_after.FromNanoseconds(lease.now.ToNanoseconds() + _LATEST_NS)
                if request.command == _Command.RESET:
                    request.stop_id = await _latched_stop(session, robot)
                answer = await session.ask(robot_key(*robot, f"command/{operator}"), request)
                assert isinstance(answer, schema.CommandAnswer)
                if answer.accepted and request.command in _MOTIONS:
                    return await _until_done(session, robot, operator)
                return answer.accepted, answer.text
        except RefusedError as error:
            return False, str(error)


async def _stop(session: Session, robot: find.Robot, operator: str) -> tuple[bool, str]:
    answer = await session.ask(robot_key(*robot, "stop"), schema.StopRequest(by=operator))
    assert isinstance(answer, schema.StopAnswer)
    return answer.sent, answer.text


async def _latched_stop(session: Session, robot: find.Robot) -> int:
    """The stop that a RESET is to name; 0 where none is latched, and the controller itself is stopped."""
    state = await session.last(robot_key(*robot, "controller"))
    return state.stop.id if isinstance(state, schema.ControllerState) else 0


async def _until_done(session: Session, robot: find.Robot, operator: str) -> tuple[bool, str]:
    """Wait until the gateway says that the holder's motion has ended; Ctrl-C stops the robot."""
    interrupted = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, interrupted.set)
    ended = asyncio.create_task(_motion_ended(session, robot, operator))
    pressed = asyncio.create_task(interrupted.wait())
    try:
        await asyncio.wait((ended, pressed), return_when=asyncio.FIRST_COMPLETED)
        if interrupted.is_set():
            _, said = await _stop(session, robot, operator)
            return False, f"interrupted: {said}"
        return await ended or (True, "done")
    finally:
        asyncio.get_running_loop().remove_signal_handler(signal.SIGINT)
        ended.cancel()
        pressed.cancel()


async def _motion_ended(session: Session, robot: find.Robot, operator: str) -> tuple[bool, str] | None:
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
            return False, f"control went to {lease.holder or 'nobody'} before the motion ended"
        if not lease.motion:
            return await _how_it_ended(session, robot)


async def _how_it_ended(session: Session, robot: find.Robot) -> tuple[bool, str] | None:
    state = await session.last(robot_key(*robot, "controller"))
    if isinstance(state, schema.ControllerState):
        if state.HasField("stop"):
            return False, f"stopped: {state.stop.reason or 'stop request'} by {state.stop.by}"
        if state.fault:
            return False, f"the controller has a fault: {state.fault}"
    return None


@asynccontextmanager
async def _control(session: Session, robot: find.Robot, operator: str) -> AsyncIterator[schema.LeaseAnswer]:
    """The lease, renewed until the block ends, then given back."""
    key = robot_key(*robot, f"lease/request/{operator}")
    answer = await session.ask(key, _Lease(action=_Lease.ACQUIRE, ttl_s=_TTL_S))
    assert isinstance(answer, schema.LeaseAnswer)

    async def renew() -> None:
        while True:
            await asyncio.sleep(_TTL_S / 4)
            # One late answer is no reason to let go; the lease outlives three of them.
            with contextlib.suppress(NoAnswerError):
                await session.ask(
                    key, _Lease(action=_Lease.RENEW, lease=answer.lease, ttl_s=_TTL_S), timeout_s=0.5
                )

    renewing = asyncio.create_task(renew())
    try:
        yield answer
    finally:
        renewing.cancel()
        with contextlib.suppress(BusError, asyncio.CancelledError):
            await renewing
        with contextlib.suppress(BusError):
            await session.ask(key, _Lease(action=_Lease.RELEASE, lease=answer.lease), timeout_s=1.0)


def _parse(words: list[str], description: schema.Description | None) -> schema.CommandRequest:
    """The request that the words mean; joint positions in SI only once the robot is known.

    Raises:
        WordsError: If they mean none.
    """
    command = _WORDS.get(tuple(words))
    if command is not None:
        return _Command(command=command)
    match words:
        case ["speed", percent]:
            return _Command(command=_Command.SPEED, speed_percent=_number(percent))
        case ["move", *values] if values:
            positions = [_number(value) for value in values]
            if description is not None:
                if len(positions) != len(description.joints):
                    names = ", ".join(joint.name for joint in description.joints)
                    raise WordsError(
                        f"move takes {len(description.joints)} positions ({names}), not {len(positions)}"
                    )
                positions = [
                    radians(value) if joint.type == schema.Description.Joint.ROTARY else value / 1000.0
                    for value, joint in zip(positions, description.joints, strict=True)
                ]
            return _Command(command=_Command.MOVE_ABSOLUTE, joint_positions=positions)
    raise WordsError(f"{' '.join(words)!r} is no command: {_USAGE}")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise WordsError(f"{text!r} is no number: {_USAGE}") from None
