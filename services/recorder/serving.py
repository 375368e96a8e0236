"""Requests `recordings/*`, answered beside the recording, which never waits for them."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

from google.protobuf.message import Message

from mcap_files.errors import RecordingError
from robomesh import reason_codes as codes
from robomesh.errors import BusyError, RefusedError
from robomesh.keys import WHOLE_SITE
from robomesh.quotas import DEFAULT_QUOTAS, Quota, Quotas
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.server import Request
from robomesh.session import Session
from robomesh.worker import Worker, WorkerError
from services.recorder.answers import Question
from services.recorder.settings import MIB

_MODULE = "services.recorder.reader"
_NICE = 5
# Who asked has given up by then; a long recording's values are looked through once.
_WITHIN_S = 20.0
_SERIES_WITHIN_S = 120.0
# A list that takes longer is answered with "busy", after this share of its asker's time at the latest.
_PATIENCE_S = 4.0
_SHARE = 0.8
# An asker who was told "busy" asks again within this.
_KEPT_S = 1.0


class Serving:
    """Answers what is asked of a site's recordings, from worker processes.

    Values of a long recording take long, and are asked of a process of their own.

    Args:
        open_now: The captures that are being written, by their files' names.
        flight: Whether the flight recorder keeps what comes.
        quotas: Of each asker.
    """

    def __init__(
        self,
        session: Session,
        site: str,
        folder: Path,
        *,
        open_now: Callable[[], dict[str, schema.Recording]],
        flight: Callable[[], bool],
        quotas: Quotas = DEFAULT_QUOTAS,
    ) -> None:
        self._open_now, self._flight = open_now, flight
        self._quick, self._long = (Worker(_MODULE, folder, nice=_NICE) for _ in range(2))
        self._under_way: dict[tuple[str, bytes], asyncio.Task[bytes]] = {}
        self._mebibytes = Quota("recordings_mib", a_minute=quotas.recordings_mib_a_minute)
        session.answer(site, WHOLE_SITE, "recordings/list", self._list)
        session.answer(site, WHOLE_SITE, "recordings/info", self._info)
        for name in ("range", "series", "piece"):
            session.answer(site, WHOLE_SITE, f"recordings/{name}/*", self._handler(name))

    @property
    def pid(self) -> int | None:
        """The process that answers quick questions; None: it has not been asked yet."""
        return self._quick.pid

    async def close(self) -> None:
        """End the processes."""
        for task in self._under_way.values():
            task.cancel()
        await asyncio.gather(*self._under_way.values(), return_exceptions=True)
        await self._quick.close()
        await self._long.close()

    def _handler(self, name: str) -> Callable[[Request], Awaitable[Message]]:
        schemas: dict[str, type[Message]] = {
            "range": schema.RecordedMessages,
            "series": schema.SeriesAnswer,
            "piece": schema.Piece,
        }

        async def answer(request: Request) -> Message:
            assert request.message is not None
            self._mebibytes.check(request.asker)
            answer = await self._ask(name, request.message)
            self._mebibytes.count(request.asker, len(answer) / MIB)
            return schemas[name].FromString(answer)

        return answer

    async def _list(self, request: Request) -> schema.RecordingList:
        answer = await self._in_time("list", schema.RecordingQuery(), request.within_s)
        listed = schema.RecordingList.FromString(answer)
        open_now = self._open_now()
        known = {recording.file for recording in listed.recordings}
        rows = [open_now.get(recording.file, recording) for recording in listed.recordings]
        rows += [recording for file, recording in open_now.items() if file not in known]
        rows.sort(key=lambda recording: recording.file, reverse=True)
        return schema.RecordingList(recordings=rows, free_bytes=listed.free_bytes, flight=self._flight())

    async def _info(self, request: Request) -> schema.Recording:
        asked = request.message
        assert isinstance(asked, schema.RecordingQuery)
        if (open_now := self._open_now().get(asked.file)) is not None:
            return open_now
        return schema.Recording.FromString(await self._in_time("info", asked, request.within_s))

    async def _in_time(self, name: str, asked: Message, within_s: float | None) -> bytes:
        """Return the worker's answer while its asker still waits.

        What takes longer goes on, and is kept for a moment for the asker, who asks again.

        Raises:
            BusyError: If it takes longer.
            RefusedError: Why there is none.
        """
        key = name, asked.SerializeToString()
        if (task := self._under_way.get(key)) is None:
            task = self._under_way[key] = asyncio.create_task(self._ask(name, asked))
            task.add_done_callback(lambda task: self._keep(key, task))
        patience_s = _PATIENCE_S if within_s is None else min(_PATIENCE_S, _SHARE * within_s)
        try:
            async with asyncio.timeout(patience_s):
                return await asyncio.shield(task)
        except TimeoutError:
            raise BusyError(codes.RECORDER_BUSY(request=name)) from None
        finally:
            if task.done():  # the next asker gets what is there then
                self._forget(key, task)

    def _keep(self, key: tuple[str, bytes], task: asyncio.Task[bytes]) -> None:
        if not task.cancelled():
            task.exception()  # its asker may have gone
        asyncio.get_running_loop().call_later(_KEPT_S, self._forget, key, task)

    def _forget(self, key: tuple[str, bytes], task: asyncio.Task[bytes]) -> None:
        if self._under_way.get(key) is task:
            del self._under_way[key]

    async def _ask(self, name: str, request: Message) -> bytes:
        """The worker's answer.

        Raises:
            RefusedError: Why there is none.
        """
        worker, within_s = (self._long, _SERIES_WITHIN_S) if name == "series" else (self._quick, _WITHIN_S)
        try:
            answer = await worker.ask(Question(name, request.SerializeToString()), timeout_s=within_s)
        except (RecordingError, WorkerError, OSError) as error:
            raise RefusedError(codes.RECORDING_UNREADABLE(detail=error)) from None
        assert isinstance(answer, bytes)
        return answer
