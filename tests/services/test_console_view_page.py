"""The page of one view: its stream, which shows one view and nothing else, and who may frame it."""

import asyncio
import struct

import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from robomesh.schemas.robomesh_pb2 import ControllerState, Description, ToPage
from services.console.http import view_page
from tests.services.http_refusals import read_refusal
from tests.services.test_console import console, get, page
from tests.services.test_console_pictures import rendered, rendering, unwatched

__all__ = ["page"]  # a fixture
LIVE = "/view/s/r/front/live"
LISTED = "https://intranet.plant"


class LiveView:
    """A reader of a view's stream: what it got, by topic, and the greetings."""

    def __init__(self, reader, writer):
        self._reader, self._writer = reader, writer
        self._body = b""
        self.samples, self.greetings = {}, []

    def close(self):
        self._writer.close()

    async def until(self, condition, timeout_s=40.0):
        async with asyncio.timeout(timeout_s):
            while not condition():
                await self._read()

    async def _read(self):
        size = int(await self._reader.readline(), 16)
        assert size, "the stream ended"
        self._body += (await self._reader.readexactly(size + 2))[:-2]
        while len(self._body) >= 4:
            (length,) = struct.unpack_from(">I", self._body)
            if len(self._body) < 4 + length:
                break
            message = ToPage.FromString(self._body[4 : 4 + length])
            self._body = self._body[4 + length :]
            if message.WhichOneof("message") == "hello":
                self.greetings.append(message.hello)
            else:
                assert message.WhichOneof("message") == "sample"
                self.samples[message.sample.key] = message.sample


async def live_view(address, path=LIVE, **headers):
    """Open a view's stream; return its status and its reader."""
    host, port = address.split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    lines = "".join(f"{name}: {value}\r\n" for name, value in {"Host": address, **headers}.items())
    writer.write(f"GET {path} HTTP/1.1\r\n{lines}\r\n".encode())
    head = (await reader.readuntil(b"\r\n\r\n")).decode()
    return int(head.split()[1]), LiveView(reader, writer)


def state(**more):
    said = ControllerState(
        activity=ControllerState.IDLE, link=ControllerState.UP, link_text="10.0.0.7", **more
    )
    said.stop.sent = True
    said.stop.by = "li.s"
    said.timestamp.GetCurrentTime()
    return said


async def test_the_stream_has_the_picture_and_the_state_without_names_and_texts(mesh, page):
    async with rendered(mesh, page) as (address, renderer), console(mesh, page) as (_, robot):
        controllers = robot.declare_publisher("s", "r", "controller")
        described = Description(simulated=True, urdf="<robot/>")
        described_by = robot.declare_publisher("s", "r", "description")
        status, view = await live_view(address)
        assert status == 200

        def whole():
            controllers.put(state(fault="E42: axis 3"))
            described_by.put(described)
            return len(view.samples) == 3 and len(view.greetings) > 1

        await view.until(whole)
        picture = CompressedImage.FromString(view.samples["robomesh/s/r/image/front"].payload)
        assert picture.data[:2] == b"\xff\xd8"
        assert view.samples["robomesh/s/r/image/front"].age_s < 40.0
        shown = ControllerState.FromString(view.samples["robomesh/s/r/controller"].payload)
        assert (shown.activity, shown.stop.sent) == (ControllerState.IDLE, True)
        assert shown.fault
        assert "E42" not in shown.fault
        assert shown.stop.by == shown.link_text == ""
        told = Description.FromString(view.samples["robomesh/s/r/description"].payload)
        assert told == Description(simulated=True)
        assert all(hello.connected and not hello.operator for hello in view.greetings)
        view.close()
        await unwatched(renderer.images)


async def test_a_stream_whose_pictures_end_goes_on_so_that_the_page_says_so(mesh, page, monkeypatch):
    monkeypatch.setattr(view_page, "_GREETS_EACH_S", 0.05)

    async with rendered(mesh, page) as (address, renderer):
        _, view = await live_view(address)
        await view.until(lambda: view.samples)
        renderer.playing.cancel()
        last = len(view.greetings)
        await view.until(lambda: len(view.greetings) > last + 5)
        view.close()


@pytest.mark.parametrize(
    ("path", "status", "code"),
    [
        ("/view/s/r/back/live", 404, "view.unknown"),
        ("/view/S!/r/front/live", 404, "request.invalid"),
        ("/view/s/r/front/live?quality=5", 400, "view.parameter"),
        ("/view/s/r/front/live/more", 404, "http.no_path"),
    ],
)
async def test_a_missing_view_is_refused_with_its_code(mesh, page, path, status, code):
    async with console(mesh, page) as (address, other), rendering(other):
        answered, headers, body = await get(address, path)
        assert (answered, read_refusal(headers, body).code) == (status, code)


@pytest.mark.parametrize("embed", [(), (LISTED, "http://10.0.0.9:8000")])
async def test_only_the_page_of_a_view_can_be_in_a_frame_and_only_of_listed_origins(mesh, page, embed):
    async with console(mesh, page, embed=embed) as (address, _):
        framed = {}
        for path in (
            "/view/s/r/front",
            "/",
            "/view/..%2Findex.html",
            "/view/s/r/front/../../../../index.html",
            "/view/s/r/front%2F..%2F..%2F..%2F..%2Findex.html",
            "/view//../index.html",
            "/view/s/r/front/",
            "/VIEW/s/r/front",
            "/view/s/r/front/live",
            "/view.html",
            "/image/..%2Findex.html",
            "/video/s/r/front.mp4",
        ):
            _, headers, body = await get(address, path)
            policy = dict(rule.split(" ", 1) for rule in headers["content-security-policy"].split("; "))
            framed[path] = policy["frame-ancestors"]
            assert ("x-frame-options" in headers) == (framed[path] == "'none'"), path
            if b"<title>page</title>" in body:
                assert framed[path] == "'none'", path
        others = set(framed.values()) if not embed else {framed.pop("/view/s/r/front"), *framed.values()}
        assert others == ({"'none'"} if not embed else {" ".join(embed), "'none'"})
        assert set(framed.values()) == {"'none'"}
