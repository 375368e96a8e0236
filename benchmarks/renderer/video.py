"""Video: unit on the controller's socket -> picture drawn in Chromium; the cost of a viewer; a slow link.

A controller's unit carries a counter in its last joint while the arm swings. Each picture's header names the
unit that it shows (by the gateway's time stamp), also in the browser: hooks in the page record its decoding
and drawing, and do not replace them. All clocks are this machine's. A picture counts as drawn when the page
hands it to its canvas; the display's own refresh comes after. Viewers are clients that speak the page's
protocol; the slow one reads at a limited bit rate through a small receive buffer.

    ./dev run python -m benchmarks video [--seconds 30] [--viewers 64] [--link 2e6] [--json]

Target: p50 60 ms at 30 pictures a second; at most 0.1 % of a core for each further viewer; the slow viewer's
own age p99 under 0.5 s, and the others' the same as without it.
"""

import asyncio
import contextlib
import math
import multiprocessing
import socket
import struct
import time
from typing import Annotated, Any

from playwright.async_api import async_playwright
from typer import Option
from websockets.asyncio.client import connect

from benchmarks.harness.processes import cpu_s, process
from benchmarks.harness.sites import Site, robot, running_site
from benchmarks.harness.turns import summary
from benchmarks.harness.unit_controllers import wait
from benchmarks.page.browser import CHROMIUM
from robomesh.schemas.robomesh_pb2 import FromPage, ToPage
from robomesh.wire.session import SessionSettings, open_session
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from tests.ports import free_port
from web import build_page

RATE_HZ = 100
# The counter, in steps that the protocol's text carries exactly: 300 degrees of the last joint, then wraps.
STEP_DEG, STEPS = 0.01, 30_000
KEY = "robomesh/bench/arm/video/free"
WARM_S = 6.0
OTHERS = 8

# Records the source time of the current message, and when its picture is drawn.
NOTING = """
const Socket = WebSocket, decode = VideoDecoder.prototype.decode, sources = new Map();
let source = 0n;
window.noted = [];
window.WebSocket = class extends Socket {
  constructor(...rest) {
    super(...rest);
    this.addEventListener("message", ({ data }) => {
      const bytes = new Uint8Array(data);
      for (let i = 0; i + 26 < Math.min(bytes.length, 200); i++) {
        if (bytes[i] === 0x12 && bytes[i + 1] === 24) {
          source = new DataView(data).getBigInt64(i + 18, true);
          return;
        }
      }
    });
  }
};
VideoDecoder.prototype.decode = function (chunk) {
  sources.set(chunk.timestamp, source);
  return decode.call(this, chunk);
};
const draw = CanvasRenderingContext2D.prototype.drawImage;
CanvasRenderingContext2D.prototype.drawImage = function (frame, ...rest) {
  draw.call(this, frame, ...rest);
  if (frame instanceof VideoFrame) {
    window.noted.push([String(sources.get(frame.timestamp)), performance.timeOrigin + performance.now()]);
  }
};
"""


def measure(
    seconds: Annotated[float, Option(help="of each part")] = 30.0,
    viewers: int = 64,
    link: Annotated[float, Option(help="of the slow viewer [bit/s]")] = 2e6,
) -> dict[str, Any]:
    """Measure all figures in one run."""
    build_page.build()
    units = int((4 * (seconds + WARM_S) + 60) * RATE_HZ)
    written, controller = multiprocessing.RawArray("q", STEPS), free_port()
    services = ("gateway", "kinematics", "renderer", "console")
    with (
        process(swinging, controller, written, units),
        running_site(*services, tables=robot("arm", controller)) as site,
    ):
        return asyncio.run(_measure(site, written, seconds, viewers, link))


async def _measure(
    site: Site, written: Any, seconds: float, viewers: int, bits_per_s: float
) -> dict[str, Any]:
    address, result = site.console, dict[str, Any]()
    async with Viewer(address):
        await asyncio.sleep(WARM_S)  # shaders, meshes
    result["unit_to_drawn_ms"] = await drawn(site.endpoint, address, written, seconds)
    result["viewers"] = await cost(address, site.processes["console"].pid, seconds, viewers)
    result["slow_link"] = await slow_link(address, seconds, bits_per_s)
    return result


async def drawn(endpoint: str, address: str, written: Any, seconds: float) -> dict[str, Any]:
    """Measure from the unit on the socket to the picture drawn, in a Chromium that shows only this view."""
    sources: dict[int, int] = {}
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
        joints = session.subscribe("robomesh/bench/arm/joints", newest=10_000, history=False)

        async def note() -> None:
            async for sample in joints:
                angle = math.degrees(sample.message().joints[-1].position)  # type: ignore[attr-defined]
                sources[sample.header.source_time_ns] = round((angle + 150.0) / STEP_DEG)

        noting = asyncio.create_task(note())
        async with async_playwright() as playwright:
            browser = await playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
            page = await browser.new_page(viewport={"width": 1280, "height": 860})
            await page.add_init_script(NOTING)
            await page.goto(f"http://{address}/#/wall/bench/arm/free")
            await page.wait_for_selector('canvas[data-drawn="true"]', timeout=60_000)
            await asyncio.sleep(WARM_S)
            await page.evaluate("() => { window.noted = [] }")
            await asyncio.sleep(seconds)
            noted = await page.evaluate("() => window.noted")
            await browser.close()
        noting.cancel()
    offset = time.time_ns() - time.monotonic_ns()
    seen: dict[int, float] = {}
    for source, at_ms in noted:
        seen.setdefault(int(source), at_ms)
    late = [
        int(at_ms * 1e6) - offset - written[sources[source]]
        for source, at_ms in seen.items()
        if source in sources
    ]
    return {**summary(late), "pictures_per_s": len(noted) / seconds}


async def cost(address: str, console: int, seconds: float, viewers: int) -> dict[str, Any]:
    """Return the console's CPU use for one viewer and for many of the same view [share of a core]."""
    shares = []
    for count in (1, 1 + viewers):
        ages = multiprocessing.Queue()
        with process(watching, address, count, WARM_S + seconds, ages):
            await asyncio.sleep(WARM_S)
            begun, used = time.monotonic(), cpu_s(console)
            await asyncio.sleep(seconds)
            shares.append((cpu_s(console) - used) / (time.monotonic() - begun))
            seen = await asyncio.to_thread(ages.get)
    return {
        "count": viewers,
        "percent_of_a_core_each": 100 * (shares[1] - shares[0]) / viewers,
        "percent_for_one": 100 * shares[0],
        "age_ms": summary(seen["ages_ns"]),
        "frames_per_s_each": seen["frames"] / (viewers + 1) / (WARM_S + seconds),
    }


async def slow_link(address: str, seconds: float, bits_per_s: float) -> dict[str, Any]:
    """Return the ages of some viewers' pictures, without and with one on a slow link, and that one's ages."""
    result: dict[str, Any] = {"bits_per_s": bits_per_s}
    for name, slow in (("others_alone_ms", False), ("others_beside_it_ms", True)):
        ages = multiprocessing.Queue()
        with process(watching, address, OTHERS, WARM_S + seconds, ages):
            if slow:
                result["its_own_ms"], result["its_steps"] = await asyncio.to_thread(
                    read_slowly, address, WARM_S + seconds, bits_per_s
                )
            seen = await asyncio.to_thread(ages.get)
        result[name] = summary(seen["ages_ns"])
        result["view_bits_per_s"] = 8 * seen["bytes"] / OTHERS / (WARM_S + seconds)
    return result


class Viewer:
    """A page's WebSocket that watches the view."""

    def __init__(self, address: str) -> None:
        self._connecting = connect(f"ws://{address}/mesh", origin=f"http://{address}", compression=None)

    async def __aenter__(self) -> Any:
        socket_ = await self._connecting.__aenter__()
        await socket_.send(FromPage(watch=FromPage.Watch(key=KEY)).SerializeToString())
        return socket_

    async def __aexit__(self, *error: object) -> None:
        await self._connecting.__aexit__(*error)


def watching(address: str, count: int, seconds: float, ages: Any) -> None:
    """Run a number of viewers in a separate process; they decode no pictures."""

    async def view(until: float, seen: dict[str, Any]) -> None:
        async with Viewer(address) as socket_:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(until - time.monotonic()):
                    while True:
                        take(await socket_.recv(), time.monotonic() > until - seconds + WARM_S, seen)

    async def all_of_them() -> None:
        seen: dict[str, Any] = {"ages_ns": [], "frames": 0, "bytes": 0}
        until = time.monotonic() + seconds
        await asyncio.gather(*(view(until, seen) for _ in range(count)))
        ages.put(seen)

    asyncio.run(all_of_them())


def take(message: bytes, warm: bool, seen: dict[str, Any]) -> int | None:
    """Record a picture's age, and its step if it has one."""
    sample = ToPage.FromString(message).sample
    if sample.key != KEY:
        return None
    seen["frames"] += 1
    seen["bytes"] += len(message)
    if warm and sample.live:
        seen["ages_ns"].append(time.time_ns() - struct.unpack_from("<q", sample.attachment, 16)[0])
    return sample.step


def read_slowly(address: str, seconds: float, bits_per_s: float) -> tuple[dict[str, Any], list[int]]:
    """Watch as a page with a limited bit rate and small buffers."""
    host, port = address.split(":")
    seen: dict[str, Any] = {"ages_ns": [], "frames": 0, "bytes": 0}
    steps: list[int] = []
    watch = FromPage(watch=FromPage.Watch(key=KEY)).SerializeToString()
    hello = (
        f"GET /mesh HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    with socket.socket() as line:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16 * 1024)
        line.connect((host, int(port)))
        line.sendall(hello.encode())
        buffer, begun, read = b"", time.monotonic(), 0
        in_head = True
        while (now := time.monotonic() - begun) < seconds:
            allowed = int(now * bits_per_s / 8) - read
            if allowed < 1024:
                time.sleep(0.004)
                continue
            piece = line.recv(min(allowed, 4096))
            read += len(piece)
            # Unused time on the line is lost: it does not add to the later rate.
            read = max(read, int(now * bits_per_s / 8) - 8192)
            buffer += piece
            if in_head and b"\r\n\r\n" in buffer:
                in_head, buffer = False, buffer.partition(b"\r\n\r\n")[2]
                line.sendall(bytes([0x82, 0x80 | len(watch), 0, 0, 0, 0]) + watch)
            while not in_head and (frame := next_frame(buffer)) is not None:
                payload, buffer = frame
                step = take(payload, now > WARM_S, seen) if payload else None
                if step is not None and (not steps or steps[-1] != step):
                    steps.append(step)
    return summary(seen["ages_ns"]), steps


def next_frame(buffer: bytes) -> tuple[bytes, bytes] | None:
    """Return the first WebSocket frame's payload (empty: a ping) and the rest; None if it is incomplete."""
    if len(buffer) < 2:
        return None
    length, at = buffer[1] & 0x7F, 2
    if length >= 126:
        width = 2 if length == 126 else 8
        if len(buffer) < 2 + width:
            return None
        length, at = int.from_bytes(buffer[2 : 2 + width], "big"), 2 + width
    if len(buffer) < at + length:
        return None
    payload = buffer[at : at + length] if buffer[0] & 0x0F == 2 else b""
    return payload, buffer[at + length :]


def swinging(port: int, written: Any, units: int) -> None:
    """Run a controller with a swinging arm; its last joint is the counter."""
    names = joints_of(load("pt600"))
    with socket.create_server(("127.0.0.1", port)) as server:
        client, _ = server.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        begun = time.monotonic()
        for k in range(units):
            wait(begun + k / RATE_HZ)
            swing = math.sin(2 * math.pi * 0.3 * k / RATE_HZ)
            others = [60 * swing, 80 + 25 * swing, -80 + 30 * swing, 40 * swing][: len(names) - 1]
            step = k % STEPS
            values = ";".join(f"{value:.2f}" for value in (*others, step * STEP_DEG - 150.0))
            written[step] = time.monotonic_ns()
            with contextlib.suppress(ConnectionError):  # the gateway has ended
                client.sendall(f"1#ABSOLUTE.DEG*{values}@".encode())
