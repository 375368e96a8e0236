"""`robomesh recordings play`: a replay on the mesh until Ctrl-C."""

import asyncio
import contextlib
import secrets
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Annotated

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import WHOLE_SITE, robot_key
from robomesh.errors import RobomeshError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.presence import OPERATOR, session_of
from robomesh.wire.session import Session
from services.command_line.record.listing import RecordingSource, attached_for, found
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect
from services.command_line.terminal.output import print_line, progress
from services.export.errors import ExportError

_OPEN_WITHIN_S = 20.0
# A player publishes its position five times a second, also when paused.
_SILENT_S = 5.0


def play(
    what: RecordingSource,
    speed: Annotated[float, typer.Option(help="0.1 to 100")] = 1.0,
    at: Annotated[float, typer.Option(metavar="SECONDS", help="Start position.")] = 0.0,
    loop: Annotated[bool, typer.Option("--loop", help="Repeat.")] = False,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Play a recording as a separate robot, replay-..., until Ctrl-C."""
    request = schema.PlayRequest(speed=speed, position_s=at, loop=loop)
    discovery.run(_play(what, Path(what) if Path(what).is_file() else None, request, connect))


async def _play(what: str, path: Path | None, request: schema.PlayRequest, router: str) -> None:
    async with attached_for(what, router) as session:
        opened = _of_file(session, path, request) if path is not None else _of_site(session, what, request)
        async with opened as (site, state):
            print_line(f"playing {state.file} as {site}/{state.robot}; Ctrl-C ends it")
            print_line(
                f"watch it: robomesh monitor {site}/{state.robot}, or the page, #/{site}/{state.robot}"
            )
            await _until_ended(session, robot_key(site, state.robot, "replay"))


@asynccontextmanager
async def _of_file(
    session: Session, path: Path, request: schema.PlayRequest
) -> AsyncIterator[tuple[str, schema.ReplayState]]:
    """Play a file in this process, because it may be in no recorder's folder."""
    from services.player.player import open_replay

    site = await _site_for(session, path)
    # Longer than the identities of a player, so that the two never collide.
    identity = secrets.token_hex(3)
    replay = await asyncio.to_thread(open_replay, session, site, path, request, identity=identity)
    running = asyncio.create_task(replay.run())
    try:
        yield site, replay.describe()
    finally:
        replay.close()
        await running


async def _site_for(session: Session, path: Path) -> str:
    """Return the recording's own site if present; else a present site, where the replay is visible."""
    from robomesh.recordings.files import describe_file

    own = (await asyncio.to_thread(describe_file, path)).site
    sites = {who.site for who in await session.present()}
    return own if own in sites or not sites else min(sites)


@asynccontextmanager
async def _of_site(
    session: Session, what: str, request: schema.PlayRequest
) -> AsyncIterator[tuple[str, schema.ReplayState]]:
    """Let the site's player play a recording while this process is present."""
    newest = await found(session, what, closed=True)
    site = newest.recorder_site
    request.file, request.session = newest.file, session_of(session.own_name)
    token = session.declare_presence_of(site, WHOLE_SITE, OPERATOR, request.session)
    try:
        key = robot_key(site, WHOLE_SITE, "player/open")
        state = await session.ask(key, request, timeout_s=_OPEN_WITHIN_S)
        assert isinstance(state, schema.ReplayState)
        try:
            yield site, state
        finally:
            with contextlib.suppress(RobomeshError):
                end = schema.ReplayRequest(action=schema.ReplayRequest.CLOSE)
                await session.ask(robot_key(site, state.robot, "replay/request"), end)
    finally:
        token.undeclare()


async def _until_ended(session: Session, key: str) -> None:
    """Wait until Ctrl-C.

    Raises:
        ExportError: If the replay ends before, with the reason.
    """
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    subscription = session.subscribe(key)
    with progress("playing") as report:

        async def follow() -> None:
            while True:
                try:
                    async with asyncio.timeout(_SILENT_S):
                        state = (await anext(subscription)).message()
                except StopAsyncIteration:
                    return
                except TimeoutError:
                    raise ExportError("the replay has ended: it was closed, or its player is gone") from None
                assert isinstance(state, schema.ReplayState)
                report(state.position_s / state.duration_s if state.duration_s else 1.0)
                if state.text:
                    raise ExportError(state.text)

        following = asyncio.create_task(follow())
        waiting = asyncio.create_task(ended.wait())
        await asyncio.wait([following, waiting], return_when=asyncio.FIRST_COMPLETED)
        waiting.cancel()
        subscription.close()
        await following
