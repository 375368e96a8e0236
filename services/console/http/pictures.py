"""Pictures over HTTP: a view as MJPEG, as live MP4, or as a still.

    /video/<site>/<robot>/<view>.mjpeg    an <img>, a player
    /video/<site>/<robot>/<view>.mp4      fragmented, from the shared video packets
    /image/<site>/<robot>/<view>.jpg      or .png

Without a query it is the shared view; `?width=&height=&fps=` requests a view of that size and rate. A slow
reader gets the newest picture (for MP4: continues at a key frame). The subscription ends when its reader
disconnects or stops reading.
"""

import asyncio
import contextlib
import logging
import time
from collections import Counter
from collections.abc import AsyncGenerator, Callable, Coroutine
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import NamedTuple

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from google.protobuf.message import DecodeError
from starlette.datastructures import QueryParams
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import Scope

from renderer.encoding.mp4 import FragmentedMp4
from renderer.errors import Mp4Error
from robomesh import reason_codes as codes
from robomesh.contract import keys
from robomesh.errors import BusyError, KeyNameError, NoAnswerError, QuotaError, RefusedError, RobomeshError
from robomesh.publications.subscription import Sample
from robomesh.schemas.robomesh_pb2 import KeyFrameRequest, VideoFrames, ViewRequest
from robomesh.wire.session import Session
from services.console.common.error_responses import (
    Handler,
    as_text,
    refused_on_the_mesh,
    with_error_responses,
)
from services.console.common.errors import RefusedRequest
from services.console.common.requested_views import Views, robot_key
from services.console.http.png import png
from services.console.http.streaming import Streamed
from services.console.websocket.framing import SampleBatch
from services.console.websocket.send_queues import NewestQueue, SendQueue, VideoQueue
from services.console.websocket.shared_subscriptions import SharedSubscriptions

log = logging.getLogger(__name__)

MJPEG = "multipart/x-mixed-replace"
_BOUNDARY = "picture"
_MOST_STREAMS, _MOST_OF_ONE = 64, 32  # in total, per address
_MOST_STILLS = 32
_STILL_WITHIN_S = 5.0
# A stream's first picture; afterwards one comes at least twice a second while the renderer runs.
_FIRST_WITHIN_S = 10.0
_STALE_AFTER_S, _SILENT_S = 1.0, 10.0
_STALE_AFTER = 2.0  # in missed pictures
_READS_WITHIN_S = 10.0
_NO_STORE = {"Cache-Control": "no-store"}
# Shown when no picture comes, because an <img> would show the last one for ever.
_STALE = (Path(__file__).parent / "stale.jpg").read_bytes()


class View(NamedTuple):
    """The keys of a view's video and pictures, and its highest rate [1/s]."""

    video: str
    image: str
    fps: float


class _Size(NamedTuple):
    """Requested size and rate of a view; zero: the renderer's default."""

    width: int = 0
    height: int = 0
    fps: float = 0.0


@dataclass
class Pictures:
    """The routes, and the numbers of streams and stills.

    Attributes:
        asker: Returns the name for a request over HTTP.
    """

    subscriptions: SharedSubscriptions
    views: Views
    session: Session
    asker: Callable[[Scope], str]
    streams: Counter[str] = field(default_factory=Counter)  # by address
    stills: int = 0

    def routes(self) -> list[Route]:
        """Return the routes of videos and stills."""
        return [
            Route("/video/{site}/{robot}/{view}.mjpeg", _answered(self.mjpeg), methods=["GET"]),
            Route("/video/{site}/{robot}/{view}.mp4", _answered(self.mp4), methods=["GET"]),
            Route("/image/{site}/{robot}/{view}.jpg", _answered(self.still), methods=["GET"]),
            Route("/image/{site}/{robot}/{view}.png", _answered(self.still_png), methods=["GET"]),
        ]

    async def mjpeg(self, request: Request) -> Response:
        """Send one JPEG after another; each replaces the one before."""
        view = await self.view(request)
        stale_after_s = max(_STALE_AFTER_S, _STALE_AFTER / view.fps)
        pieces = _mjpeg_parts(self.subscriptions, view.image, stale_after_s)
        return await self.stream(request, pieces, view.image, f"{MJPEG}; boundary={_BOUNDARY}")

    async def mp4(self, request: Request) -> Response:
        """Send fragmented MP4, from the newest key frame on."""
        view = await self.view(request)
        pieces = _fragments(self.subscriptions, view, partial(self._want_key_frame, request, view.video))
        return await self.stream(request, pieces, view.video, "video/mp4")

    async def _want_key_frame(self, request: Request, key: str) -> None:
        """Ask for a key frame, with which the renderer sends pictures at the full rate for a moment."""
        with contextlib.suppress(RobomeshError):  # the next key frame comes within 2 s anyway
            await self.session.ask(f"{key}/keyframe/{self.asker(request.scope)}", KeyFrameRequest())

    async def still(self, request: Request) -> Response:
        """Send the newest picture as JPEG."""
        return Response(await self._still(request), media_type="image/jpeg", headers=_NO_STORE)

    async def still_png(self, request: Request) -> Response:
        """Send the newest picture as PNG."""
        data = await asyncio.to_thread(png, await self._still(request))
        return Response(data, media_type="image/png", headers=_NO_STORE)

    async def _still(self, request: Request) -> bytes:
        if self.stills >= _MOST_STILLS:
            raise RefusedRequest(503, codes.VIEW_TOO_MANY_STILLS(count=_MOST_STILLS))
        self.stills += 1
        try:
            key = (await self.view(request)).image
            with contextlib.closing(NewestSampleReader(self.subscriptions, key, NewestQueue())) as watch:
                sample = await watch.next(_STILL_WITHIN_S)
            if sample is None:
                raise RefusedRequest(504, codes.VIEW_NO_PICTURE(view=key, seconds=_STILL_WITHIN_S))
            return _jpeg(sample)
        finally:
            self.stills -= 1

    async def view(self, request: Request) -> View:
        """Return the keys of the view that a request names."""
        path, size = request.path_params, _size(request.query_params)
        try:
            robot, view = robot_key(path["site"], path["robot"]), keys.check_chunk(path["view"], "view")
        except KeyNameError as error:
            raise RefusedRequest(404, codes.INVALID(error.reason)) from None
        wanted = ViewRequest(of=view, width=size.width, height=size.height, fps=size.fps)
        try:
            answer = await self.views.ask(robot, wanted, self.asker(request.scope))
        except NoAnswerError:
            named = f"{path['site']}/{path['robot']}"
            raise RefusedRequest(503, codes.VIEW_NO_RENDERER(robot=named)) from None
        except (QuotaError, BusyError) as error:
            raise refused_on_the_mesh(error) from None
        except RefusedError as error:
            if error.reason.code == codes.VIEW_NO_ROOM.name:
                raise RefusedRequest(503, error.reason) from None
            # Find out whether the view or the size was rejected.
            status = 404
            if any(size):
                with contextlib.suppress(RobomeshError):
                    await self.views.ask(robot, ViewRequest(of=view), self.asker(request.scope))
                    status = 400
            raise RefusedRequest(status, error.reason) from None
        return View(f"{robot}/{answer.topic}", f"{robot}/{answer.image}", max(answer.fps, 1.0))

    async def stream(
        self, request: Request, pieces: AsyncGenerator[bytes], key: str, media_type: str
    ) -> Response:
        """Return a response that sends the pieces, if there is room for another stream.

        Args:
            key: Key of the pictures, for a refusal.
        """
        if request.method == "HEAD":
            await pieces.aclose()
            return _endless(media_type)
        address = request.client.host if request.client else ""
        if self.streams.total() >= _MOST_STREAMS:
            raise RefusedRequest(503, codes.VIEW_TOO_MANY_STREAMS(count=_MOST_STREAMS))
        if self.streams[address] >= _MOST_OF_ONE:
            reason = codes.VIEW_TOO_MANY_STREAMS_OF(count=_MOST_OF_ONE, address=address)
            raise RefusedRequest(503, reason)
        self.streams[address] += 1
        begun = False
        try:
            # A status can be sent only before the first byte.
            try:
                async with asyncio.timeout(_FIRST_WITHIN_S):
                    first = await anext(pieces)
            except (TimeoutError, StopAsyncIteration):
                reason = codes.VIEW_NO_PICTURE(view=key, seconds=_FIRST_WITHIN_S)
                raise RefusedRequest(504, reason) from None
            begun = True
        finally:
            if not begun:
                await self._end(address, pieces)
        return Streamed(
            _prepend(first, pieces),
            _NO_STORE,
            media_type=media_type,
            within_s=_READS_WITHIN_S,
            on_end=lambda: self._end(address, pieces),
        )

    async def _end(self, address: str, pieces: AsyncGenerator[bytes]) -> None:
        self.streams[address] -= 1
        self.streams += Counter()  # removes zeros
        await pieces.aclose()


class NewestSampleReader:
    """One reader's subscription to a key; reads the newest sample.

    Args:
        ready: Set when a sample arrives; for a reader of several keys.
    """

    def __init__(
        self,
        subscriptions: SharedSubscriptions,
        key: str,
        queue: SendQueue,
        ready: asyncio.Event | None = None,
    ) -> None:
        self._subscriptions, self._key, self._queue = subscriptions, key, queue
        self._ready = ready or asyncio.Event()
        subscriptions.join(key, self._push)

    def close(self) -> None:
        """Unsubscribe."""
        self._subscriptions.leave(self._key, self._push)

    def pop(self) -> Sample | None:
        """Return the next sample; None if none has arrived."""
        return self._queue.pop()

    async def next(self, within_s: float) -> Sample | None:
        """Return the next sample; None if none arrives in time."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                while True:
                    self._ready.clear()
                    sample = self._queue.pop()
                    if sample is not None:
                        return sample
                    await self._ready.wait()
        return None

    def _push(self, batch: SampleBatch) -> None:
        for sample in batch.samples:
            self._queue.push(sample)
        self._ready.set()


async def _prepend(first: bytes, pieces: AsyncGenerator[bytes]) -> AsyncGenerator[bytes]:
    yield first
    async for piece in pieces:
        yield piece


async def _mjpeg_parts(
    subscriptions: SharedSubscriptions, key: str, stale_after_s: float
) -> AsyncGenerator[bytes]:
    with contextlib.closing(NewestSampleReader(subscriptions, key, NewestQueue())) as watch:
        sample = await watch.next(_FIRST_WITHIN_S)
        if sample is None:
            return
        silent_s = 0.0
        while silent_s < _SILENT_S:
            picture = _STALE if sample is None else _jpeg(sample)
            head = f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(picture)}\r\n\r\n"
            yield head.encode() + picture + b"\r\n"
            sample = await watch.next(stale_after_s)
            silent_s = silent_s + stale_after_s if sample is None else 0.0


async def _fragments(
    subscriptions: SharedSubscriptions, view: View, want_key_frame: Callable[[], Coroutine[None, None, None]]
) -> AsyncGenerator[bytes]:
    """Yield MP4 fragments. Earlier frames are shown at the start: the times are those of arrival."""
    mp4 = FragmentedMp4()
    with contextlib.closing(NewestSampleReader(subscriptions, view.video, VideoQueue())) as watch:
        asking = asyncio.create_task(want_key_frame())
        try:
            while (sample := await watch.next(_SILENT_S)) is not None:
                try:
                    packets = _packets(sample)
                    piece = b"".join(mp4.add(data, at, usual_s=1.0 / view.fps) for data, at in packets)
                except (DecodeError, Mp4Error) as error:
                    log.info("an MP4 stream ended: %s", error)
                    return
                if piece:
                    yield piece
        finally:
            asking.cancel()


def _packets(sample: Sample) -> list[tuple[bytes, int]]:
    now = time.monotonic_ns()
    if sample.live:
        return [(CompressedVideo.FromString(sample.payload).data, now)]
    frames = VideoFrames.FromString(sample.payload).frames
    return [(CompressedVideo.FromString(frame.data).data, now) for frame in frames]


def _jpeg(sample: Sample) -> bytes:
    try:
        return CompressedImage.FromString(sample.payload).data
    except DecodeError:
        raise RefusedRequest(502, codes.VIEW_NOT_A_PICTURE(key=sample.key)) from None


def _size(query: QueryParams) -> _Size:
    """Return what a query requests of a view; the renderer checks the values.

    Raises:
        RefusedRequest: If it cannot be parsed.
    """
    # Without accounts all views are open, also by addresses with a token.
    unknown = set(query) - {*_Size._fields, "token"}
    if unknown:
        raise RefusedRequest(400, codes.VIEW_PARAMETER(name=sorted(unknown)[0][:20]))
    text = query.get("fps", "0")
    try:
        fps = float(text)
    except ValueError:
        raise RefusedRequest(400, codes.VIEW_NOT_A_NUMBER(name="fps", value=text[:20])) from None
    return _Size(_pixels(query, "width"), _pixels(query, "height"), fps)


def _pixels(query: QueryParams, name: str) -> int:
    text = query.get(name, "0")
    if not (text.isascii() and text.isdecimal() and len(text) < 6):
        raise RefusedRequest(400, codes.VIEW_NOT_PIXELS(name=name, value=text[:20]))
    return int(text)


def _endless(media_type: str) -> Response:
    """Return the headers of a stream, which has no length."""
    response = Response(media_type=media_type, headers=_NO_STORE)
    del response.headers["content-length"]
    return response


def _answered(handler: Handler) -> Handler:
    return with_error_responses(handler, as_text)
