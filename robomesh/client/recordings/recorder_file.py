"""Requests to a recorder for one of its files: its description, messages of a topic, bytes."""

import asyncio
import contextlib
import hashlib
import logging
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import NamedTuple

from google.protobuf.message import Message

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE, robot_key
from robomesh.errors import BusyError, NoAnswerError, QuotaError, RefusedError
from robomesh.recordings.changes import write_changes
from robomesh.recordings.errors import RecordingError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.repeated_requests import ask_repeatedly
from robomesh.wire.session import Session

log = logging.getLogger(__name__)

# The first one is short, because a request to a site without a recorder ends after it.
_TIMEOUTS_S = (2.0, 5.0, 10.0, 20.0)
_MESSAGES, _PIECE = 2000, 1 << 20
# A recording's file gets an index once, soon after its end.
_VERSIONS = 3
# A quota counts one minute: after that some of it is free again.
_LONGEST_WAIT_S = 60.0


class RangeMessage(NamedTuple):
    """A recorded message as a recorder sends it; the times are ns since the Unix epoch."""

    topic: str
    received_ns: int
    source_ns: int
    sequence: int
    data: bytes


class RangePage(NamedTuple):
    """Some messages of a topic, with the full name of their schema: "foxglove.JointStates"."""

    schema: str
    messages: list[RangeMessage]


class Fetched(NamedTuple):
    """A fetched file, the byte at which the fetch resumed, and the file's size [bytes]."""

    file: Path
    resumed_at: int
    total: int


class RecorderFile:
    """A file in the folder of a site's recorder.

    A request without an answer is repeated, if the recorder is present.

    Args:
        asker: Name for the requests, by which the recorder counts its quota.
        on_quota: Called when the quota is used up, before the request waits for it.

    Attributes:
        name: Name of the file in the recorder's folder.
    """

    def __init__(
        self,
        session: Session,
        site: str,
        name: str,
        *,
        asker: str,
        on_quota: Callable[[QuotaError], None] | None = None,
    ) -> None:
        self._session, self._site, self.name, self._asker = session, site, name, asker
        self._on_quota = on_quota or self._log_quota

    @property
    def saved_name(self) -> str:
        """The name for a copy: it comes from another machine, so it must be no path and no hidden file.

        Raises:
            RecordingError: If it is.
        """
        plain = Path(self.name).name == self.name and self.name.isprintable() and "\\" not in self.name
        if not plain or not self.name or self.name.startswith("."):
            raise RecordingError(
                f"the recorder of {self._site} names the file {self.name!r}, which is not a plain file name"
            )
        return self.name

    async def describe(self) -> schema.Recording:
        """Return the description of the recording.

        Raises:
            RobomeshError: If the recorder refuses or does not answer.
        """
        answer = await self._ask("info", schema.RecordingQuery(file=self.name))
        assert isinstance(answer, schema.Recording)
        return answer

    async def change(self, request: schema.RecordingRequest, author: str = "") -> schema.Recording:
        """Rename, note, tag or delete the recording, and return its description.

        Args:
            request: Its `file` is set.
            author: Name for the change; empty: that of the other requests.

        Raises:
            RobomeshError: If the recorder refuses or does not answer; a refused change changed nothing.
        """
        request.file = self.name
        answer = await self._ask(f"request/{author or self._asker}", request)
        assert isinstance(answer, schema.Recording)
        return answer

    async def piece(
        self, *, offset: int = 0, length: int = 1, attachment: str = "", wait: bool = False
    ) -> schema.Piece:
        """Return bytes of the file or of an attachment, with its total length and version.

        Args:
            wait: Wait for the quota.

        Raises:
            RobomeshError: If the recorder refuses or does not answer.
        """
        request = schema.PieceRequest(file=self.name, offset=offset, length=length, attachment=attachment)
        answer = await self._ask(f"piece/{self._asker}", request, wait=wait)
        assert isinstance(answer, schema.Piece)
        return answer

    async def pieces(self, begin: int, end: int, *, version: str) -> AsyncIterator[bytes]:
        """Yield a version's bytes from `begin` up to but excluding `end`; wait for the quota.

        Raises:
            RecordingError: If the file has another version: `recording.changed`.
            RobomeshError: If the recorder refuses or does not answer.
        """
        while begin < end:
            try:
                piece = await self.piece(offset=begin, length=min(_PIECE, end - begin), wait=True)
            except RefusedError as error:
                if error.code == codes.RECORDING_NO_BYTE.name:  # the new version is shorter
                    raise RecordingError(codes.RECORDING_CHANGED(file=self.name)) from None
                raise
            if piece.version != version or not 0 < len(piece.data) <= end - begin:
                raise RecordingError(codes.RECORDING_CHANGED(file=self.name))
            begin += len(piece.data)
            yield piece.data

    async def pages(
        self, topic: str, *, start_ns: int | None = None, end_ns: int | None = None
    ) -> AsyncIterator[RangePage]:
        """Yield the messages of a topic in the order of their receive times; wait for the quota.

        Each request repeats the last known message, which shows that the file is still the same.

        Args:
            topic: Name of the channel.
            start_ns, end_ns: Receive times, both included; None: the recording's start or end.

        Raises:
            RecordingError: If the file was replaced meanwhile: `recording.changed`.
            RobomeshError: If the recorder refuses or does not answer.
        """
        request = schema.RangeRequest(file=self.name, topic=topic, most=_MESSAGES)
        if start_ns is not None:
            request.start.FromNanoseconds(start_ns)
        if end_ns is not None:
            request.end.FromNanoseconds(end_ns)
        last: RangeMessage | None = None
        # Known messages with the receive time of the last one, and how many of them the next answer repeats.
        known = repeated = 0
        while True:
            request.skip = known - repeated
            answer = await self._ask(f"range/{self._asker}", request, wait=True)
            assert isinstance(answer, schema.RecordedMessages)
            messages = [_range_message(topic, each) for each in answer.messages]
            if messages[:repeated] != [last] * repeated or (answer.more and not messages):
                raise RecordingError(codes.RECORDING_CHANGED(file=self.name))
            new = messages[repeated:]
            times = [each.received_ns for each in messages]
            if times != sorted(times) or (last is not None and times and times[0] < last.received_ns):
                raise RecordingError(f"{self.name}: its recorder sends messages in a wrong order")
            yield RangePage(answer.schema, new)
            if not answer.more:
                return
            for each in new:
                known = known + 1 if last is not None and each.received_ns == last.received_ns else 1
                last = each
            # The repeated message and the next one may be too long for one answer.
            repeated = 1 if new else 0
            if last is not None:
                request.start.FromNanoseconds(last.received_ns)

    async def value_names(self) -> list[str]:
        """Return the names of the recorded values; wait for the quota.

        Raises:
            RobomeshError: If the recorder refuses or does not answer.
        """
        answer = await self._ask(f"series/{self._asker}", schema.SeriesRequest(file=self.name), wait=True)
        assert isinstance(answer, schema.SeriesAnswer)
        return list(answer.known)

    async def fetch(self, out: Path, *, on_progress: Callable[[float], None] = lambda share: None) -> Fetched:
        """Copy the file; resume an earlier fetch of the same version.

        If the file changes meanwhile, as when a closed recording gets its index, copy the new version. A
        recording's changes (name, note, tags) are written beside it, `*.changes.json`.

        Args:
            out: Path of the copy, or a folder.
            on_progress: Called with the fetched share, from 0 to 1.

        Raises:
            RecordingError: If the file changes again and again, or its name is not a plain file name.
            RobomeshError: If the recorder refuses or does not answer.
            OSError: If the copy cannot be written.
        """
        name = self.saved_name
        out = out / name if await asyncio.to_thread(out.is_dir) else out
        if out.exists() and not out.is_file():  # the copy would replace it
            raise RecordingError(f"{out} is not a file: choose another path for the copy")
        fetched = await self._fetch_newest(out, on_progress)
        with contextlib.suppress(RefusedError):  # a damaged file is copied without them
            if history := (await self.describe()).history:
                await asyncio.to_thread(write_changes, out, history)
        return fetched

    async def _fetch_newest(self, out: Path, on_progress: Callable[[float], None]) -> Fetched:
        for _ in range(_VERSIONS - 1):
            with contextlib.suppress(RecordingError):
                return await self._fetch_version(out, on_progress)
        return await self._fetch_version(out, on_progress)

    async def _fetch_version(self, out: Path, on_progress: Callable[[float], None]) -> Fetched:
        first = await self.piece(wait=True)
        # With the version in the name, a fetch never resumes another version's file.
        version = hashlib.sha256(first.version.encode()).hexdigest()[:12]
        partial = out.with_name(f".{out.name}.{version}.part")
        at = begun = partial.stat().st_size if partial.exists() else 0
        try:
            with partial.open("ab") as stream:
                async for data in self.pieces(begun, first.total, version=first.version):
                    stream.write(data)
                    at += len(data)
                    on_progress(at / first.total)
        except RecordingError:
            partial.unlink(missing_ok=True)
            raise
        partial.replace(out)
        return Fetched(out, begun, first.total)

    async def _ask(self, what: str, request: Message, *, wait: bool = False) -> Message:
        key = robot_key(self._site, WHOLE_SITE, f"recordings/{what}")

        async def ask(timeout_s: float) -> Message:
            while True:
                try:
                    return await self._session.ask(key, request, timeout_s=timeout_s)
                except QuotaError as error:
                    if not wait:
                        raise
                    self._on_quota(error)
                    await asyncio.sleep(min(error.again_s, _LONGEST_WAIT_S))

        again = (NoAnswerError, BusyError)
        return await ask_repeatedly(self._session, key, ask, _TIMEOUTS_S, repeat_after=again)

    def _log_quota(self, error: QuotaError) -> None:
        log.info("%s waits: %s", self.name, error)


def _range_message(topic: str, each: schema.RecordedMessages.Message) -> RangeMessage:
    received_ns, source_ns = each.received.ToNanoseconds(), each.source.ToNanoseconds()
    return RangeMessage(topic, received_ns, source_ns, each.sequence, each.data)
