"""Player service: opens recordings of its site's folder as replays, and ends them."""

import asyncio
import contextlib
import logging
import secrets
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE
from robomesh.errors import RefusedError
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.names import find_file
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.presence import OPERATOR
from robomesh.wire.session import Session
from services.player.clock import Clock
from services.player.errors import ReplayError
from services.player.recording_source import RecordingSource
from services.player.replay import Replay

log = logging.getLogger(__name__)

MAX_REPLAYS = 8
# A client's presence may arrive after its request, and may vanish briefly when a router restarts.
_SESSION_START_S = 2.0
_SESSION_END_S = 5.0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the player service.

    Attributes:
        folder: Folder of the site's recordings.
    """

    site: str
    folder: Path


async def serve(session: Session, settings: Settings) -> None:
    """Play recordings on request, until cancelled."""
    async with asyncio.TaskGroup() as group:
        player = _Player(session, settings, group)
        session.answer(settings.site, WHOLE_SITE, "player/open", player.on_open)
        await player.follow_sessions()


def open_replay(
    session: Session, site: str, path: Path, request: schema.PlayRequest, *, identity: str
) -> Replay:
    """Open a replay with the requested position and speed; may block on the disk.

    Raises:
        RecordingsError: If the file cannot be read.
        ReplayError: If it has no robot, or the position or speed is out of range.
    """
    source = RecordingSource(path)
    try:
        now = time.monotonic()
        clock = Clock(max(source.end_ns - source.start_ns, 0) * 1e-9, now)
        clock.set_speed(request.speed or 1.0, now)
        clock.seek(request.position_s, now)
        clock.loop, clock.playing = request.loop, not request.paused
    except ReplayError:
        source.close()
        raise
    return Replay(session, site, identity, source, clock)


class _Player:
    """The replays of a site."""

    def __init__(self, session: Session, settings: Settings, group: asyncio.TaskGroup) -> None:
        self._session, self._settings, self._group = session, settings, group
        self._replays: dict[str, Replay] = {}
        self._opening = 0
        self._by_session: dict[str, set[str]] = {}
        # Number of presence tokens of each client session.
        self._present = Counter[str]()

    async def on_open(self, request: Request) -> schema.ReplayState:
        """Open a recording.

        Raises:
            RefusedError: If it cannot be played.
        """
        message = request.message
        assert isinstance(message, schema.PlayRequest)
        if message.session:
            await self._wait_for_session(message.session)
        if len(self._replays) + self._opening >= MAX_REPLAYS:
            raise RefusedError(codes.REPLAY_TOO_MANY(count=MAX_REPLAYS))
        self._opening += 1
        identity = secrets.token_hex(2)
        while identity in self._replays:
            identity = secrets.token_hex(2)
        try:
            path = find_file(self._settings.folder, message.file)
            replay = await asyncio.to_thread(
                open_replay, self._session, self._settings.site, path, message, identity=identity
            )
        except ReplayError as error:
            raise RefusedError(error.reason) from None
        except RecordingError as error:
            raise RefusedError(error.reason) from None
        finally:
            self._opening -= 1
        self._replays[identity] = replay
        if message.session:
            self._by_session.setdefault(message.session, set()).add(identity)
            # The session may have ended while the file was opened.
            asyncio.get_running_loop().call_later(_SESSION_END_S, self._end_if_gone, message.session)
        self._group.create_task(self._run(identity, replay))
        log.info("%s/%s: playing %s", self._settings.site, replay.robot, path.name)
        return replay.describe()

    async def _run(self, identity: str, replay: Replay) -> None:
        try:
            await replay.run()
        except Exception:
            log.exception("%s ended", replay.robot)
        finally:
            del self._replays[identity]
            for identities in self._by_session.values():
                identities.discard(identity)

    async def _wait_for_session(self, session: str) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_SESSION_START_S):
                while not self._present[session]:
                    await asyncio.sleep(0.02)
        if not self._present[session]:
            raise RefusedError(codes.REPLAY_SESSION(session=session))

    async def follow_sessions(self) -> None:
        """End the replays of sessions that have ended."""
        async for presence, alive in self._session.watch_presence(f"robomesh/*/*/alive/{OPERATOR}/*"):
            self._present[presence.id] += 1 if alive else -1
            if self._present[presence.id] <= 0:
                del self._present[presence.id]
                asyncio.get_running_loop().call_later(_SESSION_END_S, self._end_if_gone, presence.id)

    def _end_if_gone(self, session: str) -> None:
        if not self._present[session]:
            for identity in self._by_session.pop(session, set()):
                self._replays[identity].close()
