"""What others say that makes no sense: it is left out, and hides nothing that does."""

import asyncio
import time

import pytest
import zenoh

from robomesh.client import ask_all
from robomesh.endpoints import client_config
from robomesh.errors import RefusedError
from robomesh.messages import TEXT
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import open_session
from tests.conftest import run

STOP = "robomesh/site/{}/stop"


@pytest.fixture
def plain(mesh):
    """Somebody who keeps to nothing."""
    with zenoh.open(client_config(mesh.connect)) as session:
        yield session


def test_an_owner_whose_answer_is_none_hides_no_others(mesh, plain):
    async def stop(request):
        return schema.StopAnswer(stop_id=7, sent=True)

    def nonsense(query):
        with query:
            query.reply(STOP.format("odd"), b"\xff\xff\xff")

    async def main():
        async with open_session(mesh) as gateway, open_session(mesh) as operator:
            gateway.answer("site", "arm", "stop", stop)
            odd = plain.declare_queryable(STOP.format("odd"), nonsense)
            answers = {}
            while len(answers) < 2:  # until the router knows both
                found = await operator.ask_all(STOP.format("*"), schema.StopRequest())
                answers = {each.key: each for each in found}
            odd.undeclare()
            assert answers[STOP.format("arm")].message.stop_id == 7
            assert answers[STOP.format("odd")].message is None
            assert "3 bytes are not a robomesh.StopAnswer" in answers[STOP.format("odd")].error

    run(main())


def test_a_refusal_that_is_no_text_is_a_refusal(mesh, plain):
    def refuse(query):
        with query:
            query.reply_err(b"no\xff", encoding=TEXT)

    async def main():
        odd = plain.declare_queryable(STOP.format("odd"), refuse)
        async with open_session(mesh) as operator:
            with pytest.raises(RefusedError, match="no\ufffd"):
                await operator.ask(STOP.format("odd"), schema.StopRequest(), timeout_s=20.0)
        odd.undeclare()

    run(main())


def test_a_request_that_comes_as_its_owner_closes_is_not_done(mesh, plain):
    done = []

    async def stop(request):
        done.append(request)
        return schema.StopAnswer(stop_id=1)

    def it_came(answerer):
        deadline = time.monotonic() + 40.0
        while not answerer._unanswered:
            assert time.monotonic() < deadline
            time.sleep(0.01)

    async def main():
        async with open_session(mesh) as gateway:
            answerer = gateway.answer("site", "arm", "stop", stop)
            while not await ask_all(plain, STOP.format("arm"), b"", timeout_s=20.0):
                pass
            done.clear()
            plain.get(STOP.format("arm"), lambda reply: None)
            it_came(answerer)  # while the loop stands still: it waits for that
            answerer.close()
            for _ in range(10):
                await asyncio.sleep(0)
            assert not done

    run(main())
