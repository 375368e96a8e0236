"""Pages that ask too much: they wait and are disconnected, and another page's stop waits for none of them."""

import asyncio
import gzip
from contextlib import asynccontextmanager

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode

from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session, open_session
from services.console.common import read_scheduler
from services.console.common.read_scheduler import Allowance, ReadScheduler
from services.console.websocket import shared_subscriptions, websocket_transport
from services.console.websocket.page_connection import PageConnection
from services.console.websocket.shared_subscriptions import SharedSubscriptions
from services.console.websocket.websocket_transport import WebSocketTransport
from tests.services.signing_in import Client, guarded
from tests.services.test_console import browse, console, get, page

__all__ = ["page"]  # a fixture
KEY, STOP = "robomesh/s/r/joints", "robomesh/s/r/stop"
# A page's frames in one write: nothing, a ping, part of a message, a request with an invalid key, a watch.
INVALID = schema.FromPage(ask=schema.FromPage.Ask(id=1, key="no/such key")).SerializeToString()
WATCH = schema.FromPage(watch=schema.FromPage.Watch(key=KEY)).SerializeToString()
FLOODS = {
    "empty": Frame(Opcode.BINARY, b""),
    "pings": Frame(Opcode.PING, b""),
    "pongs": Frame(Opcode.PONG, b""),
    "invalid": Frame(Opcode.BINARY, INVALID),
    "watches": Frame(Opcode.BINARY, WATCH),
}
NEVER = 1e-6  # [1/s]
MOST_FRAMES = 86  # in a piece of 512 bytes


@asynccontextmanager
async def two_pages(mesh, page, folder):
    """Yield a monitor's page, and an operator's connection for stops at a console with a gateway."""
    async with guarded(mesh, page, folder) as (li, other, _):
        zhao = Client(li.address)
        await li.sign_in("li")
        await zhao.sign_in("zhao")

        async def stop(_):
            return schema.StopAnswer(sent=True, stop_id=1)

        other.answer("s", "r", "stop", stop)
        async with zhao.browse() as flooding, li.browse("/mesh/stop") as stops:
            assert (await stops.ask(1, STOP)).ok
            yield flooding, stops, li


async def write(browser, frame, number):
    """Write frames without the client library's own pace."""
    browser.socket.transport.write(frame.serialize(mask=True) * number)


async def reason_of_close(browser):
    """Return the code of the close frame, and that of the last refusal before it."""
    found = ""
    async with asyncio.timeout(30.0):
        try:
            while True:
                answer = schema.ToPage.FromString(await browser.socket.recv()).answer
                found = answer.refusal.code if answer.id == 0 and answer.HasField("refusal") else found
        except ConnectionClosed as closed:
            return closed.rcvd.code, found


@pytest.mark.parametrize("kind", FLOODS)
async def test_a_page_that_asks_too_much_is_disconnected_with_the_reason(
    mesh, page, tmp_path, monkeypatch, kind
):
    monkeypatch.setattr(websocket_transport, "_PATIENCE_S", 0.2)

    async with two_pages(mesh, page, tmp_path) as (flooding, stops, _):
        await write(flooding, FLOODS[kind], 100_000)
        assert (await stops.ask(2, STOP)).ok
        assert await reason_of_close(flooding) == (1008, "page.asks_too_much")
        assert (await stops.ask(3, STOP)).ok


async def test_a_page_that_has_used_its_allowance_is_not_read_and_its_stop_is(
    mesh, page, tmp_path, monkeypatch
):
    monkeypatch.setattr(read_scheduler, "_PAGE_PER_S", NEVER)
    monkeypatch.setattr(read_scheduler, "_PAGE_AT_ONCE", 30.0)  # a connection takes 20

    async with two_pages(mesh, page, tmp_path) as (_, stops, li), li.browse() as own:
        await own.until(lambda: own.other)
        frames = asyncio.create_task(own.until(lambda: len(own.other) == 10_000))
        await write(own, FLOODS["invalid"], 10_000)
        for number in range(2, 30):
            assert (await stops.ask(number, STOP)).ok
        # The allowance, and what one piece overdraws.
        assert sum(each.HasField("answer") for each in own.other) < 10 + MOST_FRAMES
        async with li.browse() as another:  # only that page waits
            assert not (await another.ask(1, "no/such key")).ok
        frames.cancel()
        own.socket.transport.abort()  # its close frame is not read either


async def test_the_pages_of_an_account_share_an_allowance_and_no_other_account_waits(
    mesh, page, tmp_path, monkeypatch
):
    monkeypatch.setattr(read_scheduler, "_ACCOUNT_PER_S", NEVER)
    monkeypatch.setattr(read_scheduler, "_ACCOUNT_AT_ONCE", 50.0)  # a connection takes 20
    asked, ask = [], PageConnection._ask

    def noted(self, request):
        asked.append((self.own_name, request.key))
        ask(self, request)

    monkeypatch.setattr(PageConnection, "_ask", noted)

    async with two_pages(mesh, page, tmp_path) as (first, stops, li):
        zhao = Client(li.address)
        await zhao.sign_in("zhao")
        async with zhao.browse() as second, zhao.browse("/mesh/stop") as own_stops, li.browse() as other:
            await write(first, FLOODS["empty"], 100)
            assert (await own_stops.ask(0, STOP)).ok  # the frames before it were read
            await second.send(ask={"id": 1, "key": "no/such key"})
            assert not (await other.ask(1, "no/such key")).ok
            assert (await own_stops.ask(1, STOP)).ok
            assert (await stops.ask(2, STOP)).ok
            assert [name for name, key in asked if key != STOP] == ["li.s"]
            for each in (first, second):
                each.socket.transport.abort()  # their close frames are not read either


async def test_a_turn_of_the_event_loop_reads_a_bounded_number_of_frames(mesh, page, monkeypatch):
    turns = {}

    class Counted(WebSocketTransport):
        def handle_events(self):
            turns[now] = turns.get(now, 0) + len(self.conn.events)
            super().handle_events()

    monkeypatch.setattr("services.console.serving.uvicorn_server.WebSocketTransport", Counted)
    now = 0

    async def count():
        nonlocal now
        while True:
            now += 1
            await asyncio.sleep(0)

    async with console(mesh, page) as (address, _), browse(address) as one, browse(address) as two:
        counting = asyncio.create_task(count())
        for each in (one, two):
            await write(each, FLOODS["pings"], 400)
        async with asyncio.timeout(30.0):
            while sum(turns.values()) < 800:
                await asyncio.sleep(0)
        counting.cancel()
        assert max(turns.values()) <= MOST_FRAMES


async def test_a_connection_for_stops_takes_nothing_else_and_ends_with_its_session(mesh, page, tmp_path):
    async with two_pages(mesh, page, tmp_path) as (_, stops, li):
        async with li.browse("/mesh/stop") as watching:
            await watching.watch(KEY)
            assert await reason_of_close(watching) == (1008, "page.stops_only")
        await li.post("/account/sign-out")
        assert (await reason_of_close(stops))[0] == 4401


async def test_watching_and_unwatching_in_turn_subscribes_once_and_an_unwatched_key_ends(mesh, monkeypatch):
    declared = []
    subscribe = Session.subscribe

    def counted(self, key, **settings):
        declared.append(subscribe(self, key, **settings))
        return declared[-1]

    monkeypatch.setattr(Session, "subscribe", counted)
    monkeypatch.setattr(shared_subscriptions, "_LINGER_S", 0.05)

    async with open_session(mesh) as session:
        shared = SharedSubscriptions(session)
        for _ in range(1000):
            shared.join(KEY, print)
            shared.leave(KEY, print)
        assert len(declared) == 1
        async with asyncio.timeout(30.0):
            while not declared[0].closed:
                await asyncio.sleep(0.01)
        shared.join(KEY, print)
        shared.leave(KEY, print)
        shared.join(KEY, print)
        assert (len(declared), KEY in shared) == (2, True)
        while shared._ends:  # watched again in time
            await asyncio.sleep(0.01)
        assert not declared[1].closed
        shared.close()


async def test_requests_begin_one_a_turn_and_a_page_is_read_between_them():
    reads, order = ReadScheduler(), []

    async def request(number):
        await reads.request_turn()
        order.append(number)

    requests = [asyncio.create_task(request(number)) for number in range(4)]
    requests[2].cancel()
    await asyncio.sleep(0)
    reads.turns.add(reads.pages, lambda: order.append("page"))
    reads.turns.add(reads.stops, lambda: order.append("stop"))
    await asyncio.gather(*requests, return_exceptions=True)
    assert order.index("stop") <= 2
    assert [each for each in order if isinstance(each, int)] == [0, 1, 3]


def test_an_allowance_is_overdrawn_by_one_piece_and_then_waited_for():
    allowance = Allowance(10.0, 20.0)
    assert (allowance.wait_s(0.0), allowance.is_full(0.0)) == (0.0, True)
    allowance.spend(20.0, 0.0)
    assert (allowance.wait_s(0.0), allowance.is_full(0.0)) == (0.0, False)
    allowance.spend(30.0, 0.0)
    assert allowance.wait_s(0.0) == pytest.approx(3.0)
    assert allowance.wait_s(1.0) == pytest.approx(2.0)
    assert not allowance.is_full(4.9)
    assert allowance.is_full(5.0)


async def test_a_hashed_file_of_the_page_is_compressed_once_for_all_requests(mesh, page, monkeypatch):
    text, packed = b"export const joints = 6;\n" * 200, []
    (page / "assets").mkdir(exist_ok=True)
    (page / "assets" / "large-1234.js").write_bytes(text)
    compress = gzip.compress
    monkeypatch.setattr(
        gzip, "compress", lambda *given, **named: packed.append(1) or compress(*given, **named)
    )

    async with console(mesh, page) as (address, _):
        fetches = [
            await get(address, "/assets/large-1234.js", **{"Accept-Encoding": "gzip"}) for _ in range(3)
        ]
        for status, headers, body in fetches:
            assert (status, headers["content-encoding"]) == (200, "gzip")
            assert headers["content-type"].startswith("text/javascript")
            assert int(headers["content-length"]) == len(body)
            assert gzip.decompress(body) == text
        assert len(packed) == 1
        status, headers, body = await get(address, "/assets/large-1234.js")
        assert (status, "content-encoding" in headers, body) == (200, False, text)
