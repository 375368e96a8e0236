"""Request handlers of `recordings/*`; worker processes read the files, so that recording never waits."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

from google.protobuf.message import Message

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE
from robomesh.contract.quotas import DEFAULT_QUOTAS, Quota, Quotas
from robomesh.errors import BusyError, QuotaError, RefusedError
from robomesh.files.worker import Worker, WorkerError
from robomesh.recordings.errors import RecordingError
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.recorder.reading.answers import Question
from services.recorder.reading.uses import RecordingUses

_MODULE = "services.recorder.reading.reader"
_NICE = 5
# Timeouts of the workers. Values of a long recording need a whole pass through the file.
_WITHIN_S = 20.0
_SERIES_WITHIN_S = 120.0
# A slower `list` or `info` is answered with "busy", at the latest after this share of the client's timeout.
_MAX_WAIT_S = 4.0
_SHARE = 0.8
# A finished answer is kept this long for a client that received "busy" and asks again.
_CACHE_S = 1.0


class RecordingServer:
    """Request handlers for a site's recordings.

    `series` of long recordings is slow and has its own worker process.

    Args:
        open_now: Returns the open captures by file name.
        flight: Returns whether the flight recorder is running.
        uses: Notes the clients that read a recording.
        quotas: Quotas of each client.
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
        uses: RecordingUses | None = None,
    ) -> None:
        self._open_now, self._flight = open_now, flight
        self._uses = RecordingUses() if uses is None else uses
        self._fast_worker, self._series_worker = (Worker(_MODULE, folder, nice=_NICE) for _ in range(2))
        self._tasks: dict[tuple[str, bytes], asyncio.Task[bytes]] = {}
        self._mebibytes = Quota("recordings_mib", a_minute=quotas.recordings_mib_a_minute)
        session.answer(site, WHOLE_SITE, "recordings/list", self._list)
        session.answer(site, WHOLE_SITE, "recordings/info", self._info)
        for name in ("range", "series", "piece"):
            session.answer(site, WHOLE_SITE, f"recordings/{name}/*", self._handler(name))

    @property
    def pid(self) -> int | None:
        """Id of the process for fast requests; None before its first request."""
        return self._fast_worker.pid

    async def close(self) -> None:
        """Stop the worker processes."""
        for task in self._tasks.values():
            task.cancel()
        await asyncio.gather(*self._tasks.values(), return_exceptions=True)
        await self._fast_worker.close()
        await self._series_worker.close()

    def _handler(self, name: str) -> Callable[[Request], Awaitable[Message]]:
        schemas: dict[str, type[Message]] = {
            "range": schema.RecordedMessages,
            "series": schema.SeriesAnswer,
            "piece": schema.Piece,
        }

        async def answer(request: Request) -> Message:
            message, asker = request.message, request.asker
            assert message is not None
            try:
                self._mebibytes.check(asker)
            except QuotaError as error:
                self._uses.note_wait(name, asker, getattr(message, "file", ""), error.again_s)
                raise
            data = await self._ask(name, message)
            self._mebibytes.count(asker, len(data) / 2**20)
            answer = schemas[name].FromString(data)
            if isinstance(message, schema.PieceRequest) and isinstance(answer, schema.Piece):
                self._uses.note_piece(asker, message, answer)
            elif isinstance(message, schema.RangeRequest) and isinstance(answer, schema.RecordedMessages):
                self._uses.note_range(asker, message, answer)
            return answer

        return answer

    async def _list(self, request: Request) -> schema.RecordingList:
        query = request.message
        assert isinstance(query, schema.RecordingListQuery)
        answer = await self._ask_in_time("list", query, request.within_s)
        listed = schema.RecordingList.FromString(answer)
        open_now = self._open_now()
        known = {recording.file for recording in listed.recordings}
        rows = [open_now.get(recording.file, recording) for recording in listed.recordings]
        rows += [recording for file, recording in open_now.items() if file not in known]
        rows.sort(key=lambda recording: recording.file, reverse=True)
        return schema.RecordingList(recordings=rows, free_bytes=listed.free_bytes, flight=self._flight())

    async def _info(self, request: Request) -> schema.Recording:
        assert isinstance(request.message, schema.RecordingQuery)
        return await self.describe(request.message.file, request.within_s)

    async def describe(self, file: str, within_s: float | None = None) -> schema.Recording:
        """Describe a recording.

        Raises:
            BusyError: If reading it takes too long.
            RefusedError: If it cannot be read.
        """
        if (open_now := self._open_now().get(file)) is not None:
            return open_now
        query = schema.RecordingQuery(file=file)
        return schema.Recording.FromString(await self._ask_in_time("info", query, within_s))

    async def _ask_in_time(self, name: str, query: Message, within_s: float | None) -> bytes:
        """Return the worker's answer, before the client's timeout.

        A slower answer is completed in the background and kept for a moment, for the client's next attempt.

        Raises:
            BusyError: If it takes longer.
            RefusedError: If the worker cannot answer.
        """
        key = name, query.SerializeToString()
        if (task := self._tasks.get(key)) is None:
            task = self._tasks[key] = asyncio.create_task(self._ask(name, query))
            task.add_done_callback(lambda task: self._keep(key, task))
        wait_s = _MAX_WAIT_S if within_s is None else min(_MAX_WAIT_S, _SHARE * within_s)
        try:
            async with asyncio.timeout(wait_s):
                return await asyncio.shield(task)
        except TimeoutError:
            raise BusyError(codes.RECORDER_BUSY(request=name)) from None
        finally:
            if task.done():  # the next client gets a fresh answer
                self._forget(key, task)

    def _keep(self, key: tuple[str, bytes], task: asyncio.Task[bytes]) -> None:
        if not task.cancelled():
            task.exception()  # marks it as retrieved: the client may have gone
        asyncio.get_running_loop().call_later(_CACHE_S, self._forget, key, task)

    def _forget(self, key: tuple[str, bytes], task: asyncio.Task[bytes]) -> None:
        if self._tasks.get(key) is task:
            del self._tasks[key]

    async def _ask(self, name: str, request: Message) -> bytes:
        """Return the worker's serialized answer.

        Raises:
            RefusedError: If the recording cannot be read, or the worker crashed or timed out.
        """
        worker, within_s = self._fast_worker, _WITHIN_S
        if name == "series":
            worker, within_s = self._series_worker, _SERIES_WITHIN_S
        try:
            answer = await worker.ask(Question(name, request.SerializeToString()), timeout_s=within_s)
        except RecordingError as error:
            raise RefusedError(error.reason) from None
        except WorkerError as error:
            raise RefusedError(codes.RECORDING_UNREADABLE(error.reason)) from None
        except OSError as error:
            raise RefusedError(codes.RECORDING_UNREADABLE(codes.OTHER(detail=error))) from None
        assert isinstance(answer, bytes)
        return answer
