"""Invalid answers and late requests of other programs."""

import asyncio
import time

import pytest
import zenoh

from robomesh.contract.endpoints import client_config
from robomesh.contract.keys import Key
from robomesh.contract.messages import TEXT
from robomesh.errors import RefusedError
from robomesh.requests.requests import ask_all
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session

STOP = "robomesh/site/{}/stop"


@pytest.fixture
def plain(mesh):
    """Yield a plain Zenoh session, without the library's checks."""
    with zenoh.open(client_config(mesh.connect)) as session:
        yield session


async def test_invalid_answer_hides_no_other_answer(mesh, plain):
    async def stop(request):
        return schema.StopAnswer(stop_id=7, sent=True)

    def nonsense(query):
        with query:
            query.reply(STOP.format("odd"), b"\xff\xff\xff")

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


async def test_refusal_with_invalid_utf_8_is_a_refusal(mesh, plain):
    def refuse(query):
        with query:
            query.reply_err(b"no\xff", encoding=TEXT)

    odd = plain.declare_queryable(STOP.format("odd"), refuse)
    async with open_session(mesh) as operator:
        with pytest.raises(RefusedError, match="no\ufffd"):
            await operator.ask(STOP.format("odd"), schema.StopRequest(), timeout_s=20.0)
    odd.undeclare()


async def test_request_that_arrives_during_close_is_not_handled(mesh, plain):
    done = []

    async def stop(request):
        done.append(request)
        return schema.StopAnswer(stop_id=1)

    def wait_until_received(server):
        deadline = time.monotonic() + 40.0
        while not server._unanswered:
            assert time.monotonic() < deadline
            time.sleep(0.01)

    async with open_session(mesh) as gateway:
        server = gateway.answer("site", "arm", "stop", stop)
        while not await ask_all(plain, Key("site", "arm", "stop"), b"", timeout_s=20.0):
            pass
        done.clear()
        plain.get(STOP.format("arm"), lambda reply: None)
        wait_until_received(server)  # blocks the loop, so that the request waits for it
        server.close()
        for _ in range(10):
            await asyncio.sleep(0)
        assert not done


async def test_request_longer_than_its_row_permits_is_not_decoded_but_a_stop_stops(mesh, plain):
    """One message of JSON, as anybody may send, would else occupy the owner's event loop for seconds."""
    seen = []

    async def stop(request):
        seen.append(request.message)
        return schema.StopAnswer(stop_id=1)

    async def move(request):
        raise AssertionError("a command that is too long was decoded")

    def text(key, payload):
        (reply,) = plain.get(key, payload=payload, encoding="application/json", timeout=20.0)
        answer = reply.ok or reply.err
        return answer.payload.to_string()

    async with open_session(mesh) as gateway:
        gateway.answer("site", "arm", "stop", stop)
        gateway.answer("site", "arm", "command/*", move)
        while not await ask_all(plain, Key("site", "arm", "stop"), b"", timeout_s=20.0):
            pass
        for longest, why in ((4 << 20, "at most 524288 are permitted"), (500_000, "at most 10000")):
            payload = b'{"joint_positions":[' + b"0," * (longest // 2) + b"0]}"
            key = "robomesh/site/arm/command/li"
            assert why in await asyncio.to_thread(text, key, payload)
        await asyncio.to_thread(text, STOP.format("arm"), b'{"by":"' + b"x" * 300_000 + b'"}')
        assert seen[-1] == schema.StopRequest()


async def test_request_on_a_key_that_is_too_long_is_refused(mesh, plain):
    refused = []

    async def answer(request):
        raise AssertionError("a command on an invalid key was handled")

    async with open_session(mesh) as gateway:
        gateway.answer("site", "arm", "command/*", answer, on_refused=lambda *why: refused.append(why))
        name, replies = "x" * 1100, []
        key = f"robomesh/site/arm/command/{name}"
        while not replies:  # until the router knows the server
            replies = await asyncio.to_thread(lambda: list(plain.get(key, timeout=20.0)))
        assert "code=request.invalid" in str(replies[0].err.encoding)
        assert {(chunk, reason.code) for chunk, reason in refused} == {(name, "request.invalid")}
        assert gateway.ignored.count == len(refused)
