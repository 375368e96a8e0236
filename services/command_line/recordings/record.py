"""`robomesh record`: a capture until Ctrl-C."""

import asyncio
import contextlib
import signal
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from datetime import datetime
from typing import NamedTuple

import typer

from robomesh.errors import NoAnswerError, RefusedError
from robomesh.keys import robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from robomesh.subscription import Subscription
from services.command_line import discovery
from services.command_line.recordings.listing import show, summary

_Request = schema.RecorderRequest
# The recorder tells each second; after so much silence we look whether it is still there.
_SILENCE_S = 5.0
# A disk that takes nothing says so at once.
_AT_ONCE_S = 0.3


class _Done(NamedTuple):
    """What was recorded, and why it ended without us, in words; empty: we ended it."""

    recording: schema.Recording
    problem: str


def record(robot: str, name: str, views: Sequence[str], router: str, as_json: bool) -> None:
    """Record until Ctrl-C, then print what it holds; exit status 1 when it ended before.

    Args:
        views: Whose video is recorded too; "-": none; empty: as the site file says.
    """
    done = discovery.run(_record(robot, name, views, router))
    if as_json:
        show(done.recording, as_json)
    else:
        print(summary(done.recording), flush=True)
    if done.problem:
        print(f"robomesh: {done.problem}", file=sys.stderr)
        raise typer.Exit(1)


async def _record(text: str, name: str, views: Sequence[str], router: str) -> _Done:
    async with discovery.attached(router) as session, _interrupted() as interrupted:
        robot = await discovery.find(session, text)
        key = robot_key(*robot, "recorder/request")
        asked = _Request(action=_Request.TRACE_ON, name=name, views=views)
        begun = await session.ask(key, asked, timeout_s=5.0)
        assert isinstance(begun, schema.Recording)
        states = session.subscribe(robot_key(*robot, "recording"))
        ending = asyncio.create_task(_ended(session, robot, states, begun))
        pressed = asyncio.create_task(interrupted.wait())
        await asyncio.wait((ending, pressed), timeout=_AT_ONCE_S, return_when=asyncio.FIRST_COMPLETED)
        if not ending.done():
            print(f"recording {robot} as {begun.name}; Ctrl-C ends it", file=sys.stderr, flush=True)
            await asyncio.wait((ending, pressed), return_when=asyncio.FIRST_COMPLETED)
        pressed.cancel()
        if not ending.done():
            with contextlib.suppress(RefusedError):  # it has ended just now, and says why
                done = await session.ask(key, _Request(action=_Request.TRACE_OFF), timeout_s=10.0)
                assert isinstance(done, schema.Recording)
                ending.cancel()
                return _Done(done, f"recording {done.name} {done.problem}" if done.problem else "")
        return await ending


async def _ended(
    session: Session, robot: discovery.Robot, states: Subscription, begun: schema.Recording
) -> _Done:
    """Wait until it ends without us."""
    newest = begun
    while True:
        try:
            async with asyncio.timeout(_SILENCE_S):
                state = (await anext(states)).message()
        except TimeoutError:
            try:
                alive = await session.present()
            except NoAnswerError:
                continue  # nothing says that the recorder is gone
            if not any((who.site, who.service) == (robot.site, "recorder") for who in alive):
                return _Done(newest, _gone(newest))
            continue
        assert isinstance(state, schema.Recording)
        if state.name != begun.name:
            # Another one is recorded now; or none is, by a recorder that began anew.
            return _Done(
                newest, f"recording {begun.name} was ended by another" if state.name else _gone(newest)
            )
        newest = state
        if not state.open:
            problem = (
                f"{state.problem}; what was written is kept" if state.problem else "was ended by another"
            )
            return _Done(newest, f"recording {begun.name} {problem}")


def _gone(newest: schema.Recording) -> str:
    until_s = (newest.start.ToNanoseconds() + newest.duration.ToNanoseconds()) * 1e-9
    until = datetime.fromtimestamp(until_s).astimezone()
    return (
        f"the recorder of {newest.site}/{newest.robot} ended while it recorded {newest.name}, which is kept "
        f"until about {until:%H:%M:%S}; begin again for what follows"
    )


@asynccontextmanager
async def _interrupted() -> AsyncIterator[asyncio.Event]:
    """Set by Ctrl-C; a second one ends the program."""
    pressed = asyncio.Event()
    loop = asyncio.get_running_loop()

    def let_go() -> None:
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)

    def press() -> None:
        pressed.set()
        let_go()

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, press)
    try:
        yield pressed
    finally:
        let_go()
