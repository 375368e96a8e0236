"""Recordings over HTTP, fetched from their site's recorder piece by piece.

    /recordings/<site>/<file>                  the file; Range, If-Range and HEAD are supported
    /recordings/<site>/<file>/thumbnail.jpg
    /recordings/<site>/<file>/values.csv       joints and tool, one row for each state

Only one piece is in memory at a time, however large the file.
"""

import csv
import io
import logging
import re
from collections.abc import AsyncIterator, Callable
from typing import NamedTuple, TypeVar
from urllib.parse import quote

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import DecodeError, Message
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import Scope

from robomesh import reason_codes as codes
from robomesh.errors import BusError, NoAnswerError, QuotaError
from robomesh.keys import WHOLE_SITE, robot_key
from robomesh.recordings.table import Table, is_due, table_of
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from services.console.errors import RecordingChangedError, RefusedRequest
from services.console.http.error_responses import (
    Handler,
    as_text,
    refused_on_the_mesh,
    with_error_responses,
)
from services.console.http.repeated_requests import ask_repeatedly
from services.console.http.streaming import Streamed

log = logging.getLogger(__name__)

AnyMessage = TypeVar("AnyMessage", bound=Message)

_PIECE = 1 << 20
# The first one is short, because a request to a site without a recorder ends after it.
_TIMEOUTS_S = (2.0, 5.0, 10.0, 20.0)
_MOST_DOWNLOADS = 8
_READS_WITHIN_S = 60.0
_ROWS = 2000
_RANGE = re.compile(r"bytes=(\d{0,19})-(\d{0,19})")


class _Where(NamedTuple):
    """The recorder's site, and the asker's name for quotas."""

    site: str
    asker: str


class _Recorded(NamedTuple):
    """The fields of a message that `robomesh.recordings.publisher_time` needs."""

    topic: str
    received_ns: int
    source_ns: int
    sequence: int


class Recordings:
    """The routes, and the number of downloads.

    Args:
        asker: Returns the name for a request over HTTP.
    """

    def __init__(self, session: Session, asker: Callable[[Scope], str]) -> None:
        self._session, self._asker = session, asker
        self._downloads = 0

    def routes(self) -> list[Route]:
        """Return the routes of files, thumbnails and values."""
        return [
            Route("/recordings/{site}/{file}", _answered(self.file), methods=["GET"]),
            Route("/recordings/{site}/{file}/thumbnail.jpg", _answered(self.thumbnail), methods=["GET"]),
            Route("/recordings/{site}/{file}/values.csv", _answered(self.values), methods=["GET"]),
        ]

    async def file(self, request: Request) -> Response:
        """Send the file, or a range of it."""
        where, name = self._where(request), request.path_params["file"]
        first = await self._piece(where, schema.PieceRequest(file=name, length=1))
        total, tag = first.total, f'"{first.version}"'
        headers = {
            "ETag": tag,
            "Accept-Ranges": "bytes",
            "Cache-Control": "no-cache",
            "Content-Type": "application/octet-stream",
            "Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}",
        }
        if request.headers.get("if-none-match") == tag:
            return Response(status_code=304, headers=headers)
        asked = request.headers.get("range", "")
        if asked and request.headers.get("if-range", tag) != tag:
            asked = ""  # the file has changed: send all of it
        begin, end, status = 0, total, 200
        if (wanted := _RANGE.fullmatch(asked)) and (wanted[1] or wanted[2]):
            begin, end = _within(wanted[1], wanted[2], total)
            status = 206
            if begin >= end:
                refused = as_text(
                    RefusedRequest(416, codes.RECORDING_RANGE(range=asked, file=name, bytes=total))
                )
                refused.headers.update({"ETag": tag, "Content-Range": f"bytes */{total}"})
                return refused
            headers["Content-Range"] = f"bytes {begin}-{end - 1}/{total}"
        headers["Content-Length"] = str(end - begin)
        if request.method == "HEAD":
            return Response(status_code=status, headers=headers)
        return self._streamed(self._bytes(where, name, first.version, begin, end), headers, status)

    async def thumbnail(self, request: Request) -> Response:
        """Send a picture from the recording."""
        where, name = self._where(request), request.path_params["file"]
        asked = schema.PieceRequest(file=name, attachment="thumbnail.jpg", length=4 << 20)
        piece = await self._piece(where, asked)
        # A recording's open part may be replaced, so browsers must revalidate; the body is seldom sent.
        headers = {"ETag": f'"{piece.version}"', "Cache-Control": "no-cache"}
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        return Response(piece.data, media_type="image/jpeg", headers=headers)

    async def values(self, request: Request) -> Response:
        """Send joints and tool as CSV, one row for each state."""
        where, name = self._where(request), request.path_params["file"]
        info = await self._ask(where, "info", schema.RecordingQuery(file=name))
        assert isinstance(info, schema.Recording)
        topics = {each.topic.split("/", 3)[-1]: each.topic for each in info.topics if each.messages}
        if "joints" not in topics:
            raise RefusedRequest(404, codes.RECORDING_NO_JOINTS(file=name))
        saved = quote(name.removesuffix(".mcap") + ".csv")
        headers = {
            "Cache-Control": "no-cache",
            "Content-Type": "text/csv; charset=utf-8",
            "Content-Disposition": f"attachment; filename*=UTF-8''{saved}",
        }
        return self._streamed(self._lines(where, info, topics), headers, 200)

    def _streamed(self, content: AsyncIterator[bytes], headers: dict[str, str], status: int) -> Response:
        if self._downloads >= _MOST_DOWNLOADS:
            raise RefusedRequest(503, codes.RECORDING_TOO_MANY(count=_MOST_DOWNLOADS), again_s=5.0)
        self._downloads += 1

        async def end() -> None:
            self._downloads -= 1

        return Streamed(content, headers, status=status, within_s=_READS_WITHIN_S, on_end=end)

    async def _bytes(
        self, where: _Where, name: str, version: str, begin: int, end: int
    ) -> AsyncIterator[bytes]:
        while begin < end:
            asked = schema.PieceRequest(file=name, offset=begin, length=min(_PIECE, end - begin))
            piece = await self._piece(where, asked)
            if piece.version != version or not piece.data:
                # The status has been sent already, so breaking off is the only way to report it.
                raise RecordingChangedError(f"{name} was written again while it was sent")
            begin += len(piece.data)
            yield piece.data

    async def _lines(
        self, where: _Where, info: schema.Recording, topics: dict[str, str]
    ) -> AsyncIterator[bytes]:
        description: schema.Description | None = None
        if "description" in topics:
            async for _, data in self._messages(where, info.file, topics["description"]):
                description = _decoded(schema.Description, data) or description
        tools = self._messages(where, info.file, topics["kinematics"]) if "kinematics" in topics else None
        tool = None if tools is None else await anext(tools, None)
        table: Table | None = None
        text = io.StringIO()
        writer = csv.writer(text)
        async for message, data in self._messages(where, info.file, topics["joints"]):
            state = _decoded(JointStates, data)
            if state is None:
                continue
            if table is None:
                table = table_of(state, description, start_ns=info.start.ToNanoseconds())
                writer.writerow(table.header)
            while tools is not None and tool is not None and is_due(tool[0], message):
                if (kinematics := _decoded(schema.KinematicState, tool[1])) is not None:
                    table.take_tool(kinematics, tool[0])
                tool = await anext(tools, None)
            writer.writerow(table.row(state, message))
            if text.tell() > _PIECE // 8:
                yield text.getvalue().encode()
                text.seek(0)
                text.truncate()
        yield text.getvalue().encode()

    async def _messages(self, where: _Where, name: str, topic: str) -> AsyncIterator[tuple[_Recorded, bytes]]:
        """Yield all messages of a topic; any number may have the same time."""
        asked = schema.RangeRequest(file=name, topic=topic, most=_ROWS)
        while True:
            answer = await self._ask(where, f"range/{where.asker}", asked)
            assert isinstance(answer, schema.RecordedMessages)
            times = [message.received.ToNanoseconds() for message in answer.messages]
            for time_ns, message in zip(times, answer.messages, strict=True):
                source_ns = message.source.ToNanoseconds()
                yield _Recorded(topic, time_ns, source_ns, message.sequence), message.data
            if not answer.more:
                return
            last = times[-1]
            still = asked.HasField("start") and asked.start.ToNanoseconds() == last
            asked.skip = times.count(last) + (asked.skip if still else 0)
            asked.start.FromNanoseconds(last)

    def _where(self, request: Request) -> _Where:
        return _Where(request.path_params["site"], self._asker(request.scope))

    async def _piece(self, where: _Where, asked: schema.PieceRequest) -> schema.Piece:
        piece = await self._ask(where, f"piece/{where.asker}", asked)
        assert isinstance(piece, schema.Piece)
        return piece

    async def _ask(self, where: _Where, what: str, asked: Message) -> Message:
        key = robot_key(where.site, WHOLE_SITE, f"recordings/{what}")
        return await ask_repeatedly(
            self._session,
            key,
            lambda timeout_s: self._session.ask(key, asked, timeout_s=timeout_s),
            _TIMEOUTS_S,
            repeat_after=(NoAnswerError, QuotaError),
        )


def _within(first: str, last: str, total: int) -> tuple[int, int]:
    """Return the bytes of a range, without its end; RFC 9110, 14.1.2."""
    if not first:
        return max(total - int(last), 0), total
    end = total if not last else min(int(last) + 1, total)
    return int(first), end


def _decoded(kind: type[AnyMessage], data: bytes) -> AnyMessage | None:
    """Parse a message; None if it is invalid, so that the rest of the recording is still used."""
    try:
        return kind.FromString(data)
    except DecodeError:
        return None


def _answered(handler: Handler) -> Handler:
    return with_error_responses(handler, as_text, _refused)


def _refused(error: Exception) -> RefusedRequest | None:
    return refused_on_the_mesh(error) if isinstance(error, BusError) else None
