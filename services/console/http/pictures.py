"""Pictures for anything that reads HTTP: a view as MJPEG, as MP4 while it happens, or as a still.

    /video/<site>/<robot>/<view>.mjpeg    an <img>, a player
    /video/<site>/<robot>/<view>.mp4      fragmented, of the packets that everybody watches
    /image/<site>/<robot>/<view>.jpg      or .png

As it is, a view is what everybody watches; `?width=&height=&fps=` asks the renderer for one of one's own.
Who reads slowly is given the newest picture (of MP4: goes on at a key frame); who is gone, or reads no
more, is watched for no more.
"""

import asyncio
import contextlib
import logging
import math
import time
from collections import Counter
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from google.protobuf.message import DecodeError
from starlette.datastructures import QueryParams
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import Scope

from renderer.errors import Mp4Error
from renderer.mp4 import FragmentedMp4
from robomesh import keys
from robomesh import reason_codes as codes
from robomesh.errors import BusError, BusyError, KeyNameError, NoAnswerError, QuotaError, RefusedError
from robomesh.schemas.robomesh_pb2 import VideoFrames, ViewRequest
from robomesh.subscription import Sample
from services.console.errors import PictureError
from services.console.http.png import png
from services.console.http.streaming import Streamed
from services.console.requested_views import Views, robot_key
from services.console.websocket.framing import Moment
from services.console.websocket.send_queues import Lane, NewestLane, VideoLane
from services.console.websocket.shared_subscriptions import Feeds

log = logging.getLogger(__name__)

MJPEG = "multipart/x-mixed-replace"
_BOUNDARY = "picture"
_MOST_STREAMS, _MOST_OF_ONE = 64, 32  # of all readers, of one address
_MOST_STILLS = 32
_STILL_WITHIN_S = 5.0
# A stream's first picture; after it a picture comes at least twice a second while the renderer lives.
_FIRST_WITHIN_S = 10.0
_STALE_AFTER_S, _SILENT_S = 1.0, 10.0
_STALE_AFTER = 2.0  # and in pictures that did not come
_READS_WITHIN_S = 10.0
_NO_STORE = {"Cache-Control": "no-store"}
_BUSY_AGAIN_S = 1.0
# An <img> would show the last picture for ever: this one says that it is old.
_STALE = (Path(__file__).parent / "stale.jpg").read_bytes()


class _View(NamedTuple):
    """The keys of a view's video and pictures, and its highest rate [1/s]."""

    video: str
    image: str
    fps: float


class _Size(NamedTuple):
    """What is asked of a view; zeros: as the renderer has it."""

    width: int = 0
    height: int = 0
    fps: float = 0.0


@dataclass
class Pictures:
    """The routes, and how many use them now.

    Attributes:
        asker: In whose name something is asked for over HTTP.
    """

    feeds: Feeds
    views: Views
    asker: Callable[[Scope], str]
    streams: Counter[str] = field(default_factory=Counter)  # by address
    stills: int = 0

    def routes(self) -> list[Route]:
        """Of video and stills."""
        return [
            Route("/video/{site}/{robot}/{view}.mjpeg", self.mjpeg, methods=["GET"]),
            Route("/video/{site}/{robot}/{view}.mp4", self.mp4, methods=["GET"]),
            Route("/image/{site}/{robot}/{view}.jpg", self.still, methods=["GET"]),
            Route("/image/{site}/{robot}/{view}.png", self.still_png, methods=["GET"]),
        ]

    async def mjpeg(self, request: Request) -> Response:
        """One JPEG after another, in the place of the one before."""
        try:
            view = await self._view(request)
            stale_after_s = max(_STALE_AFTER_S, _STALE_AFTER / view.fps)
            pieces = _parts(self.feeds, view.image, stale_after_s)
            return await self._stream(request, pieces, f"{MJPEG}; boundary={_BOUNDARY}")
        except PictureError as error:
            return _refused(error)

    async def mp4(self, request: Request) -> Response:
        """Fragmented MP4, from the newest key frame on."""
        try:
            view = await self._view(request)
            return await self._stream(request, _fragments(self.feeds, view.video), "video/mp4")
        except PictureError as error:
            return _refused(error)

    async def still(self, request: Request) -> Response:
        """The newest picture as JPEG."""
        try:
            return Response(await self._still(request), media_type="image/jpeg", headers=_NO_STORE)
        except PictureError as error:
            return _refused(error)

    async def still_png(self, request: Request) -> Response:
        """The newest picture as PNG."""
        try:
            data = await asyncio.to_thread(png, await self._still(request))
        except PictureError as error:
            return _refused(error)
        return Response(data, media_type="image/png", headers=_NO_STORE)

    async def _still(self, request: Request) -> bytes:
        if self.stills >= _MOST_STILLS:
            raise PictureError(503, f"{_MOST_STILLS} stills are being made: ask again in a moment")
        self.stills += 1
        try:
            key = (await self._view(request)).image
            with contextlib.closing(_Watch(self.feeds, key, NewestLane())) as watch:
                sample = await watch.next(_STILL_WITHIN_S)
            if sample is None:
                raise PictureError(504, f"no picture of {key} came within {_STILL_WITHIN_S:g} s")
            return _jpeg(sample)
        finally:
            self.stills -= 1

    async def _view(self, request: Request) -> _View:
        """The keys of the view that a request names."""
        path, size = request.path_params, _size(request.query_params)
        try:
            robot, view = robot_key(path["site"], path["robot"]), keys.check_chunk(path["view"], "view")
        except KeyNameError as error:
            raise PictureError(404, str(error)) from None
        wanted = ViewRequest(of=view, width=size.width, height=size.height, fps=size.fps)
        try:
            answer = await self.views.ask(robot, wanted, self.asker(request.scope))
        except NoAnswerError as error:
            raise PictureError(
                503,
                f"no renderer draws {path['site']}/{path['robot']}: is there such a robot, and does its "
                f"renderer run? ({error})",
            ) from None
        except QuotaError as error:
            raise PictureError(429, str(error), again_s=error.again_s) from None
        except BusyError as error:
            raise PictureError(503, str(error), again_s=_BUSY_AGAIN_S) from None
        except RefusedError as error:
            # An earlier renderer has no code.
            if error.reason.code == codes.VIEW_NO_ROOM.name or str(error).startswith("no room: "):
                raise PictureError(503, str(error)) from None
            # Whether it was the view or the size.
            status = 404
            if any(size):
                with contextlib.suppress(BusError):
                    await self.views.ask(robot, ViewRequest(of=view), self.asker(request.scope))
                    status = 400
            raise PictureError(status, str(error)) from None
        return _View(f"{robot}/{answer.topic}", f"{robot}/{answer.image}", max(answer.fps, 1.0))

    async def _stream(self, request: Request, pieces: AsyncGenerator[bytes], media_type: str) -> Response:
        if request.method == "HEAD":
            await pieces.aclose()
            return _endless(media_type)
        address = request.client.host if request.client else ""
        if self.streams.total() >= _MOST_STREAMS:
            raise PictureError(503, f"{_MOST_STREAMS} video streams are open already: close one first")
        if self.streams[address] >= _MOST_OF_ONE:
            raise PictureError(
                503, f"{_MOST_OF_ONE} video streams of {address} are open already: close one first"
            )
        self.streams[address] += 1
        begun = False
        try:
            # A status can be told only before the first byte.
            try:
                async with asyncio.timeout(_FIRST_WITHIN_S):
                    first = await anext(pieces)
            except (TimeoutError, StopAsyncIteration):
                raise PictureError(504, f"no picture came within {_FIRST_WITHIN_S:g} s") from None
            begun = True
        finally:
            if not begun:
                await self._end(address, pieces)
        return Streamed(
            _all(first, pieces),
            _NO_STORE,
            media_type=media_type,
            within_s=_READS_WITHIN_S,
            on_end=lambda: self._end(address, pieces),
        )

    async def _end(self, address: str, pieces: AsyncGenerator[bytes]) -> None:
        self.streams[address] -= 1
        self.streams += Counter()  # forgets who has none
        await pieces.aclose()


class _Watch:
    """One reader's watch of a key: what it reads next is the newest."""

    def __init__(self, feeds: Feeds, key: str, lane: Lane) -> None:
        self._feeds, self._key, self._lane = feeds, key, lane
        self._ready = asyncio.Event()
        feeds.join(key, self._push)

    def close(self) -> None:
        """Watches no more."""
        self._feeds.leave(self._key, self._push)

    async def next(self, within_s: float) -> Sample | None:
        """What is to be read next; None: nothing came."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                while True:
                    self._ready.clear()
                    sample = self._lane.pop()
                    if sample is not None:
                        return sample
                    await self._ready.wait()
        return None

    def _push(self, moment: Moment) -> None:
        for sample in moment.samples:
            self._lane.push(sample)
        self._ready.set()


async def _all(first: bytes, pieces: AsyncGenerator[bytes]) -> AsyncGenerator[bytes]:
    yield first
    async for piece in pieces:
        yield piece


async def _parts(feeds: Feeds, key: str, stale_after_s: float) -> AsyncGenerator[bytes]:
    with contextlib.closing(_Watch(feeds, key, NewestLane())) as watch:
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


async def _fragments(feeds: Feeds, key: str) -> AsyncGenerator[bytes]:
    """What came before now is shown at once, as its beginning: times are when a picture came."""
    mp4 = FragmentedMp4()
    with contextlib.closing(_Watch(feeds, key, VideoLane())) as watch:
        while (sample := await watch.next(_SILENT_S)) is not None:
            try:
                piece = b"".join(mp4.add(data, at) for data, at in _packets(sample))
            except (DecodeError, Mp4Error) as error:
                log.info("an MP4 stream ended: %s", error)
                return
            if piece:
                yield piece


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
        raise PictureError(502, f"{sample.key} is no picture") from None


def _size(query: QueryParams) -> _Size:
    """What a query asks of a view; what is possible, the renderer knows.

    Raises:
        PictureError: If it is not readable.
    """
    unknown = set(query) - set(_Size._fields)
    if unknown:
        raise PictureError(400, f"?{sorted(unknown)[0][:20]}= is not known: width, height and fps are")
    text = query.get("fps", "0")
    try:
        fps = float(text)
    except ValueError:
        raise PictureError(400, f"fps={text[:20]!r} is no number") from None
    return _Size(_pixels(query, "width"), _pixels(query, "height"), fps)


def _pixels(query: QueryParams, name: str) -> int:
    text = query.get(name, "0")
    if not (text.isascii() and text.isdecimal() and len(text) < 6):
        raise PictureError(400, f"{name}={text[:20]!r} is no number of pixels")
    return int(text)


def _endless(media_type: str) -> Response:
    """What tells a stream's headers: it has no length."""
    response = Response(media_type=media_type, headers=_NO_STORE)
    del response.headers["content-length"]
    return response


def _refused(error: PictureError) -> Response:
    again = {} if error.again_s is None else {"Retry-After": str(math.ceil(error.again_s))}
    return PlainTextResponse(str(error), status_code=error.status, headers=_NO_STORE | again)
