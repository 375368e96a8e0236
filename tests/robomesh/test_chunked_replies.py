"""Chunked replies: losses, dropped answers and too many requests."""

import asyncio
from contextlib import asynccontextmanager

import pytest

from robomesh.errors import BrokenAnswerError
from robomesh.requests import chunked_replies
from robomesh.wire.session import open_session
from tests.protocol_gateway.gateway_site import until

KEY = "robomesh/hall/arm/mesh/{}"
NAMED = "robomesh/hall/arm/kinematics/check/{}"
CHUNKS = 6
LENGTH = (CHUNKS - 1) * chunked_replies.CHUNK_BYTES + 7


def mesh_of(name):
    return name[0].encode() * LENGTH


@asynccontextmanager
async def owner_and_caller(mesh):
    """Yield a caller, the requested meshes, and the owner's kept answers for KEY and for NAMED."""
    async with open_session(mesh) as owner, open_session(mesh) as asker:
        asked = []

        async def answer(request):
            asked.append(request.chunk)
            return mesh_of(request.chunk)  # a new object for each request

        server = owner.answer("hall", "arm", "mesh/*", answer)
        await asker.ask_bytes(KEY.format("ready"), timeout_s=20.0)
        server._chunked._kept.clear()
        named = owner.answer("hall", "arm", "kinematics/check/*", answer)
        await asker.ask_bytes(NAMED.format("ready"), timeout_s=20.0)
        named._chunked._kept.clear()
        asked.clear()
        yield asker, asked, server._chunked, named._chunked


async def get(asker, selector):
    """Return the one reply to a query."""
    replies = await asyncio.to_thread(lambda: list(asker.zenoh_session.get(selector, timeout=20.0)))
    assert len(replies) == 1
    return replies[0]


async def token_of(asker, name, key=KEY):
    first = chunked_replies.first_chunk((await get(asker, chunked_replies.selector(key.format(name)))).ok)
    assert first.length == LENGTH
    return first.token


async def chunk(asker, name, token, offset, key=KEY):
    """Return a chunk's bytes; None: refused."""
    reply = await get(asker, f"{key.format(name)}?piece={token}:{offset}")
    return None if reply.ok is None else reply.ok.payload.to_bytes()


def intercept(monkeypatch, act):
    """Call `act` before the n-th request for a chunk reaches its owner; True: lose the request."""
    answered, seen = chunked_replies.ChunkedReplies.reply_chunk, []

    def reply_chunk(self, query):
        if query.parameters.get("piece") is None:
            return False
        seen.append(query)
        if act(self, len(seen)):
            with query:
                return True
        return answered(self, query)

    monkeypatch.setattr(chunked_replies.ChunkedReplies, "reply_chunk", reply_chunk)


async def test_lost_chunks_are_requested_again_and_the_handler_is_not(mesh, monkeypatch):
    async with owner_and_caller(mesh) as (asker, asked, *_):
        intercept(monkeypatch, lambda answers, number: number % 3 == 0)
        assert await asker.ask_bytes(KEY.format("base"), timeout_s=20.0) == mesh_of("base")
        assert asked == ["base"]


async def test_answer_dropped_during_the_transfer_is_requested_again(mesh, monkeypatch):
    async with owner_and_caller(mesh) as (asker, asked, *_):
        intercept(monkeypatch, lambda answers, number: number == 3 and answers._kept.clear())
        assert await asker.ask_bytes(KEY.format("base"), timeout_s=20.0) == mesh_of("base")
        assert asked == ["base", "base"]


async def test_answer_that_ends_early_is_an_error(mesh, monkeypatch):
    async with owner_and_caller(mesh) as (asker, *_):
        intercept(monkeypatch, lambda answers, number: number > 1)
        with pytest.raises(BrokenAnswerError) as caught:
            await asker.ask_bytes(KEY.format("base"), timeout_s=2.0)
        reason = caught.value.reason
        assert (reason.code, reason.causes[0].code) == ("request.broken_answer", "piece.none")
        assert reason.values["bytes"] in ("30000", "60000")


async def test_fetched_answers_are_dropped_first_and_equal_ones_are_kept_once(mesh, monkeypatch):
    monkeypatch.setattr(chunked_replies, "_KEPT_BYTES", 2 * LENGTH)
    async with owner_and_caller(mesh) as (asker, _, answers, _):
        unfinished, fetched = await token_of(asker, "a"), await token_of(asker, "b")
        for number in range(1, CHUNKS):
            assert await chunk(asker, "b", fetched, number * chunked_replies.CHUNK_BYTES)
        # Many requests for one mesh drop no other answer.
        assert {await token_of(asker, "c") for _ in range(4)} == {await token_of(asker, "c")}
        assert await chunk(asker, "a", unfinished, LENGTH - 7) == b"a" * 7
        assert await chunk(asker, "b", fetched, LENGTH - 7) is None
        assert len(answers._kept) == 2


async def test_answer_in_a_callers_name_is_sent_a_few_times_only(mesh):
    async with owner_and_caller(mesh) as (asker, _, _, answers):
        another, token = await token_of(asker, "li", NAMED), await token_of(asker, "li", NAMED)
        assert another != token
        for offset in (LENGTH, "9" * 5000, "-1", "x", ""):
            assert await chunk(asker, "li", token, offset, NAMED) is None
        sent = 0
        while await chunk(asker, "li", token, 0, NAMED) is not None:
            sent += 1
        assert sent == chunked_replies._TIMES * (CHUNKS - 1)
        assert list(answers._kept) == [another]


async def test_an_idle_owner_keeps_nothing(mesh, monkeypatch):
    monkeypatch.setattr(chunked_replies, "_KEPT_S", 0.1)
    async with owner_and_caller(mesh) as (asker, _, answers, _):
        await token_of(asker, "a")
        await until(lambda: not answers._kept)
