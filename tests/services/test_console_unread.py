"""A page that sends requests and does not read is cut off before it takes memory."""

import asyncio
from dataclasses import dataclass, field

from robomesh.schemas.robomesh_pb2 import FromPage, ToPage
from robomesh.wire.session import open_session
from services.console.common.requested_views import Views
from services.console.websocket.page_connection import PageConnection
from services.console.websocket.shared_subscriptions import SharedSubscriptions
from tests.services.test_console import browse, console, page

__all__ = ["page"]  # a fixture
LONG = "robomesh/s/r/" + "x" * 900_000


class Full:
    """A transport that has taken one write."""

    ready = True

    def write(self, frames):
        self.ready = False

    def spend(self, cost):
        pass


@dataclass
class Deaf:
    """A WebSocket whose peer keeps sending requests, and reads nothing."""

    asked: int = 0
    scope: dict = field(default_factory=lambda: {"extensions": {"robomesh.line": {"line": Full()}}})

    async def receive(self):
        await asyncio.sleep(0)
        self.asked += 1
        ask = FromPage.Ask(id=self.asked, key="robomesh/s/r/no-such-request")
        return {"type": "websocket.receive", "bytes": FromPage(ask=ask).SerializeToString()}

    async def close(self, code, reason):
        await asyncio.Event().wait()


async def test_a_page_that_asks_and_never_reads_is_cut_off(mesh, monkeypatch):
    monkeypatch.setattr("services.console.websocket.send_order.MOST_UNREAD", 20_000)
    monkeypatch.setattr("services.console.websocket.page_connection._CLOSED_WITHIN_S", 0.05)

    async with open_session(mesh) as session:
        feeds, deaf = SharedSubscriptions(session), Deaf()
        browser = PageConnection(session, feeds, Views(session), greet=lambda _: ToPage(), site="s")
        async with asyncio.timeout(30.0):
            await browser.run(deaf)
        assert 10 < deaf.asked < 2000
        assert browser._order.unread_bytes <= 22_000  # and the message that exceeded the limit
        feeds.close()


async def test_a_long_key_is_refused_without_being_repeated(mesh, page):
    async with console(mesh, page) as (address, _), browse(address) as browser:
        answer = await browser.ask(1, LONG)
        assert (answer.ok, answer.error) == (
            False,
            "the key has 900013 characters: at most 200 are allowed",
        )
