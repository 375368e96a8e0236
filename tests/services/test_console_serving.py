"""Writes to pages: shared bytes in one write; the newest samples for a slow page."""

import asyncio
import time
from types import SimpleNamespace

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from robomesh.contract.header import Header
from robomesh.contract.keys import parse_key
from robomesh.publications.subscription import Sample
from robomesh.schemas.robomesh_pb2 import FromPage, ToPage
from services.console.websocket.framing import SampleBatch, batches, frame, state_frame
from services.console.websocket.page_connection import PageConnection
from services.console.websocket.write_scheduler import WriteScheduler

KEY, VIDEO = "robomesh/s/r/joints", "robomesh/s/r/video/top"
DELTA = b"\0\0\0\1\x41\x9a\x01"


def sample(number, *, key=KEY, payload=b"state", received=None):
    received = time.monotonic() if received is None else received
    return Sample(key, parse_key(key), payload, Header(1, number, 0), True, received)


def numbers(frames):
    """Return the numbers of the samples in WebSocket frames of up to 64 KiB."""
    found = []
    while frames:
        assert frames[0] == 0x82  # binary, whole
        length, at = frames[1], 2
        if length == 126:
            length, at = int.from_bytes(frames[2:4], "big"), 4
        message = ToPage.FromString(frames[at : at + length])
        if message.WhichOneof("message") == "sample":
            found.append(int.from_bytes(message.sample.attachment[8:16], "little"))
        frames = frames[at + length :]
    return found


class SharedSubscriptions:
    """A single subscription."""

    def __init__(self):
        self.scheduler, self.sinks = WriteScheduler(), []

    def __contains__(self, expression):
        return True

    def join(self, _, sink):
        self.sinks.append(sink)

    def leave(self, _, sink):
        self.sinks.remove(sink)

    async def give(self, *samples):
        for moment in batches(samples):
            for sink in self.sinks:
                sink(moment)
        await self.scheduler.wait_for_round()


class WebSocketTransport:
    """A transport that can refuse data."""

    def __init__(self):
        self.ready, self.written, self.on_ready = True, [], None

    def write(self, frames):
        self.written.append(frames)

    def spend(self, cost):
        pass

    def came(self):
        came, self.written = b"".join(self.written), []
        return numbers(came)


class Socket:
    """A WebSocket of a page that watches one key, and then only reads."""

    def __init__(self, line, key=KEY):
        self.key = key
        self.scope = {"extensions": {"robomesh.line": {"line": line}}}
        self.watched = False

    async def receive(self):
        if self.watched:
            await asyncio.Event().wait()
        self.watched = True
        watch = FromPage(watch=FromPage.Watch(key=self.key))
        return {"type": "websocket.receive", "bytes": watch.SerializeToString()}


async def test_a_fast_page_gets_all_in_one_write_and_a_slow_one_the_newest(monkeypatch):
    monkeypatch.setattr(
        "services.console.websocket.framing._SAME_AGE_S", 60.0
    )  # a round may be long on a busy machine

    feeds, lines = (
        SharedSubscriptions(),
        [WebSocketTransport(), WebSocketTransport(), WebSocketTransport()],
    )
    browsers = [
        PageConnection(None, feeds, None, greet=lambda _: ToPage(hello=ToPage.Hello()), site="s")
        for _ in lines
    ]
    serving = [
        asyncio.create_task(each.run(Socket(line))) for each, line in zip(browsers, lines, strict=True)
    ]
    while len(feeds.sinks) < len(lines) or not all(line.written for line in lines):
        await asyncio.sleep(0)
    quick, other, slow = lines
    assert [line.came() for line in lines] == [[], [], []]  # greeted
    slow.ready = False
    long_ago = time.monotonic() - 1.0
    await feeds.give(*(sample(number, received=long_ago) for number in range(1, 4)))
    assert len(quick.written) == 1
    assert quick.written[0] is other.written[0]
    assert quick.came() == [1, 2, 3]
    await feeds.give(*(sample(number, received=long_ago) for number in range(4, 10)))
    await feeds.give(sample(10))
    slow.ready = True
    slow.on_ready()
    await feeds.give(sample(11))
    assert slow.came() == [10, 11]
    await feeds.give(sample(12), sample(13))
    assert slow.came() == [12, 13]
    assert [browser.offered for browser in browsers] == [13, 13, 13]
    assert [browser.sent for browser in browsers] == [13, 13, 4]
    for task in serving:
        task.cancel()
    await asyncio.gather(*serving, return_exceptions=True)
    assert not feeds.sinks


class Asked:
    """A session that only gets requests."""

    def __init__(self):
        self.asked = []

    async def ask(self, key, _):
        self.asked.append(key)


async def test_a_blocked_page_requests_no_key_frames():
    feeds, line, session = SharedSubscriptions(), WebSocketTransport(), Asked()
    browser = PageConnection(session, feeds, None, greet=lambda _: ToPage(), site="s", own_name="li")
    serving = asyncio.create_task(browser.run(Socket(line, VIDEO)))
    while not feeds.sinks:
        await asyncio.sleep(0)
    line.ready = False
    delta = CompressedVideo(data=DELTA).SerializeToString()
    await feeds.give(sample(1, key=VIDEO, payload=delta))
    assert session.asked == []
    line.ready = True
    await feeds.give(sample(2, key=VIDEO, payload=delta))
    assert session.asked == [f"{VIDEO}/keyframe/li"]
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)


def test_encoded_bytes_are_shared_until_the_age_is_updated(monkeypatch):
    clock = SimpleNamespace(now=102.0, monotonic=lambda: clock.now)
    monkeypatch.setattr("services.console.websocket.framing.time", clock)
    moment = SampleBatch([sample(1, received=100.0)])
    first = moment.frames()
    assert moment.frames() is first
    clock.now = 103.0
    ages = [ToPage.FromString(each[2:]).sample.age_s for each in (first, moment.frames())]
    assert ages == [2.0, 3.0]


def test_a_write_is_small_and_in_order():
    samples = [sample(number, payload=bytes(1000)) for number in range(20)]
    pieces = list(batches(samples))
    assert [each for piece in pieces for each in piece.samples] == samples
    assert max(len(piece.frames()) for piece in pieces) < 5000
    assert len(pieces) == 5
    assert list(batches([])) == []


async def test_an_error_in_one_page_does_not_delay_the_others(caplog):
    scheduler, served = WriteScheduler(), []
    scheduler.schedule(lambda: 1 / 0)
    scheduler.schedule(lambda: served.append(1))
    await scheduler.wait_for_round()
    assert served == [1]
    await scheduler.wait_for_round()
    assert "could not be served" in caplog.text


def test_a_message_of_any_length_is_one_frame():
    for length in (0, 125, 126, 65535, 65536):
        message = bytes(length)
        assert frame(message).endswith(message)
        assert len(frame(message)) - length == (2 if length < 126 else 4 if length < 65536 else 10)
    assert numbers(state_frame(sample(5)) + state_frame(sample(6))) == [5, 6]
