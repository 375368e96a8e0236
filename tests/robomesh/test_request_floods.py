"""Floods of requests to one owner."""

import asyncio
import contextlib
import time

import pytest

from robomesh.contract.keys import Key
from robomesh.contract.messages import PROTOBUF
from robomesh.errors import BusyError
from robomesh.requests import request_queue
from robomesh.requests.request_queue import RateLimit, begin_now, paced, spilling
from robomesh.requests.requests import ask_all
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from tests.protocol_gateway.gateway_site import until

HOME = schema.CommandRequest(command=schema.CommandRequest.HOME)


class Owner:
    """An owner that begins every request, and answers when `go_on` is set."""

    def __init__(self, session):
        self.begun, self.go_on = [], asyncio.Event()
        self.begun_before_stop = self.begun_before_other = None
        self.commands = session.answer("site", "arm", "command/*", self._wait)
        self.commands_of_other = session.answer("site", "other", "command/*", self._of_other)
        session.answer("site", "arm", "video/*/keyframe/*", self._key_frame)
        self.remembered, self.stopped = None, 0
        self.stops = session.answer("site", "arm", "stop", self._stop, recall=lambda: self.remembered)

    async def _wait(self, request: Request):
        if request.chunk != "ready":
            self.begun.append(request.chunk)
            await self.go_on.wait()
        return schema.CommandAnswer(accepted=True)

    async def _key_frame(self, request: Request):
        self.begun.append(request.asker)
        await self.go_on.wait()
        return schema.KeyFrameAnswer()

    async def _of_other(self, request: Request):
        self.begun_before_other = len(self.begun)
        return schema.CommandAnswer(accepted=True)

    async def _stop(self, request: Request):
        self.begun_before_stop = len(self.begun)
        self.stopped += 1
        return schema.StopAnswer(stop_id=1, sent=True)


@contextlib.asynccontextmanager
async def site(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as eve, open_session(mesh) as li:
        owner = Owner(gateway)
        # Wait until the router knows the owner; earlier requests would get no answer.
        await li.ask("robomesh/site/arm/command/ready", HOME, timeout_s=20.0)
        yield owner, eve, li


def once(session, name, what="command"):
    """Send a request without repeating it, like a flooding client."""
    key = Key("site", "arm", f"{what}/{name}")
    payload = HOME.SerializeToString() if what == "command" else b""
    return asyncio.create_task(ask_all(session.zenoh_session, key, payload, timeout_s=60.0))


def block_until(condition):
    """Wait while blocking the event loop, so that requests queue up."""
    deadline = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def flood_while_the_loop_is_blocked(owner, session):
    """Fill the owner's queue with requests that its event loop has not seen; keep the result alive."""
    keys = [f"robomesh/site/arm/command/eve-{number}" for number in range(600)]
    payload = HOME.SerializeToString()
    asked = [session.zenoh_session.get(key, payload=payload, encoding=PROTOBUF) for key in keys]
    block_until(lambda: owner.commands.turned_away >= 600 - 256)
    return asked


def is_busy(task):
    return task.done() and isinstance(task.result()[0][2], BusyError)


async def test_flooding_caller_fills_only_its_own_share(mesh):
    async with site(mesh) as (owner, eve, li):
        asked = [once(eve, "eve") for _ in range(500)]
        await until(lambda: sum(map(is_busy, asked)) >= 480)
        other = asyncio.create_task(li.ask("robomesh/site/arm/command/li", HOME, timeout_s=20.0))
        await until(lambda: "li" in owner.begun)
        assert (await li.ask("robomesh/site/arm/stop", schema.StopRequest())).sent
        owner.go_on.set()
        assert (await other).accepted
        await asyncio.gather(*asked)
        assert sum(map(is_busy, asked)) + owner.begun.count("eve") == 500
        assert owner.begun.count("eve") == 16


def stops(session, number):
    """Send stops without waiting, and return their answers' queues; keep them alive."""
    payload = schema.StopRequest(by="eve").SerializeToString()
    key = "robomesh/site/arm/stop"
    return [session.zenoh_session.get(key, payload=payload, encoding=PROTOBUF) for _ in range(number)]


async def test_repeated_stops_are_answered_while_the_loop_is_blocked_and_counted(mesh):
    async with site(mesh) as (owner, eve, li):
        owner.remembered = schema.StopAnswer(stop_id=7, sent=True)
        asked = stops(eve, 500)
        # The first one waits for the loop.
        answers = [schema.StopAnswer.FromString(each.recv().ok.payload.to_bytes()) for each in asked[1:]]
        assert answers == [owner.remembered] * 499
        count, newest, answer = owner.stops.take_repeated()
        assert (count, newest.by, answer.stop_id, owner.stopped) == (499, "eve", 7, 0)
        assert owner.stops.take_repeated() is None
        await until(lambda: owner.stopped == 1)
        # The owner handles a stop that repeats nothing in flight: it decides whether it is a new one.
        assert (await li.ask("robomesh/site/arm/stop", schema.StopRequest())).stop_id == 1
        assert owner.stopped == 2


async def test_stops_that_wait_for_the_loop_are_limited(mesh):
    async with site(mesh) as (owner, eve, _):
        asked = stops(eve, 600)
        block_until(lambda: owner.stops.turned_away == 600 - 256)
        await until(lambda: owner.stopped == 256)
        assert (len(asked), owner.stops.take_repeated()) == (600, None)


async def test_flood_with_many_names_is_limited(mesh):
    async with site(mesh) as (owner, eve, li):
        asked = [once(eve, f"eve-{number}") for number in range(600)]
        await until(lambda: sum(map(is_busy, asked)) == 600 - 256)
        assert (await li.ask("robomesh/site/arm/stop", schema.StopRequest())).sent
        owner.go_on.set()
        await asyncio.gather(*asked)
        assert len(owner.begun) == 256


async def test_flood_with_one_name_has_one_share_over_all_views(mesh):
    async with site(mesh) as (owner, eve, li):
        asked = [once(eve, "eve", f"video/view-{number}/keyframe") for number in range(40)]
        await until(lambda: sum(map(is_busy, asked)) == 40 - 16)
        other = once(li, "li", "video/view-1/keyframe")
        await until(lambda: "li" in owner.begun)
        owner.go_on.set()
        await asyncio.gather(*asked, other)
        assert len(owner.begun) == 17


async def test_request_to_a_busy_owner_is_repeated_and_handled_once(mesh):
    async with site(mesh) as (owner, eve, li):
        asked = [once(eve, "li") for _ in range(16)]
        await until(lambda: len(owner.begun) >= 16)
        key = "robomesh/site/arm/command/li"
        with pytest.raises(BusyError, match="too many requests are waiting"):
            await li.ask(key, HOME, timeout_s=0.3)
        patient = asyncio.create_task(li.ask(key, HOME, timeout_s=20.0))
        await asyncio.sleep(0.2)
        assert len(owner.begun) == 16
        owner.go_on.set()
        assert (await patient).accepted
        await asyncio.gather(*asked)
        assert len(owner.begun) == 17


async def test_stop_begins_before_earlier_requests(mesh):
    async with site(mesh) as (owner, eve, li):
        asked = flood_while_the_loop_is_blocked(owner, eve)
        stop = li.zenoh_session.get("robomesh/site/arm/stop")
        block_until(lambda: owner.stops.waiting)
        await until(lambda: owner.begun_before_stop is not None)
        assert owner.begun_before_stop <= 2
        owner.go_on.set()
        await until(lambda: len(owner.begun) == 256)
        del asked, stop


async def test_flood_for_one_robot_does_not_delay_another_robot(mesh):
    async with site(mesh) as (owner, eve, li):
        asked = flood_while_the_loop_is_blocked(owner, eve)
        other = li.zenoh_session.get(
            "robomesh/site/other/command/li", payload=HOME.SerializeToString(), encoding=PROTOBUF
        )
        block_until(lambda: owner.commands_of_other.waiting)
        await until(lambda: owner.begun_before_other is not None)
        assert owner.begun_before_other <= 3
        owner.go_on.set()
        await until(lambda: len(owner.begun) == 256)
        del asked, other


def test_rate_limit_allows_a_burst_and_then_its_rate():
    limit = RateLimit(per_s=10.0, burst=3)
    assert [limit.take(5.0) for _ in range(5)] == [True, True, True, False, False]
    assert [limit.take(5.1), limit.take(5.1), limit.take(5.2)] == [True, False, True]
    assert [limit.take(99.0) for _ in range(4)] == [True, True, True, False]


async def test_begin_now_runs_to_the_first_wait_and_continues_in_a_task():
    loop, seen, go_on = asyncio.get_running_loop(), [], asyncio.Event()

    async def work():
        try:
            seen.append("begun")
            await go_on.wait()
            await asyncio.sleep(0)
            seen.append("done")
        except asyncio.CancelledError:
            seen.append("cancelled")
            raise

    task = begin_now(loop, work())
    assert seen == ["begun"]
    go_on.set()
    await task
    assert begin_now(loop, asyncio.sleep(0)) is not None
    go_on.clear()
    task = begin_now(loop, work())
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert seen == ["begun", "done", "begun", "cancelled"]


def test_a_flood_in_the_background_waits_longer_at_its_sender():
    taken = []
    take = paced(taken.append, in_background=True)
    began_s = time.monotonic()
    for _ in range(100):
        take(None)
    assert len(taken) == 100
    assert time.monotonic() - began_s >= 0.02


async def test_a_flood_that_must_not_block_waits_in_a_ring_which_drops_the_oldest():
    taken, most = [], request_queue._RING + request_queue._BATCH
    take = spilling(taken.append)
    for number in range(2 * most):  # before the event loop runs again
        take(number)
    at_once = len(taken)
    # After a longer pause than a millisecond a few more are taken at once.
    assert request_queue._BATCH <= at_once < most
    await until(lambda: len(taken) == at_once + request_queue._RING)
    assert taken[at_once:] == [*range(2 * most - request_queue._RING, 2 * most)]
    await asyncio.sleep(0.01)
    take("after")
    assert taken[-1] == "after"
