"""`robomesh record`: a recording until Ctrl-C."""

import asyncio
import contextlib
import signal
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Annotated, NamedTuple

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import robot_key
from robomesh.errors import NoAnswerError, RefusedError
from robomesh.publications.subscription import Subscription
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.command_line.record.listing import show, summary
from services.command_line.terminal import discovery
from services.command_line.terminal.local_time import time_text
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import print_line

app = command_group()

_Request = schema.RecorderRequest
# The recorder publishes each second; after this silence its presence is checked.
_SILENCE_S = 5.0
# A router restarts in less time.
_SITE_GONE_S = 30.0
# A full disk ends a recording within this time.
_EARLY_END_S = 0.3


class _Done(NamedTuple):
    """A finished recording, and why it ended early; empty: Ctrl-C ended it."""

    recording: schema.Recording
    problem: str


@app.command()
def record(
    robot: Robot,
    name: Annotated[str, typer.Option(help="Name of the recording.")] = "",
    view: Annotated[
        list[str] | None,
        typer.Option(metavar="VIEW", help="Record this view's video too; repeatable; -: no video."),
    ] = None,
    stop: Annotated[bool, typer.Option("--stop", help="End its recording, whoever started it.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Record a robot until Ctrl-C."""
    if stop:
        if name or view:
            raise typer.BadParameter("--stop ends a recording: give it without --name and --view")
        _print(discovery.run(_stop(robot, connect)), as_json)
        return
    done = discovery.run(_record(robot, name, view or (), connect))
    _print(done.recording, as_json)
    if done.problem:
        print_line(f"robomesh: {done.problem}", err=True)
        raise typer.Exit(1)


def _print(recording: schema.Recording, as_json: bool) -> None:
    if as_json:
        show(recording, as_json)
    else:
        print_line(summary(recording))


async def _stop(text: str, router: str) -> schema.Recording:
    async with discovery.attached(router) as session:
        return await _trace_off(session, await discovery.find(session, text))


async def _trace_off(session: Session, robot: discovery.RobotAddress) -> schema.Recording:
    key = robot_key(*robot, "recorder/request")
    ended = await session.ask(key, _Request(action=_Request.TRACE_OFF), timeout_s=10.0)
    assert isinstance(ended, schema.Recording)
    return ended


async def _record(text: str, name: str, views: Sequence[str], router: str) -> _Done:
    async with discovery.attached(router) as session, _interrupted() as interrupted:
        robot = await discovery.find(session, text)
        key = robot_key(*robot, "recorder/request")
        asked = _Request(action=_Request.TRACE_ON, name=name, views=views)
        started = await session.ask(key, asked, timeout_s=5.0)
        assert isinstance(started, schema.Recording)
        states = session.subscribe(robot_key(*robot, "recording"))
        ending = asyncio.create_task(_ended(session, robot, states, started))
        pressed = asyncio.create_task(interrupted.wait())
        await asyncio.wait((ending, pressed), timeout=_EARLY_END_S, return_when=asyncio.FIRST_COMPLETED)
        if not ending.done():
            print_line(f"recording {robot} as {started.name}; Ctrl-C ends it", err=True)
            await asyncio.wait((ending, pressed), return_when=asyncio.FIRST_COMPLETED)
        pressed.cancel()
        if not ending.done():
            with contextlib.suppress(RefusedError):  # it has just ended; its state has the reason
                done = await _trace_off(session, robot)
                ending.cancel()
                return _Done(done, f"recording {done.name} {done.problem}" if done.problem else "")
        return await ending


async def _ended(
    session: Session, robot: discovery.RobotAddress, states: Subscription, started: schema.Recording
) -> _Done:
    """Wait until the recording ends early."""
    newest, heard_s = started, time.monotonic()
    while True:
        try:
            async with asyncio.timeout(_SILENCE_S):
                state = (await anext(states)).message()
        except TimeoutError:
            try:
                alive = await session.present()
            except NoAnswerError:
                if time.monotonic() - heard_s > _SITE_GONE_S:
                    return _Done(newest, _unknown(newest))
                continue  # the recorder may still be present
            if not any((who.site, who.service) == (robot.site, "recorder") for who in alive):
                return _Done(newest, _gone(newest))
            continue
        assert isinstance(state, schema.Recording)
        heard_s = time.monotonic()
        if state.name != started.name:
            # Another recording runs now; or none, because the recorder restarted.
            return _Done(
                newest, f"recording {started.name} was ended by another" if state.name else _gone(newest)
            )
        newest = state
        if not state.open:
            problem = (
                f"{state.problem}; what was written is kept" if state.problem else "was ended by another"
            )
            return _Done(newest, f"recording {started.name} {problem}")


def _gone(newest: schema.Recording) -> str:
    return (
        f"the recorder of {newest.site}/{newest.robot} ended while it recorded {newest.name}, which is kept "
        f"until about {_until(newest)}; begin again for what follows"
    )


def _unknown(newest: schema.Recording) -> str:
    return (
        f"no router answers any more: {newest.name} of {newest.site}/{newest.robot} was seen until "
        f"{_until(newest)}. It may go on there: robomesh recordings list shows it, record --stop ends it"
    )


def _until(newest: schema.Recording) -> str:
    return time_text((newest.start.ToNanoseconds() + newest.duration.ToNanoseconds()) * 1e-9)


@asynccontextmanager
async def _interrupted() -> AsyncIterator[asyncio.Event]:
    """Yield an event that Ctrl-C sets.

    A second Ctrl-C has no effect: it would leave the recording open. `timeout --signal INT` sends two.
    """
    pressed = asyncio.Event()
    loop = asyncio.get_running_loop()

    numbers = (signal.SIGINT, signal.SIGTERM)
    for number in numbers:
        loop.add_signal_handler(number, pressed.set)
    try:
        yield pressed
    finally:
        for number in numbers:
            loop.remove_signal_handler(number)
