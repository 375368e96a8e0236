"""Invalid answers and late requests of other programs."""

import asyncio
import time

import pytest
import zenoh

from robomesh.endpoints import client_config
from robomesh.errors import RefusedError
from robomesh.messages import TEXT
from robomesh.requests import ask_all
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import open_session
from tests.conftest import run

STOP = "robomesh/site/{}/stop"


@pytest.fixture
def plain(mesh):
    """Yield a plain Zenoh session, without the library's checks."""
    with zenoh.open(client_config(mesh.connect)) as session:
        yield session


def test_invalid_answer_hides_no_other_answer(mesh, plain):
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


def test_refusal_with_invalid_utf_8_is_a_refusal(mesh, plain):
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


def test_request_that_arrives_during_close_is_not_handled(mesh, plain):
    done = []

    async def stop(request):
        done.append(request)
        return schema.StopAnswer(stop_id=1)

    def wait_until_received(answerer):
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
            wait_until_received(answerer)  # blocks the loop, so that the request waits for it
            answerer.close()
            for _ in range(10):
                await asyncio.sleep(0)
            assert not done

    run(main())
