"""Publishers, subscriptions, requests and presence over a real router."""

import asyncio
import signal
import struct
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
import zenoh
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh import reason_codes as codes
from robomesh.contract.endpoints import client_config, router_config
from robomesh.contract.header import Header, pack
from robomesh.errors import NoAnswerError, RefusedError, SessionError
from robomesh.publications import subscription as subscription_module
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.presence import MOST_OF_ONE, name_of
from robomesh.wire.session import SessionSettings, open_session
from tests.conftest import put_unheard
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import until
from tests.refusals import refused


def joints(value: float) -> JointStates:
    message = JointStates()
    message.joints.add(name="waist", position=value)
    return message


async def answered(session, key):
    """Wait until a query on the first link finds a publisher: nothing confirms its declarations there."""
    while not await asyncio.to_thread(lambda: [*session.zenoh_session.get(key)]):
        pass


async def test_publication_arrives_with_key_number_and_source_time(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        subscription = monitor.subscribe("robomesh/*/*/joints", newest=10)
        publisher = gateway.declare_publisher("site", "arm", "joints")
        await until(lambda: publisher.watched)
        publisher.put(joints(1.0), source_time_ns=123)
        publisher.put(joints(2.0))
        first, second = await anext(subscription), await anext(subscription)
        assert first.parsed == ("site", "arm", "joints")
        assert first.message() == joints(1.0)
        assert first.header.source_time_ns == 123
        assert second.header.sequence == first.header.sequence + 1
        assert second.header.publisher == first.header.publisher
        assert subscription.age_s(first.key) < 5.0


async def test_value_published_during_its_query_is_live(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        publisher = gateway.declare_publisher("site", "arm", "joints")
        publisher.put(joints(1.0))
        # Simulates the middle of `put`: the reply has the value before its publication.
        put_unheard(publisher, joints(2.0))
        await answered(monitor, publisher.key)
        subscription = monitor.subscribe("robomesh/site/arm/joints", newest=10)
        answer = await anext(subscription)
        assert (answer.live, answer.message()) == (False, joints(2.0))
        # The query may overtake the subscription's declaration: they use different connections.
        await until(lambda: publisher.watched)
        for _ in range(2):
            publisher._publisher.put(answer.payload, attachment=pack(answer.header))
        publisher.put(joints(3.0))
        arrived = [await anext(subscription) for _ in range(2)]
        assert [(each.live, each.message()) for each in arrived] == [
            (True, joints(2.0)),
            (True, joints(3.0)),
        ]
        assert subscription.age_s(answer.key) is not None
        assert subscription.lost(answer.key) == 0


async def test_live_samples_overtaken_by_a_reply_are_not_lost(mesh, monkeypatch):
    monkeypatch.setattr(subscription_module, "_EARLY_S", 3.0)
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        publisher = gateway.declare_publisher("site", "arm", "joints")
        states = monitor.subscribe("robomesh/site/arm/joints", newest=10)
        await until(lambda: publisher.watched)
        publisher.put(joints(1.0))
        # The first query may be answered with the value, which arrives once more then.
        while not (first := await anext(states)).live:
            pass
        for value in (2.0, 3.0, 4.0):
            put_unheard(publisher, joints(value))
        is_early, loop, answered = states._is_early, asyncio.get_running_loop(), asyncio.Event()

        def read_answer(reply):
            loop.call_soon_threadsafe(answered.set)
            return is_early(reply)

        states._is_early = read_answer
        states.refresh("site", "arm")
        await answered.wait()
        for more, value in ((1, 2.0), (2, 3.0)):
            header = first.header._replace(sequence=first.header.sequence + more)
            publisher._publisher.put(joints(value).SerializeToString(), attachment=pack(header))
        arrived = [await anext(states) for _ in range(3)]
        # The last one never arrives live, so the reply counts.
        assert [(each.live, each.message().joints[0].position) for each in arrived] == [
            *((True, 2.0), (True, 3.0), (False, 4.0))
        ]
        assert states.lost(first.key) == 0


async def test_late_joiner_gets_the_last_state_with_unknown_age(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        publisher = gateway.declare_publisher("site", "arm", "joints")
        publisher.put(joints(1.0))
        publisher.put(joints(2.0))
        # The second may still be on its way during the first query.
        while await monitor.last("robomesh/site/arm/joints") != joints(2.0):
            pass
        subscription = monitor.subscribe("robomesh/site/arm/joints")
        sample = await anext(subscription)
        assert sample.message() == joints(2.0)
        assert not sample.live
        assert subscription.age_s(sample.key) is None
        publisher.put(joints(3.0))
        sample = await anext(subscription)
        assert (sample.live, sample.message()) == (True, joints(3.0))
        assert subscription.lost(sample.key) == 0


async def test_plain_zenoh_get_has_one_reply_with_24_bytes_attached(mesh):
    async with open_session(mesh) as gateway:
        publisher = gateway.declare_publisher("site", "arm", "joints")
        header = publisher.put(joints(2.0), source_time_ns=7)
        with zenoh.open(client_config(mesh.connect)) as plain:
            replies = await asyncio.to_thread(lambda: list(plain.get("robomesh/site/arm/joints")))
        (reply,) = replies
        assert str(reply.ok.encoding) == "application/protobuf"
        assert struct.unpack("<QQq", reply.ok.attachment.to_bytes()) == header
        assert JointStates.FromString(reply.ok.payload.to_bytes()) == joints(2.0)


async def test_list_arrives_complete_before_later_messages_without_duplicates(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        publisher = gateway.declare_publisher("site", "arm", "events")
        for number in range(150):
            publisher.put(schema.Event(code=str(number)))
        await answered(monitor, publisher.key)
        subscription = monitor.subscribe("robomesh/site/arm/events", newest=1000)
        for number in range(150, 200):
            publisher.put(schema.Event(code=str(number)))
        codes: list[str] = []
        while not codes or codes[-1] != "199":
            sample = await anext(subscription)
            message = sample.message()
            codes += [message.code] if sample.live else [event.code for event in message.events]
        assert codes == [str(number) for number in range(200 - len(codes), 200)]
        assert len(codes) >= 100


async def test_the_last_list_is_returned_although_messages_follow_it(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        publisher = gateway.declare_publisher("site", "arm", "events")
        publisher.put(schema.Event(code="first"))
        await answered(monitor, publisher.key)

        async def flood():
            while True:
                publisher.put(schema.Event(code="more"))
                await asyncio.sleep(0.001)

        task = asyncio.create_task(flood())
        for _ in range(10):
            history = await monitor.last("robomesh/site/arm/events", timeout_s=40.0)
            assert history is not None
        task.cancel()


async def test_late_joiner_of_a_video_gets_the_frames_since_the_last_key_frame(mesh):
    from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

    async with open_session(mesh) as renderer, open_session(mesh) as monitor:
        publisher = renderer.declare_publisher("site", "arm", "video/top")
        publisher.put(CompressedVideo(data=b"lost"))
        for data in (b"K1", b"P1", b"K2", b"P2", b"P3"):
            publisher.put(CompressedVideo(data=data), key_frame=data.startswith(b"K"))
        await answered(monitor, publisher.key)
        sample = await anext(monitor.subscribe("robomesh/site/arm/video/top", newest=100))
        frames = sample.message().frames
        assert [CompressedVideo.FromString(frame.data).data for frame in frames] == [b"K2", b"P2", b"P3"]
        assert frames[-1].sequence == sample.header.sequence


async def test_slow_consumer_keeps_the_newest_and_delays_no_other(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        slow = monitor.subscribe("robomesh/site/arm/joints", newest=3)
        quick = monitor.subscribe("robomesh/site/arm/frames", newest=1000)
        publisher = gateway.declare_publisher("site", "arm", "joints")
        frames = gateway.declare_publisher("site", "arm", "frames")
        await until(lambda: publisher.watched and frames.watched)
        for number in range(200):
            publisher.put(joints(number))
            frames.put(quick.topic.schema())
        got = [(await anext(quick)).header.sequence for _ in range(200)]
        assert got == list(range(1, 201))
        await until(lambda: slow.skipped == 197)
        assert [(await anext(slow)).message().joints[0].position for _ in range(3)] == [197, 198, 199]
        assert slow.lost("robomesh/site/arm/joints") == 0


async def test_samples_within_a_pause_arrive_in_order_whichever_thread_reads(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        states = monitor.subscribe("robomesh/site/arm/joints", newest=1000, history=False)
        publisher = gateway.declare_publisher("site", "arm", "joints")
        await until(lambda: publisher.watched)
        came, sent = [], 0

        async def take():
            while samples := await states.next_batch(pause_s=0.05):
                came.extend(sample.message() for sample in samples)

        taking = asyncio.create_task(take())
        await until(lambda: states._pause_s)
        for _ in range(3):
            while not states._read_by_loop:  # several samples in a pause
                for _ in range(3):
                    publisher.put(joints(float(sent)))
                    sent += 1
                await asyncio.sleep(0.01)
            publisher.put(joints(float(sent)))
            sent += 1
            while len(came) < sent or states._read_by_loop:
                await asyncio.sleep(0.01)
        assert came == [joints(float(each)) for each in range(sent)]
        assert states.missed(publisher.key) == 0
        states.close()
        await taking


async def test_a_consumer_that_pauses_hears_of_the_end(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        states = monitor.subscribe("robomesh/site/arm/joints", newest=1000, history=False)
        publisher = gateway.declare_publisher("site", "arm", "joints")
        await until(lambda: publisher.watched)
        while not states._read_by_loop:
            waiting = asyncio.create_task(states.next_batch(pause_s=0.05))
            await until(lambda: states._pause_s)
            for each in range(3):
                publisher.put(joints(float(each)))
            assert await waiting
        states.close()
        while await states.next_batch(pause_s=0.05):
            pass
        await asyncio.to_thread(states.join)


async def test_a_subscription_that_is_closed_in_a_flood_ends_its_thread_without_an_error(mesh):
    async with open_session(mesh) as session:
        publisher = session.declare_publisher("site", "arm", "joints")
        flooding = True

        def flood():
            while flooding:
                publisher.put(joints(0.1))

        flooded = asyncio.create_task(asyncio.to_thread(flood))
        try:
            for _ in range(50):
                states = session.subscribe("robomesh/site/arm/joints", history=False)
                async with asyncio.timeout(30.0):
                    assert await states.next_batch()
                states.close()
                await asyncio.to_thread(states.join)
        finally:
            flooding = False
            await flooded


async def test_messages_put_together_keep_their_order_and_leave_before_the_end(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        states = monitor.subscribe("robomesh/site/*/joints", newest=10, history=False)
        one = gateway.declare_publisher("site", "one", "joints", together=True)
        two = gateway.declare_publisher("site", "two", "joints", together=True)
        await until(lambda: one.watched and two.watched)
        sent = [(one, 0.0), (two, 1.0), (one, 2.0), (two, 3.0)]
        for publisher, position in sent:
            publisher.put(joints(position))
        two.close()
        came = [await anext(states) for _ in sent]
        assert [(each.key, each.message()) for each in came] == [
            (publisher.key, joints(position)) for publisher, position in sent
        ]


async def test_gap_in_the_numbers_is_counted_as_lost(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        subscription = monitor.subscribe("robomesh/site/arm/joints", newest=10)
        publisher = gateway.declare_publisher("site", "arm", "joints")
        await until(lambda: publisher.watched)
        publisher.put(joints(1))
        publisher._sequence += 5  # a full link drops messages silently
        publisher.put(joints(2))
        assert [(await anext(subscription)).message().joints[0].position for _ in range(2)] == [1, 2]
        assert subscription.lost(publisher.key) == 5


async def test_what_was_published_before_the_subscription_was_known_is_not_lost(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        publisher = gateway.declare_publisher("site", "arm", "joints")
        publisher.remember(joints(1), source_time_ns=1)
        subscription = monitor.subscribe("robomesh/site/arm/joints", newest=10)
        assert not (await anext(subscription)).live
        await until(lambda: publisher.watched)
        publisher._sequence += 147
        publisher.put(joints(2))
        assert (await anext(subscription)).live
        assert subscription.lost(publisher.key) == 0
        publisher._sequence += 5
        publisher.put(joints(3))
        await anext(subscription)
        assert subscription.lost(publisher.key) == 5


async def test_a_publisher_that_answers_too_late_is_queried_again(mesh, monkeypatch):
    monkeypatch.setattr(subscription_module, "_ANSWER_S", 0.3)
    payload = schema.Description(name="busy").SerializeToString()
    missed, key = [], "robomesh/site/busy/description"

    def answer(query):
        if len(missed) < 2:
            missed.append(query)  # while it is kept, Zenoh waits for its answer
        else:
            query.reply(key, payload, attachment=pack(Header(7, 1, 0)))
            query.drop()

    async with open_session(mesh) as busy, open_session(mesh) as quick, open_session(mesh) as monitor:
        publisher = quick.declare_publisher("site", "quick", "description")
        publisher.remember(schema.Description(name="quick"), source_time_ns=1)
        queryable = busy.zenoh_session.declare_queryable(key, answer)
        try:
            await answered(monitor, publisher.key)
            subscription = monitor.subscribe("robomesh/*/*/description", newest=10)
            assert {(await anext(subscription)).message().name for _ in range(2)} == {"quick", "busy"}
            assert subscription.lost(key) == 0
        finally:
            queryable.undeclare()


async def test_first_put_and_get_on_the_second_link_wait_for_their_declarations(mesh):
    async with open_session(mesh) as monitor:
        subscription = monitor.subscribe("robomesh/*/*/description", newest=100, history=False)
        for number in range(30):
            async with open_session(mesh) as gateway, open_session(mesh) as joiner:
                publisher = gateway.declare_publisher("site", f"arm-{number}", "description")
                publisher.put(schema.Description(name=str(number)))
                assert (await anext(subscription)).message().name == str(number)
                late = joiner.subscribe(publisher.key)
                assert (await anext(late)).message().name == str(number)


async def test_publisher_restarted_during_an_outage_is_queried_again(mesh):
    async with open_session(mesh) as monitor:
        subscription = monitor.subscribe("robomesh/site/arm/description", newest=10)
        async with open_session(mesh) as first:
            first.declare_presence("site", "arm", "kinematics")
            publisher = first.declare_publisher("site", "arm", "description")
            await until(lambda: publisher.watched)
            publisher.put(schema.Description(name="first"))
            assert (await anext(subscription)).message().name == "first"
        async with open_session(mesh) as second:
            # Simulates an outage: its put was lost, only its presence arrives.
            publisher = second.declare_publisher("site", "arm", "description")
            publisher.remember(schema.Description(name="second"), source_time_ns=1)
            second.declare_presence("site", "arm", "kinematics")
            assert (await anext(subscription)).message().name == "second"


async def test_list_entries_lost_in_an_outage_arrive_with_the_reply_or_are_counted(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        subscription = monitor.subscribe("robomesh/site/arm/events", newest=1000)
        # Its first query must end before event 1, so that no reply contains it.
        await until(lambda: subscription._waiting is None)
        publisher = gateway.declare_publisher("site", "arm", "events")
        publisher.put(schema.Event(code="1"))
        assert (await anext(subscription)).message().code == "1"
        for number in range(2, 152):
            put_unheard(publisher, schema.Event(code=str(number)))
        gateway.declare_presence("site", "arm", "gateway")
        sample = await anext(subscription)
        assert [event.code for event in sample.message().events] == [str(n) for n in range(52, 152)]
        assert subscription.lost(publisher.key) == 50
        publisher.put(schema.Event(code="152"))
        assert (await anext(subscription)).message().code == "152"
        assert subscription.lost(publisher.key) == 50


async def answer_lease(request: Request):
    if request.message.ttl_s > 5:
        raise RefusedError(f"ttl_s {request.message.ttl_s:g} is too long: 0.5 to 5")
    return schema.LeaseAnswer(holder=request.chunk)


async def test_request_is_answered_or_refused_with_a_sentence(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as operator:
        gateway.answer("site", "arm", "lease/request/*", answer_lease)
        key = "robomesh/site/arm/lease/request/li"
        acquire = schema.LeaseRequest(action=schema.LeaseRequest.ACQUIRE)
        answer = await operator.ask(key, acquire)
        assert answer.holder == "li"
        acquire.ttl_s = 9
        with pytest.raises(RefusedError, match="ttl_s 9 is too long"):
            await operator.ask(key, acquire)
        with refused(codes.FIELD_UNSET, field="action"):
            await operator.ask(key, schema.LeaseRequest())
        acquire.ttl_s = float("nan")
        with refused(codes.FIELD_NOT_FINITE, field="ttl_s"):
            await operator.ask(key, acquire)
        with refused(codes.WILDCARD):
            await operator.ask("robomesh/site/*/lease/request/li", acquire)
        with pytest.raises(NoAnswerError, match="no answer"):
            await operator.ask("robomesh/site/other/lease/request/li", acquire, timeout_s=0.5)


async def test_json_request_has_a_json_answer_with_proto_names_and_defaults(mesh):
    async with open_session(mesh) as gateway:
        gateway.answer("site", "arm", "lease/request/*", answer_lease)
        with zenoh.open(client_config(mesh.connect)) as plain:

            def get(payload, encoding):
                replies = list(
                    plain.get("robomesh/site/arm/lease/request/li", payload=payload, encoding=encoding)
                )
                return replies[0]

            reply = await asyncio.to_thread(get, '{"action":"ACQUIRE","ttl_s":1.5}', "application/json")
            text = reply.ok.payload.to_string()
            assert '"holder":"li"' in text.replace(" ", "")
            assert '"lease":""' in text.replace(" ", "")
            assert str(reply.ok.encoding) == "application/json"
            for payload, code in (
                ('{"action":"ACQUIRE","ttl_s":"NaN"}', "request.field_not_finite&cause.field=ttl_s"),
                ('{"action":"GRAB"}', "request.field_not_one_of&cause.field=action&cause.value=GRAB"),
                ("{", "request.not_json"),
                ("[1]", "request.not_json_object"),
                ('{"actoin":"ACQUIRE"}', "request.unknown_field&cause.request=LeaseRequest"),
                ("{}", "request.field_unset&cause.field=action"),
            ):
                reply = await asyncio.to_thread(get, payload, None)
                assert f"text/plain;code=request.invalid&cause.code={code}" in str(reply.err.encoding)


async def test_slow_request_does_not_delay_the_next(mesh):
    gate = asyncio.Event()

    async def answer(request: Request):
        if request.chunk == "slow":
            await gate.wait()
        return schema.CommandAnswer(accepted=True, text=request.chunk)

    async with open_session(mesh) as gateway, open_session(mesh) as operator:
        gateway.answer("site", "arm", "command/*", answer)
        command = schema.CommandRequest(command=schema.CommandRequest.HOME)
        slow = asyncio.create_task(operator.ask("robomesh/site/arm/command/slow", command))
        quick = await operator.ask("robomesh/site/arm/command/quick", command)
        assert quick.text == "quick"
        gate.set()
        assert (await slow).text == "slow"


async def test_query_for_everything_stops_no_robot_but_wildcard_stop_stops_all(mesh):
    stopped = []

    async def stop(request: Request):
        stopped.append(request.key.robot)
        return schema.StopAnswer(stop_id=1)

    async with open_session(mesh) as gateway, open_session(mesh) as operator:
        for robot in ("arm-1", "arm-2"):
            gateway.answer("site", robot, "stop", stop)
        with zenoh.open(client_config(mesh.connect)) as plain:
            assert await asyncio.to_thread(lambda: list(plain.get("robomesh/**"))) == []
            assert stopped == []
            plain_stop = lambda: list(plain.get("robomesh/site/arm-1/stop", payload="{not json"))  # noqa: E731
            assert (await asyncio.to_thread(plain_stop))[0].ok is not None
        assert stopped.pop() == "arm-1"
        answers = await operator.ask_all("robomesh/*/*/stop", schema.StopRequest())
        assert sorted(stopped) == ["arm-1", "arm-2"]
        assert sorted(answer.key for answer in answers) == [
            "robomesh/site/arm-1/stop",
            "robomesh/site/arm-2/stop",
        ]


_ROUTER = """
import sys, zenoh
from robomesh.contract.endpoints import router_config
with zenoh.open(router_config((sys.argv[1],))):
    sys.stdin.read()
"""


@pytest.mark.processes
async def test_router_without_a_reply_is_not_taken_for_an_empty_mesh():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    command = (sys.executable, "-c", _ROUTER, endpoint)
    router = await asyncio.create_subprocess_exec(
        *command, stdin=subprocess.PIPE, cwd=Path(__file__).parents[2]
    )
    try:
        async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
            assert await session.present() == []
            router.send_signal(signal.SIGSTOP)
            try:
                with pytest.raises(NoAnswerError, match="live services"):
                    await session.present()
            finally:
                router.send_signal(signal.SIGCONT)
    finally:
        await router.communicate(b"")


async def test_session_that_watches_presence_still_lists_every_token(mesh):
    async with open_session(mesh) as monitor, open_session(mesh) as service:
        for robot in "abc":
            service.declare_presence("site", robot, "gateway")
        watch = monitor.watch_presence()
        for _ in range(3):
            await anext(watch)
        for _ in range(500):
            assert [who.robot for who in await monitor.present()] == ["a", "b", "c"]
            await asyncio.sleep(0.001)


async def test_presence_appears_and_disappears(mesh):
    async with open_session(mesh) as monitor:
        watch = monitor.watch_presence()
        async with open_session(mesh) as service:
            service.declare_presence("site", "arm", "gateway")
            key, alive = await anext(watch)
            assert (key.site, key.robot, key.service, alive) == ("site", "arm", "gateway", True)
            # A new router may list fewer tokens than it has reported.
            while await monitor.present() != [key]:
                await asyncio.sleep(0.01)
        key, alive = await anext(watch)
        assert (key.service, alive) == ("gateway", False)


async def test_many_sessions_of_one_name_hide_neither_services_nor_other_names(mesh):
    async with open_session(mesh) as monitor, open_session(mesh) as eve, open_session(mesh) as li:
        watch = monitor.watch_presence()
        tokens = [
            eve.declare_presence_of("site", "arm", "operator", f"eve.{number:016x}") for number in range(300)
        ]
        tokens.append(li.declare_presence_of("site", "arm", "operator", "li.0"))
        li.declare_presence("site", "arm", "gateway")
        reported = set()
        while len(reported) < MOST_OF_ONE + 2:
            reported.add((await anext(watch))[0])
        assert Counter(map(name_of, reported)) == {"eve": MOST_OF_ONE, "li": 1, li.identity: 1}
        assert [who.service for who in await monitor.present()] == ["gateway"]
        sessions, complete = await monitor.present_sessions()
        assert not complete
        assert Counter(map(name_of, sessions)) == {"eve": MOST_OF_ONE, "li": 1}
        for token in tokens:
            token.undeclare()
        while len(reported) > 1:
            key, alive = await anext(watch)
            assert not alive
            reported.remove(key)
        assert {who.service for who in reported} == {"gateway"}
        while await monitor.present_sessions() != ([], True):
            await asyncio.sleep(0.01)


async def test_session_waits_for_its_router_and_survives_its_restart():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    settings = SessionSettings(connect=(endpoint,), wait_s=10.0)

    async def gateway(opened: asyncio.Event, end: asyncio.Event):
        async with open_session(settings) as session:
            publisher = session.declare_publisher("site", "arm", "description")
            session.declare_presence("site", "arm", "kinematics")
            publisher.put(schema.Description(name="before"))
            opened.set()
            await end.wait()
            publisher.put(schema.Description(name="while the router was away"))
            opened.clear()
            while not opened.is_set():
                await asyncio.sleep(0.01)

    opened, end = asyncio.Event(), asyncio.Event()
    task = asyncio.create_task(gateway(opened, end))
    await asyncio.sleep(0.3)
    assert not opened.is_set()
    router = zenoh.open(router_config((endpoint,)))
    await opened.wait()
    async with open_session(settings) as monitor:
        subscription = monitor.subscribe("robomesh/*/*/description")
        assert (await anext(subscription)).message().name == "before"
        await asyncio.to_thread(router.close)
        await until(lambda: not monitor.connected)
        end.set()
        await until(lambda: not opened.is_set())
        router = zenoh.open(router_config((endpoint,)))
        assert (await anext(subscription)).message().name == "while the router was away"
        opened.set()
        await task
    await asyncio.to_thread(router.close)


async def test_a_service_that_starts_while_its_router_reopens_answers_stops():
    endpoint = f"tcp/127.0.0.1:{free_port()}"

    def reopened() -> zenoh.Session:
        time.sleep(0.5)
        return zenoh.open(router_config((endpoint,)))

    router = zenoh.open(router_config((endpoint,)))
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=10.0)) as gateway:
        await asyncio.to_thread(router.close)
        reopening = asyncio.create_task(asyncio.to_thread(reopened))
        await asyncio.sleep(0.1)
        gateway.answer("site", "arm", "stop", answer_lease)
        router = await reopening
    await asyncio.to_thread(router.close)


async def test_missing_router_is_one_line_with_advice():
    settings = SessionSettings(connect=(f"tcp/127.0.0.1:{free_port()}",), wait_s=0.0)
    with pytest.raises(SessionError, match=r"no router at tcp/127\.0\.0\.1:.*robomesh up"):
        async with open_session(settings):
            pass
    with pytest.raises(SessionError, match="'nonsense' is not an endpoint: one is tcp/"):
        async with open_session(SessionSettings(connect=("nonsense",), wait_s=0.0)):
            pass
    with pytest.raises(SessionError, match="no router at tcp/"):
        async with open_session(SessionSettings(connect=("tcp/no..name:7447",), wait_s=0.0)):
            pass
