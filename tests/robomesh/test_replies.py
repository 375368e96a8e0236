"""Replies to Zenoh queries as futures."""

import asyncio

import pytest

from robomesh.contract.topics import Priority
from robomesh.errors import NoAnswerError
from robomesh.requests.replies import query
from robomesh.wire.session import open_session

KEY = "robomesh/site/arm/joints"


def payload(reply):
    """Return an accepted reply's payload; nothing for a refusal."""
    return None if reply.ok is None else reply.ok.payload.to_bytes()


def ask(session, key=KEY):
    return query(session.zenoh_session, key, payload, priority=Priority.REAL_TIME, timeout_s=5.0)


async def test_future_has_what_was_read_from_each_reply(mesh):
    def answer(query):
        with query:
            query.reply(KEY, b"one")
            query.reply(KEY, b"two")
            query.reply_err(b"no")

    async with open_session(mesh) as owner, open_session(mesh) as client:
        queryable = owner.zenoh_session.declare_queryable(KEY, answer)
        while not (found := await ask(client)):
            await asyncio.sleep(0.01)
        assert found == [b"one", b"two"]
        queryable.undeclare()


async def test_query_without_an_owner_has_no_replies(mesh):
    async with open_session(mesh) as client:
        assert await ask(client) == []


async def test_query_that_cannot_be_sent_is_an_error_with_its_key(mesh):
    async with open_session(mesh) as client:
        with pytest.raises(NoAnswerError, match=r"^robomesh//arm could not be asked: "):
            ask(client, "robomesh//arm?pieces")


async def test_cancelled_query_ignores_its_replies(mesh):
    def answer(query):
        with query:
            query.reply(KEY, b"late")

    async with open_session(mesh) as owner, open_session(mesh) as client:
        queryable = owner.zenoh_session.declare_queryable(KEY, answer)
        while not await ask(client):
            await asyncio.sleep(0.01)
        ask(client).cancel()
        assert await ask(client) == [b"late"]
        queryable.undeclare()
