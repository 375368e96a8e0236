"""Recordings over HTTP, fetched from their site's recorder piece by piece.

    /recordings/<site>/<file>                  the file; Range, If-Range and HEAD are supported
    /recordings/<site>/<file>/thumbnail.jpg
    /recordings/<site>/<file>/values.csv       joints and tool, one row for each state; ?from=S&to=S: a part
    /recordings.zip?recording=<site>/<file>    a ZIP of all the files that are named so

Only one piece is in memory at a time, however large the file.
"""

import csv
import io
import logging
import re
from collections.abc import AsyncIterator, Callable
from typing import TypeVar
from urllib.parse import quote

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import DecodeError, Message
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import Scope

from robomesh import reason_codes as codes
from robomesh.client.recordings.recorder_file import RangeMessage, RecorderFile
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.names import SUFFIX, robot_channels
from robomesh.recordings.series.table import Table, is_due, table_of
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.console.common.error_responses import (
    Handler,
    as_text,
    refused_error,
    with_error_responses,
)
from services.console.common.errors import RefusedRequest
from services.console.http.recording_span import Span, span_of
from services.console.http.recordings_zip import ZipEntry, zip_of
from services.console.http.streaming import Streamed

log = logging.getLogger(__name__)

AnyMessage = TypeVar("AnyMessage", bound=Message)

_MOST_DOWNLOADS = 8
_MOST_IN_ZIP = 100
_READS_WITHIN_S = 60.0
_SENT_BYTES = 1 << 17
_RANGE = re.compile(r"bytes=(\d{0,19})-(\d{0,19})")


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
            Route("/recordings.zip", _answered(self.zip), methods=["GET"]),
            Route("/recordings/{site}/{file}", _answered(self.file), methods=["GET"]),
            Route("/recordings/{site}/{file}/thumbnail.jpg", _answered(self.thumbnail), methods=["GET"]),
            Route("/recordings/{site}/{file}/values.csv", _answered(self.values), methods=["GET"]),
        ]

    async def file(self, request: Request) -> Response:
        """Send the file, or a range of it."""
        file = self._file(request)
        first, name = await file.piece(), file.name
        total, tag = first.total, _tag(first)
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
        # If the file changes, breaking off is the only way to report it: the status has been sent already.
        return self._streamed(file.pieces(begin, end, version=first.version), headers, status)

    async def zip(self, request: Request) -> Response:
        """Send several files as one ZIP, uncompressed, with their changes beside them."""
        names = list(dict.fromkeys(request.query_params.getlist("recording")))
        if not 0 < len(names) <= _MOST_IN_ZIP:
            raise RefusedRequest(400, codes.RECORDING_ZIP(count=len(names), most=_MOST_IN_ZIP))
        asker, entries = self._asker(request.scope), []
        for each in names:
            site, _, name = each.partition("/")
            file = RecorderFile(self._session, site, name, asker=asker)
            saved = file.saved_name
            info = await file.describe()
            if info.open:
                raise RefusedRequest(409, codes.RECORDING_WRITTEN(name=info.name))
            entries.append(ZipEntry(site, saved, file, info, await file.piece()))
        headers = {
            "Cache-Control": "no-store",
            # Not application/zip, which would be compressed again.
            "Content-Type": "application/octet-stream",
            "Content-Disposition": 'attachment; filename="recordings.zip"',
        }
        return self._streamed(zip_of(entries), headers, 200)

    async def thumbnail(self, request: Request) -> Response:
        """Send a picture from the recording."""
        piece = await self._file(request).piece(attachment="thumbnail.jpg", length=4 << 20)
        # A recording's open part may be replaced, so browsers must revalidate; the body is seldom sent.
        headers = {"ETag": _tag(piece), "Cache-Control": "no-cache"}
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        return Response(piece.data, media_type="image/jpeg", headers=headers)

    async def values(self, request: Request) -> Response:
        """Send joints and tool as CSV, one row for each state; `from` and `to` limit the time."""
        file = self._file(request)
        info = await file.describe()
        span = span_of(info, request.query_params)
        messages = {each.topic: each.messages for each in info.topics if each.messages}
        try:
            topics = robot_channels(messages, file.name)
        except RecordingError as error:
            raise RefusedRequest(409, error.reason) from None
        if "joints" not in topics:
            raise RefusedRequest(404, codes.RECORDING_NO_JOINTS(file=file.name))
        saved = quote(file.name.removesuffix(SUFFIX) + span.suffix + ".csv")
        headers = {
            "Cache-Control": "no-cache",
            "Content-Type": "text/csv; charset=utf-8",
            "Content-Disposition": f"attachment; filename*=UTF-8''{saved}",
        }
        return self._streamed(_lines(file, topics, info.start.ToNanoseconds(), span), headers, 200)

    def _streamed(self, content: AsyncIterator[bytes], headers: dict[str, str], status: int) -> Response:
        if self._downloads >= _MOST_DOWNLOADS:
            raise RefusedRequest(503, codes.RECORDING_TOO_MANY(count=_MOST_DOWNLOADS), again_s=5.0)
        self._downloads += 1

        async def end() -> None:
            self._downloads -= 1

        return Streamed(content, headers, status=status, within_s=_READS_WITHIN_S, on_end=end)

    def _file(self, request: Request) -> RecorderFile:
        site, name = request.path_params["site"], request.path_params["file"]
        return RecorderFile(self._session, site, name, asker=self._asker(request.scope))


async def _lines(
    file: RecorderFile, topics: dict[str, str], start_ns: int, span: Span
) -> AsyncIterator[bytes]:
    description: schema.Description | None = None
    if "description" in topics:
        async for message in _messages(file, topics["description"], Span()):
            description = _decoded(schema.Description, message.data) or description
    units: dict[str, str] = {}
    if "signals" in topics:
        async for message in _messages(file, topics["signals"], span):
            if (signals := _decoded(schema.Signals, message.data)) is not None:
                units |= {each.name: each.unit for each in signals.signals}
    tools = _messages(file, topics["kinematics"], span) if "kinematics" in topics else None
    tool = None if tools is None else await anext(tools, None)
    others = _messages(file, topics["signals"], span) if "signals" in topics else None
    other = None if others is None else await anext(others, None)
    table: Table | None = None
    text = io.StringIO()
    writer = csv.writer(text)
    async for message in _messages(file, topics["joints"], span):
        state = _decoded(JointStates, message.data)
        if state is None:
            continue
        if table is None:
            table = table_of(state, description, units, start_ns=start_ns)
            writer.writerow(table.header)
        while tools is not None and tool is not None and is_due(tool, message):
            if (kinematics := _decoded(schema.KinematicState, tool.data)) is not None:
                table.take_tool(kinematics, tool)
            tool = await anext(tools, None)
        while others is not None and other is not None and is_due(other, message):
            if (signals := _decoded(schema.Signals, other.data)) is not None:
                table.take_signals(signals, other)
            other = await anext(others, None)
        writer.writerow(table.row(state, message))
        if text.tell() > _SENT_BYTES:
            yield text.getvalue().encode()
            text.seek(0)
            text.truncate()
    yield text.getvalue().encode()


async def _messages(file: RecorderFile, topic: str, span: Span) -> AsyncIterator[RangeMessage]:
    async for page in file.pages(topic, start_ns=span.start_ns, end_ns=span.end_ns):
        for message in page.messages:
            yield message


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
    return with_error_responses(handler, as_text, refused_error)


def _tag(piece: schema.Piece) -> str:
    """Return the entity tag of a file's version, which its recorder chose."""
    return f'"{quote(piece.version)}"'
