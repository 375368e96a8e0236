"""The console's server over a real router: samples to a browser, and requests from it."""

import asyncio
import contextlib
import hashlib
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from robomesh.errors import ListenError, RefusedError
from robomesh.publications.subscription import Subscription
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.console.app import Settings, serve
from services.console.common.errors import PageNotBuiltError
from services.console.websocket import shared_subscriptions
from tests.conftest import put_unheard
from tests.services.http_refusals import read_refusal

KEY_FRAME = b"\0\0\0\1\x67\x42\xc0\x1f\0\0\0\1\x65\x88"
DELTA = b"\0\0\0\1\x41\x9a\x01"


@pytest.fixture
def page(tmp_path):
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<!doctype html><title>page</title>")
    (tmp_path / "view.html").write_text("<!doctype html><title>view</title>")
    (tmp_path / "assets" / "index-1234.js").write_text("export {}")
    return tmp_path


@asynccontextmanager
async def console(mesh, page, **settings):
    """Yield a running console's HOST:PORT, and a second session on the same mesh."""
    async with open_session(mesh) as own, open_session(mesh) as other:
        address = asyncio.get_running_loop().create_future()
        settings = {"site": "s", "listen": "127.0.0.1:0", "page": page, **settings}
        task = asyncio.create_task(serve(own, Settings(**settings), on_ready=address.set_result))
        await asyncio.wait([task, address], return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        try:
            yield address.result().removeprefix("http://"), other
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


@dataclass
class Page:
    """A page's end of the WebSocket."""

    socket: object
    samples: list = field(default_factory=list)
    other: list = field(default_factory=list)

    async def send(self, **message):
        await self.socket.send(schema.FromPage(**message).SerializeToString())

    async def watch(self, key):
        await self.send(watch={"key": key})

    async def until(self, condition, timeout_s=30.0):
        """Read until the condition holds."""
        async with asyncio.timeout(timeout_s):
            while not condition():
                message = schema.ToPage.FromString(await self.socket.recv())
                if message.WhichOneof("message") == "sample":
                    self.samples.append(message.sample)
                else:
                    self.other.append(message)

    async def ask(self, number, key, request=b"", timeout_s=30.0):
        await self.send(ask={"id": number, "key": key, "payload": request, "timeout_s": timeout_s})
        await self.until(lambda: any(m.answer.id == number for m in self.other))
        return next(m.answer for m in self.other if m.answer.id == number)


@asynccontextmanager
async def browse(address):
    async with connect(f"ws://{address}/mesh", origin=f"http://{address}", compression=None) as socket:
        yield Page(socket)


async def get(address, path, *, method="GET", body=b"", **headers):
    """Return status, headers and body of the response to a request."""
    host, port = address.split(":")
    # The loopback address that the client uses, so that a test has clients at several addresses.
    source = (host, 0) if host.startswith("127.") else None
    reader, writer = await asyncio.open_connection(host, int(port), local_addr=source)
    lines = {"Host": address, "Connection": "close", **headers}
    text = f"{method} {path} HTTP/1.1\r\n" + "".join(f"{k}: {v}\r\n" for k, v in lines.items()) + "\r\n"
    writer.write(text.encode() + body)
    head, _, body = (await reader.read()).partition(b"\r\n\r\n")
    writer.close()
    status, *rest = head.decode().split("\r\n")
    pairs = (line.split(": ", 1) for line in rest)
    return int(status.split()[1]), {name.lower(): value for name, value in pairs}, body


def joints(value):
    message = JointStates()
    message.joints.add(name="waist", position=value)
    return message


async def test_a_page_is_greeted_with_the_stale_times_of_the_topic_table(mesh, page):
    async with console(mesh, page) as (address, _), browse(address) as browser:
        await browser.until(lambda: browser.other)
        hello = browser.other[0].hello
        assert (hello.site, hello.insecure, hello.connected) == ("s", False, True)
        assert {each.topic: each.after_s for each in hello.stale}["controller"] == 3.0


async def test_a_page_learns_when_it_has_the_presence_of_every_robot(mesh, page):
    async with console(mesh, page) as (address, other):
        other.declare_presence("s", "r", "gateway")
        async with browse(address) as first:
            await first.until(lambda: first.other and first.other[-1].hello.presence_known)
            known = [each.presence.key for each in first.other if each.HasField("presence")]
            assert any(key.startswith("robomesh/s/r/alive/gateway/") for key in known)
        async with browse(address) as second:
            await second.until(lambda: second.other and second.other[-1].hello.presence_known)
            order = [each.WhichOneof("message") for each in second.other]
            assert order[0] == order[-1] == "hello"
            assert "presence" in order[1:-1]


async def test_payload_and_attachment_reach_the_page_as_they_were(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as browser:
        publisher = other.declare_publisher("s", "r", "joints")
        publisher.remember(joints(1.0), source_time_ns=5)  # nothing is in flight when the page connects
        await browser.watch("robomesh/*/*/joints")
        await browser.until(lambda: browser.samples)
        first = browser.samples[0]
        assert first.key == "robomesh/s/r/joints"
        assert not first.live
        assert not first.HasField("age_s")  # the last value's age is unknown
        header = publisher.put(joints(2.0), source_time_ns=77)
        await browser.until(lambda: browser.samples[-1].live)
        last = browser.samples[-1]
        assert last.payload == joints(2.0).SerializeToString()
        assert int.from_bytes(last.attachment[8:16], "little") == header.sequence
        assert int.from_bytes(last.attachment[16:], "little") == 77
        assert 0 <= last.age_s < 1


async def test_a_later_page_gets_the_held_value_with_its_age(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as first:
        publisher = other.declare_publisher("s", "r", "joints")
        await first.watch("robomesh/s/r/joints")
        while not publisher.watched:
            await asyncio.sleep(0.01)
        publisher.put(joints(1.0))
        await first.until(lambda: first.samples)
        await asyncio.sleep(0.2)
        async with browse(address) as second:
            await second.watch("robomesh/s/r/joints")
            await second.until(lambda: second.samples)
            assert second.samples[0].live
            assert 0.15 < second.samples[0].age_s < 2


def shown(browser, number):
    return (
        browser.samples and JointStates.FromString(browser.samples[-1].payload).joints[0].position == number
    )


async def test_a_page_that_reads_nothing_gets_the_newest_then_and_delays_no_other(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as slow, browse(address) as quick:
        publisher = other.declare_publisher("s", "r", "joints")
        for each in (slow, quick):
            await each.watch("robomesh/s/r/joints")
        while not publisher.watched:
            await asyncio.sleep(0.01)
        big = joints(0.0)
        big.joints[0].name = "x" * 100_000
        for number in range(1, 201):
            big.joints[0].position = number
            while not shown(quick, number):
                publisher.put(big)  # on a full link it is dropped
                with contextlib.suppress(TimeoutError):
                    await quick.until(lambda n=number: shown(quick, n), timeout_s=1.0)
            quick.samples.clear()
        await slow.until(lambda: shown(slow, 200))
        assert len(slow.samples) < 150  # of 20 MB published, most was dropped


async def test_video_is_subscribed_to_only_while_a_page_watches_it(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as first:
        publisher = other.declare_publisher("s", "r", "video/top")
        publisher.put(CompressedVideo(data=KEY_FRAME), key_frame=True)
        publisher.put(CompressedVideo(data=DELTA))
        assert not publisher.watched
        await first.watch("robomesh/s/r/video/top")
        await first.until(lambda: first.samples)
        history = schema.VideoFrames.FromString(first.samples[0].payload)
        assert [f.sequence for f in history.frames] == [1, 2]
        publisher.put(CompressedVideo(data=DELTA))
        await first.until(lambda: len(first.samples) >= 2)
        async with browse(address) as second:
            await second.watch("robomesh/s/r/video/top")
            await second.until(lambda: len(second.samples) >= 2)
            assert [each.live for each in second.samples] == [False, True]
        await first.send(unwatch={"key": "robomesh/s/r/video/top"})
        async with asyncio.timeout(40):
            while publisher.watched:
                await asyncio.sleep(0.01)


async def test_events_come_as_a_list_and_then_one_by_one(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as browser:
        publisher = other.declare_publisher("s", "r", "events")
        for number in range(3):
            publisher.put(schema.Event(text=f"event {number}"))
        await browser.watch("robomesh/s/r/events")

        def texts():
            # On a busy machine, events that were published before may arrive as live ones first; the list
            # then has the others.
            return {
                event.text
                for sample in browser.samples
                for event in (
                    [schema.Event.FromString(sample.payload)]
                    if sample.live
                    else schema.EventList.FromString(sample.payload).events
                )
            }

        await browser.until(lambda: texts() >= {"event 0", "event 1", "event 2"})
        before = len(browser.samples)
        publisher.put(schema.Event(text="event 3"))
        await browser.until(lambda: len(browser.samples) > before)
        assert schema.Event.FromString(browser.samples[-1].payload).text == "event 3"


async def test_events_missed_in_an_outage_are_appended_also_for_later_pages(mesh, page):
    def texts(browser):
        return [
            [event.text for event in schema.EventList.FromString(sample.payload).events]
            for sample in browser.samples
        ]

    async with console(mesh, page) as (address, other), browse(address) as browser:
        publisher = other.declare_publisher("s", "r", "events")
        # A machine that is busy would deliver them live.
        for number in range(3):
            put_unheard(publisher, schema.Event(text=f"{number}"))
        await browser.watch("robomesh/s/r/events")
        await browser.until(lambda: browser.samples)
        for number in range(3, 5):
            put_unheard(publisher, schema.Event(text=f"{number}"))
        other.declare_presence("s", "r", "gateway")
        await browser.until(lambda: len(browser.samples) >= 2)
        assert texts(browser) == [["0", "1", "2"], ["3", "4"]]
        async with browse(address) as later:
            await later.watch("robomesh/s/r/events")
            await later.until(lambda: len(later.samples) >= 2)
            assert texts(later) == [["0", "1", "2"], ["3", "4"]]


async def test_requests_are_passed_on_and_answered_and_refusals_come_in_words(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as browser:

        async def command(request):
            if request.chunk != "li":
                raise RefusedError(f"{request.chunk} has no lease")
            return schema.CommandAnswer(accepted=True, text="done")

        other.answer("s", "r", "command/*", command)
        home = schema.CommandRequest(command=schema.CommandRequest.HOME, id=1, lease="x").SerializeToString()
        answer = await browser.ask(1, "robomesh/s/r/command/li", home)
        assert answer.ok
        assert schema.CommandAnswer.FromString(answer.payload).text == "done"
        refused = await browser.ask(2, "robomesh/s/r/command/wang", home)
        assert (refused.ok, refused.error) == (False, "wang has no lease")
        unanswered = await browser.ask(3, "robomesh/s/other/stop", timeout_s=0.3)
        assert not unanswered.ok
        assert unanswered.error
        unknown = await browser.ask(4, "robomesh/s/r/joints")
        assert "no request 'joints'" in unknown.error


async def test_presence_is_sent_on_connect_and_on_each_change(mesh, page):
    async with console(mesh, page) as (address, _), browse(address) as first:

        def presences(browser):
            return {(m.presence.key.rsplit("/", 1)[0], m.presence.alive) for m in browser.other}

        async with open_session(mesh) as gateway:
            gateway.declare_presence("s", "r", "gateway")
            await first.until(lambda: ("robomesh/s/r/alive/gateway", True) in presences(first))
            async with browse(address) as second:
                await second.until(lambda: ("robomesh/s/r/alive/gateway", True) in presences(second))
        await first.until(lambda: ("robomesh/s/r/alive/gateway", False) in presences(first))


async def test_a_page_with_invalid_messages_is_closed_with_a_reason(mesh, page):
    async with console(mesh, page) as (address, _):
        for message, words, code in (
            (
                schema.FromPage(watch={"key": "robomesh/**"}).SerializeToString(),
                "robomesh/**",
                "page.cannot_watch",
            ),
            # A closing frame counts bytes, not characters.
            (schema.FromPage(watch={"key": "é" * 150}).SerializeToString(), "ééé", "page.cannot_watch"),
            (schema.FromPage(watch={"key": "x" * 201}).SerializeToString(), "", "request.key_too_long"),
            (b"\xff\xff\xff", "", "page.not_a_message"),
            ("text", "binary", "page.text"),
        ):
            async with browse(address) as browser:
                await browser.socket.send(message)
                with pytest.raises(ConnectionClosed) as closed:
                    await browser.until(lambda: False)
                assert closed.value.rcvd.code == 1008
                assert words in closed.value.rcvd.reason
                answer = next(each.answer for each in browser.other if each.HasField("answer"))
                assert (answer.id, answer.ok, answer.refusal.code) == (0, False, code)


def test_other_origins_and_hosts_are_refused(mesh, page):
    async def main():
        async with console(mesh, page) as (address, _):
            with pytest.raises(InvalidStatus, match="403") as refused:
                async with connect(f"ws://{address}/mesh", origin="http://evil.example", compression=None):
                    pass
            answer = refused.value.response
            assert read_refusal(answer.headers, answer.body).code == "http.origin"
            assert answer.headers["x-content-type-options"] == "nosniff"
            status, headers, body = await get(address, "/", Host="evil.example")
            assert status == 421
            reason = read_refusal(headers, body)
            assert (reason.code, reason.values) == ("http.host", {"host": "evil.example"})


async def test_unknown_paths_and_methods_are_refused_with_codes(mesh, page):
    async with console(mesh, page) as (address, _):
        status, headers, body = await get(address, "/nothing/here")
        assert (status, read_refusal(headers, body).code) == (404, "http.no_path")
        own = {"Origin": f"http://{address}", "Content-Length": "0"}
        status, headers, body = await get(address, "/health", method="POST", **own)
        reason = read_refusal(headers, body)
        assert (status, reason.code, reason.values) == (
            405,
            "http.method",
            {"path": "/health", "method": "POST"},
        )


async def test_the_page_may_run_only_its_own_code_and_only_hashed_files_are_kept(mesh, page):
    async with console(mesh, page) as (address, _):
        status, headers, body = await get(address, "/")
        assert (status, headers["cache-control"]) == (200, "no-store")
        assert b"<title>page" in body
        policy = headers["content-security-policy"]
        assert "script-src 'self'" in policy
        assert "unsafe" not in policy
        _, headers, _ = await get(address, "/assets/index-1234.js")
        assert "immutable" in headers["cache-control"]
        assert (await get(address, "/assets/../../console.py"))[0] == 404


async def test_a_shape_is_asked_of_the_robot_and_checked_by_its_hash(mesh, page):
    async with console(mesh, page) as (address, other):
        asked = []

        async def answer(request):
            asked.append(request.chunk)
            return b"glTF bytes"

        other.answer("s", "r", "mesh/*", answer)
        sha256 = hashlib.sha256(b"glTF bytes").hexdigest()
        for _ in range(2):
            status, headers, body = await get(address, f"/mesh/s/r/base?sha={sha256}")
            assert (status, body) == (200, b"glTF bytes")
            assert "immutable" in headers["cache-control"]
        assert asked == ["base"]  # the second came from the console's cache
        assert (await get(address, f"/mesh/s/r/base?sha={'0' * 64}"))[0] == 409
        assert (await get(address, "/mesh/s/R/base"))[0] == 400
        # Kinematics that starts again: the page asks again after 504, and gives up after 404.
        assert (await get(address, "/mesh/s/r2/base"))[0] == 504


async def test_beyond_loopback_it_refuses_to_start_and_a_taken_port_is_named(mesh, page):
    with pytest.raises(ListenError, match="insecure = true"):
        async with console(mesh, page, listen="0.0.0.0:0"):
            pass
    async with console(mesh, page) as (address, _):
        with pytest.raises(ListenError, match=address):
            async with console(mesh, page, listen=address):
                pass
    with pytest.raises(PageNotBuiltError, match=r"build_page\.py"):
        async with console(mesh, page / "nothing"):
            pass


async def test_every_page_shows_an_insecure_address(mesh, page):
    async with console(mesh, page, listen="0.0.0.0:0", insecure=True) as (address, _):
        own = address.replace("0.0.0.0", "127.0.0.1")
        async with browse(own) as browser:
            await browser.until(lambda: browser.other)
            assert browser.other[0].hello.insecure


async def test_a_value_whose_answer_was_lost_is_asked_for_again(mesh, page, monkeypatch):
    monkeypatch.setattr(shared_subscriptions, "_ASK_AGAIN_S", 0.1)
    query, lost = Subscription._query, []

    def lose_the_first(subscription, timeout_s):
        if subscription.key_expr.endswith("/description") and not lost:
            lost.append(subscription.key_expr)
        else:
            query(subscription, timeout_s)

    monkeypatch.setattr(Subscription, "_query", lose_the_first)

    async with console(mesh, page) as (address, other), browse(address) as browser:
        publisher = other.declare_publisher("s", "arm", "description")
        publisher.put(schema.Description(title="Arm"))
        await browser.watch("robomesh/s/arm/description")
        await browser.until(lambda: browser.samples)
        assert lost
