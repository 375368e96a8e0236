"""The player service: opens recordings of its site's folder as replays, and ends them."""

import asyncio
import contextlib
import logging
import secrets
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from mcap_files.errors import RecordingsError
from mcap_files.folder import find_file
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.keys import WHOLE_SITE
from robomesh.presence import OPERATOR
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.server import Request
from robomesh.session import Session
from services.player.clock import Clock
from services.player.errors import ReplayError
from services.player.recording_source import Tape
from services.player.replay import Replay

log = logging.getLogger(__name__)

MOST_REPLAYS = 8
# Presence may come a moment after the request, and go for a moment when a router is restarted.
_SESSION_COMES_S = 2.0
_SESSION_GOES_S = 5.0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Whose recordings are played.

    Attributes:
        folder: The recorder's.
    """

    site: str
    folder: Path


async def serve(session: Session, settings: Settings) -> None:
    """Play what is asked for, until cancelled."""
    async with asyncio.TaskGroup() as group:
        player = _Player(session, settings, group)
        session.answer(settings.site, WHOLE_SITE, "player/open", player.on_open)
        await player.follow_sessions()


def open_replay(
    session: Session, site: str, path: Path, asked: schema.PlayRequest, *, identity: str
) -> Replay:
    """A replay as it was asked for; may block on the disk.

    Raises:
        RecordingsError: If the file cannot be read.
        ReplayError: If it cannot be played like that.
    """
    tape = Tape(path)
    try:
        now = time.monotonic()
        clock = Clock(max(tape.end_ns - tape.start_ns, 0) * 1e-9, now)
        clock.set_speed(asked.speed or 1.0, now)
        clock.seek(asked.position_s, now)
        clock.loop, clock.playing = asked.loop, not asked.paused
    except ReplayError:
        tape.close()
        raise
    return Replay(session, site, identity, tape, clock)


class _Player:
    """The replays of a site."""

    def __init__(self, session: Session, settings: Settings, group: asyncio.TaskGroup) -> None:
        self._session, self._settings, self._group = session, settings, group
        self._replays: dict[str, Replay] = {}
        self._opening = 0
        self._of_session: dict[str, set[str]] = {}
        # How often each asker's session is present.
        self._present = Counter[str]()

    async def on_open(self, request: Request) -> schema.ReplayState:
        """Open a recording.

        Raises:
            RefusedError: Why it cannot be played.
        """
        asked = request.message
        assert isinstance(asked, schema.PlayRequest)
        if asked.session:
            await self._until_present(asked.session)
        if len(self._replays) + self._opening >= MOST_REPLAYS:
            raise RefusedError(codes.REPLAY_TOO_MANY(count=MOST_REPLAYS))
        self._opening += 1
        identity = secrets.token_hex(2)
        while identity in self._replays:
            identity = secrets.token_hex(2)
        try:
            path = find_file(self._settings.folder, asked.file)
            replay = await asyncio.to_thread(
                open_replay, self._session, self._settings.site, path, asked, identity=identity
            )
        except ReplayError as error:
            raise RefusedError(error.reason) from None
        except RecordingsError as error:
            raise RefusedError(codes.RECORDING_UNREADABLE(detail=error)) from None
        finally:
            self._opening -= 1
        self._replays[identity] = replay
        if asked.session:
            self._of_session.setdefault(asked.session, set()).add(identity)
            # It may have gone while the file was opened.
            asyncio.get_running_loop().call_later(_SESSION_GOES_S, self._end_if_gone, asked.session)
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
            for own in self._of_session.values():
                own.discard(identity)

    async def _until_present(self, session: str) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_SESSION_COMES_S):
                while not self._present[session]:
                    await asyncio.sleep(0.02)
        if not self._present[session]:
            raise RefusedError(codes.REPLAY_SESSION(session=session))

    async def follow_sessions(self) -> None:
        """End the replays of those who go."""
        async for who, alive in self._session.watch_presence(f"robomesh/*/*/alive/{OPERATOR}/*"):
            self._present[who.id] += 1 if alive else -1
            if self._present[who.id] <= 0:
                del self._present[who.id]
                asyncio.get_running_loop().call_later(_SESSION_GOES_S, self._end_if_gone, who.id)

    def _end_if_gone(self, session: str) -> None:
        if not self._present[session]:
            for identity in self._of_session.pop(session, set()):
                self._replays[identity].close()
