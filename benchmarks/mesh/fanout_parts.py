"""Parts common to all arms of `fanout`. Standard library only: the peers' Python runs them too.

A process prints "ready", reads when to begin and end, does its part, and prints its counts.
Every message carries the 24 bytes of the mesh's header; the last 8 are the time at which it was sent.
"""

import asyncio
import base64
import json
import os
import ssl
import struct
import sys
import time
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

ROBOTS = 10
RATE_HZ, PICTURES_HZ = 100, 30
HEADER = struct.Struct("<QQq")
# The arguments of an arm's put function: the robot's number, the header, the payload.
Put = Callable[[int, bytes, bytes], None]


class Window(NamedTuple):
    """The interval in which sent messages count [ns since the Unix epoch]."""

    begin_ns: int
    end_ns: int


def told_when() -> Window:
    """Report that this process is ready, and wait for its parent's answer."""
    print("ready", flush=True)
    return Window(*(int(word) for word in sys.stdin.readline().split()))


def payloads(folder: Path) -> tuple[bytes, list[bytes]]:
    """Return a joints message and the messages of a video's pictures; the first is a key frame."""
    data = (folder / "video").read_bytes()
    pictures, at = [], 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        pictures.append(data[at + 4 : at + 4 + length])
        at += 4 + length
    return (folder / "joints").read_bytes(), pictures


def publish(window: Window, folder: Path, put_joints: Put, put_picture: Put) -> None:
    """Publish ten robots, evenly within each 10 ms, and a picture each 33 ms; print the sent counts."""
    joints, pictures = payloads(folder)
    sent = {"joints": 0, "pictures": 0}
    began, tick, shown = time.monotonic(), 0, 0
    while (now_ns := time.time_ns()) < window.end_ns:
        counts = now_ns >= window.begin_ns
        robot = tick % ROBOTS
        put_joints(robot, HEADER.pack(robot, tick, time.time_ns()), joints)
        sent["joints"] += counts
        if shown * RATE_HZ * ROBOTS < tick * PICTURES_HZ:
            put_picture(0, HEADER.pack(ROBOTS, shown, time.time_ns()), pictures[shown % len(pictures)])
            sent["pictures"] += counts
            shown += 1
        tick += 1
        left = began + tick / (RATE_HZ * ROBOTS) - time.monotonic()
        if left > 0:
            time.sleep(left)
    print(json.dumps(sent), flush=True)


class Ages:
    """The ages of all messages that the subscribers of a process received [ns]."""

    def __init__(self) -> None:
        # Empty until the measurement begins: earlier messages do not count.
        self.window = Window(0, 0)
        self.joints, self.pictures = array("q"), array("q")
        # States that were not delivered because a newer state of the same robot replaced them.
        self.overtaken = 0

    def note(self, sent_ns: int, picture: bool) -> None:
        """Record one message."""
        if self.window.begin_ns <= sent_ns < self.window.end_ns:
            (self.pictures if picture else self.joints).append(time.time_ns() - sent_ns)

    def write(self, folder: Path) -> None:
        """Write the ages to a file for the parent."""
        (folder / f"overtaken.{os.getpid()}").write_text(str(self.overtaken))
        for name in ("joints", "pictures"):
            with (folder / f"{name}.{os.getpid()}").open("wb") as file:
                getattr(self, name).tofile(file)

    async def until_the_end(self, folder: Path) -> None:
        """Wait for the parent's answer and then for the end, on an event loop that continues to receive."""
        self.window = await asyncio.to_thread(told_when)
        await asyncio.sleep((self.window.end_ns - time.time_ns()) / 1e9 + 1.0)
        self.write(folder)


class WebSocketReader(asyncio.Protocol):
    """A WebSocket client that only reads frames, so that the measurement shows the server's cost."""

    def __init__(self, host: str, path: str, protocol: str, on_message: "Take") -> None:
        self._hello = (
            f"GET {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: {protocol or 'http'}://{host}\r\n"
            "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
        )
        self._on_message = on_message
        self._buffer, self._in_head = bytearray(), True
        self.transport: asyncio.Transport | None = None
        self.open = asyncio.get_running_loop().create_future()

    def with_protocol(self, name: str) -> "WebSocketReader":
        """Request a sub-protocol."""
        self._hello += f"Sec-WebSocket-Protocol: {name}\r\n"
        return self

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport
        self.transport.write(f"{self._hello}\r\n".encode())

    def send(self, payload: bytes, opcode: int = 2) -> None:
        """Send one message with a mask of zero bytes, which the protocol permits."""
        length = len(payload)
        size = bytes([0x80 | length]) if length < 126 else b"\xfe" + struct.pack(">H", length)
        assert self.transport is not None
        self.transport.write(bytes([0x80 | opcode]) + size + bytes(4) + payload)

    def data_received(self, data: bytes) -> None:
        self._buffer += data
        if self._in_head:
            head, found, rest = bytes(self._buffer).partition(b"\r\n\r\n")
            if not found:
                return
            if b" 101 " not in head.split(b"\r\n")[0]:
                raise SystemExit(f"the server refused the WebSocket: {head[:200]!r}")
            self._buffer, self._in_head = bytearray(rest), False
            self.open.set_result(None)
        buffer, at, end = self._buffer, 0, len(self._buffer)
        while end - at >= 2:
            opcode, length, start = buffer[at] & 0x0F, buffer[at + 1] & 0x7F, at + 2
            if length == 126 and end - at >= 4:
                length, start = (buffer[at + 2] << 8) | buffer[at + 3], at + 4
            elif length == 127 and end - at >= 10:
                length, start = int.from_bytes(buffer[at + 2 : at + 10], "big"), at + 10
            elif length >= 126:
                break
            if end < start + length:
                break
            payload, at = bytes(buffer[start : start + length]), start + length
            if opcode == 9:
                self.send(payload, 10)
            else:
                self._on_message(self, opcode, payload)
        del buffer[:at]


Take = Callable[[WebSocketReader, int, bytes], None]


async def watch_console(address: str, tls: bool, watches: list[str], count: int, folder: Path) -> None:
    """Open the pages' WebSockets with the same watches; `watches` are messages of the page's protocol."""
    ages = Ages()
    # The newest number for each page and robot.
    newest: dict[tuple[WebSocketReader, int], int] = {}

    def take(reader: WebSocketReader, opcode: int, message: bytes) -> None:
        at = message.find(b"\x12\x18", 0, 120)  # the sample's attachment: field 2, 24 bytes
        if at < 0:
            return
        publisher, number, sent_ns = HEADER.unpack_from(message, at + 2)
        picture = b"/video/" in message[:at]
        ages.note(sent_ns, picture)
        if not picture:
            before = newest.get((reader, publisher), number)
            newest[reader, publisher] = number
            if ages.window.begin_ns <= sent_ns < ages.window.end_ns:
                since_begin = (sent_ns - ages.window.begin_ns) * RATE_HZ // 10**9
                ages.overtaken += max(min(number - before - 1, since_begin), 0)

    for _ in range(count):
        reader = await connected(address, "/mesh", tls, take)
        for each in watches:
            reader.send(base64.b64decode(each))
    await ages.until_the_end(folder)


async def connected(address: str, path: str, tls: bool, take: "Take", protocol: str = "") -> WebSocketReader:
    """Return an open WebSocket."""
    host, port = address.split(":")

    def made() -> WebSocketReader:
        reader = WebSocketReader(address, path, "https" if tls else "http", take)
        return reader.with_protocol(protocol) if protocol else reader

    loop, context = asyncio.get_running_loop(), unchecked() if tls else None
    async with asyncio.timeout(20.0):
        while True:
            try:
                _, reader = await loop.create_connection(made, host, int(port), ssl=context)
            except ConnectionRefusedError:
                await asyncio.sleep(0.1)
            else:
                await reader.open
                return reader


def unchecked() -> ssl.SSLContext:
    """Return a TLS context without verification: the benchmark's own certificates prove no identity."""
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


def chosen(**roles: Callable[..., None]) -> None:
    """Run the role that the command line names, with the remaining words as arguments."""
    roles[sys.argv[1]](*sys.argv[2:])
