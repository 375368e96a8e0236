"""An operator with control through a page is present as long as the page's connection lasts."""

import asyncio

from robomesh.contract.keys import parse_key
from robomesh.errors import RefusedError
from robomesh.requests.requests import ask_all
from robomesh.schemas.robomesh_pb2 import LeaseAnswer, LeaseRequest, ReplayState
from tests.services.test_console import browse, console, page

__all__ = ["page"]  # a fixture
ACTION = LeaseRequest.Action
KEY = "robomesh/s/r/lease/request/li"


def asked(action):
    return LeaseRequest(action=action).SerializeToString()


def owner(other):
    """Answer lease requests of a robot: grant all but TAKE."""

    async def lease(request):
        if request.message.action == ACTION.TAKE:
            raise RefusedError("TAKE needs a reason")
        return LeaseAnswer(holder="li")

    other.answer("s", "r", "lease/request/*", lease)


async def until_present(session, *ids, timeout_s=30.0):
    """Wait until exactly these operators are present."""
    async with asyncio.timeout(timeout_s):
        while [who.id for who in (await session.present_sessions())[0]] != [*ids]:
            await asyncio.sleep(0.01)


async def session_of(browser):
    await browser.until(lambda: browser.other)
    return browser.other[0].hello.session


async def test_a_page_in_control_is_present_and_gone_with_its_connection(mesh, page):
    async with console(mesh, page) as (address, other):
        owner(other)
        async with browse(address) as browser, browse(address) as onlooker:
            mine = await session_of(browser)
            assert mine != await session_of(onlooker)
            await onlooker.ask(1, KEY, asked(ACTION.ASK))
            assert (await browser.ask(1, KEY, asked(ACTION.ACQUIRE))).ok
            await until_present(other, mine)
            # A killed browser closes without a message.
            browser.socket.transport.abort()
            await until_present(other)


async def test_a_page_that_is_refused_or_gives_control_back_is_not_present(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as browser:
        owner(other)
        mine = await session_of(browser)
        assert (await browser.ask(1, KEY, asked(ACTION.ACQUIRE))).ok
        await until_present(other, mine)
        assert (await browser.ask(2, KEY, asked(ACTION.RELEASE))).ok
        await until_present(other)
        assert not (await browser.ask(3, KEY, asked(ACTION.TAKE))).ok
        await until_present(other)


async def test_no_operator_is_present_at_a_robot_that_does_not_answer(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as browser:
        answer = await browser.ask(1, KEY, asked(ACTION.ACQUIRE), timeout_s=2.0)
        assert (answer.ok, answer.no_answer) == (False, True)
        await until_present(other)


async def test_an_invalid_lease_request_is_refused_with_a_sentence(mesh, page):
    async with console(mesh, page) as (address, _), browse(address) as browser:
        answer = await browser.ask(1, KEY, b"\xff")
        assert (answer.ok, answer.no_answer) == (False, False)
        assert answer.refusal.causes[0].code == "request.not_lease_request"


async def test_a_busy_gateway_is_to_the_page_one_that_does_not_answer_and_may_be_asked_again(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as browser:
        begun, go_on = [], asyncio.Event()

        async def lease(request):
            begun.append(request)
            await go_on.wait()
            return LeaseAnswer(holder="li")

        other.answer("s", "r", "lease/request/*", lease)
        payload = asked(ACTION.RENEW)
        waiting = [
            asyncio.create_task(ask_all(other.zenoh_session, parse_key(KEY), payload, timeout_s=20.0))
            for _ in range(16)
        ]
        async with asyncio.timeout(40):
            while len(begun) < 16:
                await asyncio.sleep(0.01)
        answer = await browser.ask(1, KEY, payload, timeout_s=0.3)
        assert (answer.ok, answer.no_answer) == (False, True)
        assert "too many requests are waiting" in answer.error
        go_on.set()
        assert (await browser.ask(2, KEY, payload)).ok
        await asyncio.gather(*waiting)


async def test_no_operator_is_present_without_a_replay(mesh, page):
    async with console(mesh, page) as (address, other), browse(address) as browser:
        for number in range(1, 4):
            key = f"robomesh/nowhere{number}/-/player/open"
            assert not (await browser.ask(number, key, timeout_s=0.1)).ok
        await until_present(other)

        async def opened(_):
            return ReplayState(robot="replay-1")

        other.answer("s", "-", "player/open", opened)
        assert (await browser.ask(9, "robomesh/s/-/player/open")).ok
        await until_present(other, await session_of(browser))
