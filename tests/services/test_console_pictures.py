"""Pictures over HTTP: MJPEG, MP4 and stills of a robot, with a simulated renderer."""

import asyncio
import io
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from robomesh import reason_codes as codes
from robomesh.contract.header import Header
from robomesh.contract.keys import Key
from robomesh.errors import QuotaError, RefusedError
from robomesh.publications.subscription import Sample
from robomesh.schemas.robomesh_pb2 import KeyFrameAnswer, ViewAnswer, ViewRequest
from services.console.http import pictures
from services.console.http.streaming import Streamed
from services.console.websocket.framing import SampleBatch
from services.console.websocket.send_queues import NewestQueue
from tests.conftest import run
from tests.services.http_refusals import read_refusal
from tests.services.test_console import console, get, page  # noqa: F401

WIDTH, HEIGHT = 160, 90


def jpeg(shade):
    codec = av.CodecContext.create("mjpeg", "w")
    codec.width, codec.height, codec.pix_fmt, codec.time_base = WIDTH, HEIGHT, "yuvj420p", Fraction(1, 5)
    picture = np.full((HEIGHT, WIDTH, 3), shade, dtype=np.uint8)
    frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="yuvj420p")
    (packet,) = codec.encode(frame)
    return bytes(packet)


class Video:
    """Encoder of shades as H.264, one packet per picture."""

    def __init__(self):
        self._codec = av.CodecContext.create("libx264", "w")
        self._codec.width, self._codec.height, self._codec.pix_fmt = WIDTH, HEIGHT + 6, "yuv420p"
        self._codec.options = {"preset": "superfast", "tune": "zerolatency", "x264-params": "keyint=10"}

    def packet(self, shade):
        picture = np.full((HEIGHT + 6, WIDTH, 3), shade, dtype=np.uint8)
        (packet,) = self._codec.encode(av.VideoFrame.from_ndarray(picture, format="rgb24"))
        return CompressedVideo(data=bytes(packet), format="h264"), packet.is_keyframe


@dataclass
class Rendering:
    """A simulated renderer's publishers, its task, and the key frames that were asked of it."""

    images: list
    videos: list
    playing: asyncio.Task
    key_frames: list


@asynccontextmanager
async def rendering(other):
    """Run a simulated renderer in a session: its views, and 20 pictures a second while watched."""
    key_frames = []

    async def views(request):
        if request.message.of != "front":
            raise RefusedError(codes.VIEW_UNKNOWN(view=request.message.of, views="front"))
        if request.message.width == 640:
            raise QuotaError("li has had its views", again_s=30.5)
        if request.message.width > 1920:
            raise RefusedError(
                codes.VIEW_INVALID(codes.VIEW_SIZE(width=2000, height=90, least=64, most=1920))
            )
        if request.message == ViewRequest(of="front"):
            return ViewAnswer(topic="video/front", image="image/front", width=160, height=90, fps=20)
        if request.message.width == 1920:
            raise RefusedError(codes.VIEW_NO_ROOM(codes.VIEWS_TOO_MANY(count=1, most=1)))
        return ViewAnswer(topic="video/free-1", image="image/free-1", width=160, height=90, fps=20)

    async def key_frame(request):
        key_frames.append(request.chunk)
        return KeyFrameAnswer()

    other.answer("s", "r", "views/*", views)
    other.answer("s", "r", "video/*/keyframe/*", key_frame)
    images = [other.declare_publisher("s", "r", f"image/{name}") for name in ("front", "free-1")]
    videos = [other.declare_publisher("s", "r", f"video/{name}") for name in ("front", "free-1")]

    async def play():
        video, shade = Video(), 0
        while True:
            shade = (shade + 5) % 250
            message, key = video.packet(shade)
            for publisher in videos:
                publisher.put(message, key_frame=key)
            for publisher in images:
                publisher.put(CompressedImage(data=jpeg(shade), format="jpeg"))
            await asyncio.sleep(0.05)

    playing = asyncio.create_task(play())
    try:
        yield Rendering(images, videos, playing, key_frames)
    finally:
        playing.cancel()
        await asyncio.gather(playing, return_exceptions=True)


@asynccontextmanager
async def rendered(mesh, page, **settings):  # noqa: F811
    """Yield a console's address and a simulated renderer."""
    async with console(mesh, page, **settings) as (address, other), rendering(other) as renderer:
        yield address, renderer


async def stream(address, path, *, until_bytes, method="GET", timeout_s=40.0):
    """Return status, headers, the beginning of a stream's body, and functions to read on and to end it."""
    host, port = address.split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    text = f"{method} {path} HTTP/1.1\r\nHost: {address}\r\nAccept-Encoding: gzip\r\n\r\n"
    writer.write(text.encode())
    async with asyncio.timeout(timeout_s):
        head = (await reader.readuntil(b"\r\n\r\n")).decode().lower()
        body = await pieces_of(reader, until_bytes)
    return head, body, (reader, writer)


async def pieces_of(reader, until_bytes):
    """Return chunks of a body until it is this long, or ends."""
    body = b""
    while len(body) < until_bytes and (size := int(await reader.readline(), 16)):
        body += (await reader.readexactly(size + 2))[:-2]
    return body


async def unwatched(publishers, timeout_s=40.0):
    async with asyncio.timeout(timeout_s):
        while any(publisher.watched for publisher in publishers):
            await asyncio.sleep(0.02)


async def test_mjpeg_is_one_picture_after_another_until_its_reader_goes(mesh, page):  # noqa: F811
    async with rendered(mesh, page) as (address, renderer):
        head, body, (_, writer) = await stream(address, "/video/s/r/front.mjpeg", until_bytes=12_000)
        assert "200 ok" in head
        assert "multipart/x-mixed-replace; boundary=picture" in head
        assert "content-encoding" not in head
        with av.open(io.BytesIO(body), format="mpjpeg") as container:
            shades = []
            with suppress(av.FFmpegError):  # the last one may be cut
                shades += [frame.to_ndarray(format="gray").mean() for frame in container.decode(video=0)]
        assert len({round(shade) for shade in shades}) > 2
        # The shared view: nothing is rendered for this reader only.
        assert [publisher.watched for publisher in renderer.images] == [True, False]
        writer.close()
        await unwatched(renderer.images)


async def test_an_mjpeg_whose_pictures_end_says_that_it_is_stale_and_then_ends(mesh, page, monkeypatch):  # noqa: F811
    monkeypatch.setattr(pictures, "_STALE_AFTER_S", 0.25)
    monkeypatch.setattr(pictures, "_SILENT_S", 0.75)

    async with rendered(mesh, page) as (address, renderer):
        _, body, (reader, writer) = await stream(address, "/video/s/r/front.mjpeg", until_bytes=1_000)
        assert body.count(b"--picture\r\n") > body.count(pictures._STALE)
        renderer.playing.cancel()
        async with asyncio.timeout(40):
            body = await pieces_of(reader, 1_000_000)
        assert body.count(pictures._STALE) >= 2
        assert body.endswith(pictures._STALE + b"\r\n")
        writer.close()


async def test_a_head_of_a_stream_ends_with_its_headers(mesh, page):  # noqa: F811
    async with rendered(mesh, page) as (address, _):
        for ending, kind in (("mjpeg", "multipart/x-mixed-replace"), ("mp4", "video/mp4")):
            head, _, (reader, writer) = await stream(
                address, f"/video/s/r/front.{ending}", until_bytes=0, method="HEAD"
            )
            assert "200 ok" in head
            assert kind in head
            assert "content-length" not in head
            # The connection accepts another request.
            writer.write(f"GET /none HTTP/1.1\r\nHost: {address}\r\n\r\n".encode())
            async with asyncio.timeout(40):
                assert b"404" in await reader.readline()
            writer.close()


def test_a_reader_that_takes_nothing_loses_its_stream():
    ended = []

    async def pieces():
        while True:
            yield b"picture"

    async def send(_):
        await asyncio.get_running_loop().create_future()

    async def end():
        ended.append(True)

    run(Streamed(pieces(), {}, within_s=0.05, on_end=end).stream_response(send))
    assert ended


async def test_mp4_plays_while_it_happens_until_its_reader_goes(mesh, page):  # noqa: F811
    async with rendered(mesh, page) as (address, renderer):
        head, body, (_, writer) = await stream(address, "/video/s/r/front.mp4", until_bytes=6_000)
        assert "200 ok" in head
        assert "video/mp4" in head
        shades = []
        with av.open(io.BytesIO(body), format="mp4") as container, suppress(av.FFmpegError):
            shades += [frame.to_ndarray(format="gray").mean() for frame in container.decode(video=0)]
        assert len({round(shade) for shade in shades}) > 5
        writer.close()
        await unwatched(renderer.videos)


async def test_every_mp4_asks_for_a_key_frame_also_one_that_joins_another(mesh, page):  # noqa: F811
    async with rendered(mesh, page) as (address, renderer):
        writers = []
        for readers in (1, 2):
            _, _, (_, writer) = await stream(address, "/video/s/r/front.mp4", until_bytes=1_000)
            writers.append(writer)
            async with asyncio.timeout(40):
                while len(renderer.key_frames) < readers:
                    await asyncio.sleep(0.02)
        for writer in writers:
            writer.close()
        await unwatched(renderer.videos)


async def test_a_still_is_the_newest_picture_as_jpeg_or_png(mesh, page):  # noqa: F811
    async with rendered(mesh, page) as (address, renderer):
        for ending, kind in (("jpg", "image/jpeg"), ("png", "image/png")):
            status, headers, body = await get(address, f"/image/s/r/front.{ending}")
            assert (status, headers["content-type"]) == (200, kind)
            with av.open(io.BytesIO(body)) as container:
                frame = next(container.decode(video=0))
            assert (frame.width, frame.height) == (WIDTH, HEIGHT)
        await unwatched(renderer.images)


@pytest.mark.parametrize(
    ("path", "status", "code", "words"),
    [
        ("image/s/r/back.jpg", 404, "view.unknown", "no view 'back'; there are front"),
        ("video/s/r/back.mjpeg", 404, "view.unknown", "no view 'back'; there are front"),
        ("video/s/r/back.mp4", 404, "view.unknown", "no view 'back'; there are front"),
        ("image/s/r/front.jpg?width=2000&height=1000", 400, "view.invalid", "even numbers from 64 to 1920"),
        ("image/s/r/front.jpg?width=wide", 400, "view.not_pixels", "width='wide' is not a number of pixels"),
        ("image/s/r/front.jpg?width=1920", 503, "view.no_room", "no capacity: 1 requested views exist"),
        ("image/s/r/front.jpg?width=640", 429, "other", "li has had its views"),
        ("video/s/r/front.mp4?fps=fast", 400, "view.not_a_number", "fps='fast' is not a number"),
        ("video/s/r/front.mp4?quality=5", 400, "view.parameter", "width, height and fps"),
        ("image/S!/r/front.jpg", 404, "request.invalid", "S!"),
    ],
)
async def test_a_missing_picture_is_refused_with_code_and_sentence(mesh, page, path, status, code, words):  # noqa: F811
    async with rendered(mesh, page) as (address, _):
        answered, headers, body = await get(address, f"/{path}")
        assert answered == status
        assert headers.get("retry-after") == ("31" if status == 429 else None)
        assert words in body.decode()
        assert read_refusal(headers, body).code == code


async def test_without_a_renderer_the_answer_says_so(mesh, page, monkeypatch):  # noqa: F811
    monkeypatch.setattr("services.console.common.requested_views.TIMEOUT_S", 0.3)

    async with console(mesh, page) as (address, _):
        status, headers, body = await get(address, "/image/s/r/front.jpg")
        assert status == 503
        reason = read_refusal(headers, body)
        assert (reason.code, reason.values["robot"]) == ("view.no_renderer", "s/r")
        assert "no renderer answers for s/r" in body.decode()


@pytest.mark.parametrize("most", ["_MOST_STREAMS", "_MOST_OF_ONE"])
async def test_more_streams_than_there_is_room_for_are_refused_and_room_comes_back(
    mesh,
    page,  # noqa: F811
    monkeypatch,
    most,
):
    monkeypatch.setattr(pictures, most, 1)

    async with rendered(mesh, page) as (address, renderer):
        _, _, (_, writer) = await stream(address, "/video/s/r/front.mjpeg", until_bytes=100)
        status, headers, body = await get(address, "/video/s/r/front.mjpeg")
        assert status == 503
        suffix = "_of" if most == "_MOST_OF_ONE" else ""
        assert read_refusal(headers, body).code == f"view.too_many_streams{suffix}"
        writer.close()
        await unwatched(renderer.images)
        head, _, (_, writer) = await stream(address, "/video/s/r/front.mjpeg", until_bytes=100)
        assert "200 ok" in head
        writer.close()
        await unwatched(renderer.images)


async def test_a_slow_reader_gets_the_newest_picture_next():
    class SharedSubscriptions:
        def join(self, key, sink):
            self.sink = sink

    feeds = SharedSubscriptions()
    watch = pictures.NewestSampleReader(feeds, "robomesh/s/r/image/front", NewestQueue())
    for number in range(100):
        key = Key("s", "r", "image/front")
        sample = Sample(str(key), key, b"", Header(1, number, 0), True, 0.0)
        feeds.sink(SampleBatch([sample]))
    assert (await watch.next(1.0)).header.sequence == 99
    assert await watch.next(0.01) is None
