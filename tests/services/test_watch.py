"""The watch of a site over a real router: alarms, acknowledgements, and the state of the mesh."""

import asyncio
import time
from contextlib import asynccontextmanager

import pytest
import zenoh

from robomesh import reason_codes as codes
from robomesh.contract.endpoints import router_config
from robomesh.contract.messages import reason_message
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.clock import answer_clock
from robomesh.service.health import Served, present
from robomesh.wire.session import SessionSettings, open_session
from services.watch.watch import Settings, serve
from tests.ports import free_port
from tests.refusals import refused

State = schema.ControllerState
Alarm, Request = schema.Alarm, schema.AlarmRequest


class WatchClient:
    """A page's view: the newest alarms and mesh state, and all events of the watch."""

    def __init__(self, session):
        self.session = session
        self.alarms, self.mesh, self.events = {}, schema.MeshState(), []
        self.working = []

    async def follow(self):
        async with asyncio.TaskGroup() as group:
            for topic in ("alarms", "mesh", "events/watch"):
                group.create_task(self._follow(self.session.subscribe(f"robomesh/s/-/{topic}", newest=100)))

    async def _follow(self, subscription):
        async for sample in subscription:
            message = sample.message()
            match message:
                case schema.AlarmList():
                    self.alarms = {each.id: each for each in message.alarms}
                case schema.MeshState():
                    self.mesh = message
                case schema.Event():
                    self.events.append(message)
                case schema.EventList():
                    self.events += message.events

    async def until(self, condition, timeout_s=30.0):
        try:
            async with asyncio.timeout(timeout_s):
                while not condition():
                    for task in self.working:
                        if task.done():
                            task.result()  # raises the error that ended it
                    await asyncio.sleep(0.02)
        except TimeoutError:
            raise AssertionError(f"{self.alarms}\n{self.mesh}\n{self.events}") from None

    async def ask(self, by="li.s", **request):
        answer = await self.session.ask(
            f"robomesh/s/-/alarms/request/{by}", Request(**request), timeout_s=40.0
        )
        return {each.id: each for each in answer.alarms}

    async def until_present(self, service):
        """Wait until the watch has seen that service."""
        await self.until(lambda: any(each.service == service for each in self.mesh.services))
        message = self.mesh.timestamp.ToNanoseconds()
        await self.until(lambda: self.mesh.timestamp.ToNanoseconds() > message)

    def codes(self):
        return [event.code for event in self.events]


@asynccontextmanager
async def watched(mesh, folder, *, settled_s=0.2):
    """Run a watch of site `s`, and a page that follows it."""
    async with open_session(mesh) as own, open_session(mesh) as others:
        client = WatchClient(others)
        served = Served(service="watch", present_for=(("s", "-"),))
        async with present(own, served):
            tasks = client.working = [
                asyncio.create_task(serve(own, Settings(site="s", folder=folder, settled_s=settled_s))),
                asyncio.create_task(client.follow()),
            ]
            try:
                yield client
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)


@asynccontextmanager
async def controller(session, **state):
    """Publish a gateway's `controller` of robot `arm` repeatedly; the test may change the state."""
    publisher = session.declare_publisher("s", "arm", "controller")
    message = State(**({"link": State.UP, "activity": State.IDLE, "mode": State.REMOTE} | state))

    async def tell():
        while True:
            publisher.put(message)
            await asyncio.sleep(0.2)

    task = asyncio.create_task(tell())
    try:
        yield message
    finally:
        task.cancel()


def event(severity, code, text="something", **values):
    message = schema.Event(severity=severity, code=code, text=text, source="test", values=values)
    message.timestamp.GetCurrentTime()
    return message


async def test_a_link_that_is_down_is_an_alarm_until_it_is_up_and_seen(mesh, tmp_path):
    async with (
        watched(mesh, tmp_path) as client,
        open_session(mesh) as gateway,
        controller(
            gateway,
            link=State.DOWN,
            link_text="connecting to 10.0.0.7:5400",
            link_reasons=[reason_message(codes.LINK_CONNECTING(where="10.0.0.7:5400"))],
        ) as state,
    ):
        await client.until(lambda: "arm:link" in client.alarms)
        alarm = client.alarms["arm:link"]
        assert alarm.cause == state.link_reasons[0]
        assert (alarm.site, alarm.robot, alarm.code) == ("s", "arm", "link.down")
        assert (alarm.priority, alarm.state) == (Alarm.HIGH, Alarm.UNACKNOWLEDGED)
        assert "10.0.0.7:5400" in alarm.text
        assert alarm.advice
        answered = await client.ask(action=Request.ACKNOWLEDGE, ids=["arm:link"])
        assert (answered["arm:link"].state, answered["arm:link"].by) == (Alarm.ACKNOWLEDGED, "li.s")
        await client.until(lambda: "alarm.acknowledged" in client.codes())
        state.link = State.UP
        await client.until(lambda: not client.alarms)


async def test_a_restart_keeps_acknowledged_and_shelved_alarms(mesh, tmp_path):
    async with (
        open_session(mesh) as gateway,
        controller(
            gateway,
            link=State.DOWN,
            link_reasons=map(reason_message, (codes.LINK_CLOSED(), codes.LINK_JUST_ENDED())),
            fault="E 17",
        ) as state,
    ):
        async with watched(mesh, tmp_path) as client:
            await client.until(lambda: {"arm:link", "arm:controller.fault"} <= client.alarms.keys())
            await client.ask(action=Request.ACKNOWLEDGE, ids=["arm:link"])
            await client.ask(
                action=Request.SHELVE, ids=["arm:controller.fault"], shelve_s=600.0, reason="service"
            )
        async with watched(mesh, tmp_path) as client:
            await client.until(lambda: len(client.alarms) == 2)
            shelved = client.alarms["arm:controller.fault"]
            assert (shelved.state, shelved.reason, shelved.by) == (Alarm.SHELVED, "service", "li.s")
            assert client.alarms["arm:link"].state == Alarm.ACKNOWLEDGED
            assert client.alarms["arm:link"].cause.code == "several"
            assert [each.code for each in client.alarms["arm:link"].cause.causes] == [
                "link.closed",
                "link.just_ended",
            ]
            # An alarm from before the restart clears as if there had been none.
            state.link, state.fault = State.UP, ""
            await client.until(lambda: "arm:link" not in client.alarms)


async def test_events_are_alarms_by_the_table_and_end_as_it_says(mesh, tmp_path):
    async with watched(mesh, tmp_path) as client, open_session(mesh) as recorder:
        await client.until(lambda: client.mesh.site)
        publisher = recorder.declare_publisher("s", "-", "events/recorder")
        publisher.put(event(schema.Event.WARNING, "recorder.space", "little space is left"))
        ended = event(schema.Event.CRITICAL, "recorder.ended", "recording a ended")
        ended.reason.CopyFrom(reason_message(codes.LINK_CLOSED()))
        publisher.put(ended)
        publisher.put(event(schema.Event.WARNING, "kinematics.limit", joint="waist", limit="upper"))
        publisher.put(event(schema.Event.WARNING, "kinematics.limit", joint="elbow", limit="upper"))
        publisher.put(event(schema.Event.ERROR, "nobody.knows", "not in the table"))
        publisher.put(event(schema.Event.INFO, "recorder.saved", "no alarm"))
        names = {
            "-:recorder.space",
            "-:recorder.ended",
            "-:kinematics.limit:waist",
            "-:kinematics.limit:elbow",
            "-:nobody.knows",
        }
        await client.until(lambda: client.alarms.keys() == names)
        assert client.alarms["-:recorder.ended"].priority == Alarm.HIGH
        assert client.alarms["-:recorder.ended"].cause == ended.reason
        assert not client.alarms["-:recorder.space"].HasField("cause")
        publisher.put(event(schema.Event.INFO, "recorder.space", "there is space again"))
        publisher.put(event(schema.Event.INFO, "kinematics.limit.over", joint="waist", limit="upper"))
        await client.until(lambda: client.alarms["-:recorder.space"].state == Alarm.RETURNED)
        await client.until(lambda: client.alarms["-:kinematics.limit:waist"].state == Alarm.RETURNED)
        assert client.alarms["-:kinematics.limit:elbow"].state == Alarm.UNACKNOWLEDGED
        # An alarm that no event clears ends when it is acknowledged.
        left = await client.ask(action=Request.ACKNOWLEDGE, ids=sorted(names))
        assert left.keys() == {"-:kinematics.limit:elbow"}


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ({"action": Request.ACKNOWLEDGE, "ids": ["arm:none"]}, codes.ALARM_UNKNOWN),
        ({"action": Request.ACKNOWLEDGE}, codes.ALARM_NONE_NAMED),
        ({"action": Request.SHELVE, "ids": ["arm:link"], "shelve_s": 60.0}, codes.ALARM_NO_REASON),
        ({"ids": ["arm:link"]}, codes.INVALID),
    ],
    ids=["unknown", "none", "no reason", "no action"],
)
async def test_an_impossible_alarm_request_is_refused_with_its_code(mesh, tmp_path, request_, code):
    async with watched(mesh, tmp_path) as client:
        with refused(code):
            await client.ask(**request_)


async def run_remote_service(session, service, *, robot="-", host="host-b", version="0.1.0", ahead_s=0.0):
    """Run a process of another machine, with health and a clock that is ahead, until cancelled."""
    session.declare_presence("s", robot, service)
    answer_clock(session, "s", wall_ns=lambda: time.time_ns() + round(ahead_s * 1e9))
    publisher = session.declare_publisher("s", "-", f"health/{service}.{session.identity}")
    health = schema.ServiceHealth(service=service, id=session.identity, host=host, version=version)
    while True:
        publisher.put(health)
        await asyncio.sleep(0.3)


@asynccontextmanager
async def remote_service(mesh, *args, **values):
    async with open_session(mesh) as session:
        task = asyncio.create_task(run_remote_service(session, *args, **values))
        try:
            yield session
        finally:
            task.cancel()


async def test_a_clock_that_is_off_is_measured_and_both_machines_are_named(mesh, tmp_path):
    async with (
        watched(mesh, tmp_path) as client,
        remote_service(mesh, "recorder", ahead_s=3.0) as other,
        remote_service(mesh, "player", host="host-c", ahead_s=-0.2) as near,
    ):

        def measured():
            seen = {each.id: each for each in client.mesh.services}
            return {other.identity, near.identity} <= {
                name for name, each in seen.items() if each.HasField("clock_offset_s")
            }

        await client.until(measured)
        for each in client.mesh.services:
            if each.id in (other.identity, near.identity):
                offset = {other.identity: 3.0, near.identity: -0.2}[each.id]
                assert abs(each.clock_offset_s - offset) <= each.round_trip_s / 2 + 1e-3
        await client.until(lambda: "-:clock.off:host-b" in client.alarms)
        cause = client.alarms["-:clock.off:host-b"].cause
        assert (cause.code, cause.values["host"]) == ("clock.ahead", "host-b")
        assert abs(float(cause.values["seconds"]) - 3.0) < 1.0  # half a round trip
        assert cause.values["watch"] in {
            each.host for each in client.mesh.services if each.service == "watch"
        }
        assert "-:clock.off:host-c" not in client.alarms
        assert client.codes().count("clock.off") == 1


async def test_duplicate_names_and_differing_versions_are_reported_once_with_both_sides(mesh, tmp_path):
    async with (
        watched(mesh, tmp_path) as client,
        remote_service(mesh, "gateway", robot="arm", host="host-a"),
    ):
        async with remote_service(mesh, "gateway", robot="arm", host="host-b", version="9.9"):
            await client.until(lambda: "arm:mesh.twice:gateway" in client.alarms)
            names = client.alarms["arm:mesh.twice:gateway"].cause.values["names"]
            assert "host-a" in names
            assert "host-b" in names
            await client.until(lambda: "-:mesh.versions" in client.alarms)
            assert "9.9: gateway (s, host-b, " in client.alarms["-:mesh.versions"].text
            assert "0.1.0: " in client.alarms["-:mesh.versions"].text
        await client.until(lambda: {"mesh.twice.over", "mesh.versions.over"} <= set(client.codes()))
        assert client.codes().count("mesh.twice") == 1
        # The list of alarms follows the events, on another topic.
        await client.until(lambda: client.alarms["arm:mesh.twice:gateway"].state == Alarm.RETURNED)


async def test_both_watches_report_a_duplicate_site_name(mesh, tmp_path):
    async with watched(mesh, tmp_path / "a") as client, watched(mesh, tmp_path / "b"):
        await client.until(lambda: any(each.reason.code == "mesh.site_twice" for each in client.events))


async def test_a_service_that_is_gone_is_an_alarm_until_it_is_back_or_known(mesh, tmp_path):
    async with watched(mesh, tmp_path) as client:
        async with remote_service(mesh, "recorder"):
            await client.until_present("recorder")
        await client.until(lambda: "-:service.gone:recorder" in client.alarms)
        assert "recorder (s, host-b, " in client.alarms["-:service.gone:recorder"].text
        async with remote_service(mesh, "recorder"):
            await client.until(lambda: client.alarms["-:service.gone:recorder"].state == Alarm.RETURNED)
        await client.until(lambda: client.alarms["-:service.gone:recorder"].state == Alarm.UNACKNOWLEDGED)
        # Removed for good: acknowledging the alarm ends it.
        left = await client.ask(action=Request.ACKNOWLEDGE, ids=["-:service.gone:recorder"])
        assert "-:service.gone:recorder" not in left


async def test_a_replaced_process_clears_its_alarms(mesh, tmp_path):
    async def publish_warnings(session, text):
        publisher = session.declare_publisher("s", "-", "events/recorder")
        message = event(schema.Event.WARNING, "recorder.space", text)
        message.source = "recorder"
        publisher.put(message)

    async with watched(mesh, tmp_path) as client:
        async with remote_service(mesh, "recorder") as recorder:
            await client.until_present("recorder")
            await publish_warnings(recorder, "little space is left")
            await client.until(lambda: "-:recorder.space" in client.alarms)
            await client.ask(action=Request.ACKNOWLEDGE, ids=["-:recorder.space"])
        await client.until(lambda: "-:service.gone:recorder" in client.alarms)
        assert "-:recorder.space" in client.alarms, "nobody knows whether there is space again"
    # The machine of both restarts; there is more free space, and no event says so.
    async with watched(mesh, tmp_path) as client, remote_service(mesh, "recorder") as recorder:
        await client.until(lambda: "-:recorder.space" in client.alarms)
        await client.until(lambda: "-:recorder.space" not in client.alarms)
        await publish_warnings(recorder, "little space is left again")
        await client.until(lambda: "-:recorder.space" in client.alarms)
        await asyncio.sleep(1.0)
        assert client.alarms["-:recorder.space"].state == Alarm.UNACKNOWLEDGED


async def test_a_robot_without_a_gateway_is_forgotten_after_the_acknowledgement(mesh, tmp_path):
    async with watched(mesh, tmp_path) as client:
        async with (
            remote_service(mesh, "gateway", robot="arm") as gateway,
            controller(gateway, mode=State.LOCAL),
        ):
            await client.until(lambda: "arm:controller.local" in client.alarms)
            # A service that was never seen is not expected.
            await client.until_present("gateway")
        gone = "-:service.gone:gateway.arm"
        await client.until(lambda: gone in client.alarms)
        # A robot may still be in the state in which its gateway disappeared.
        assert client.alarms["arm:controller.local"].state == Alarm.UNACKNOWLEDGED
        await client.ask(action=Request.ACKNOWLEDGE, ids=[gone, "arm:controller.local"])
        await client.until(lambda: not client.alarms)


async def test_a_replay_raises_no_alarm(mesh, tmp_path):
    async with watched(mesh, tmp_path) as client, open_session(mesh) as others:
        publishers = {
            (robot, topic): others.declare_publisher("s", robot, topic)
            for robot in ("replay-1", "arm")  # the replay first: it has arrived when the arm has
            for topic in ("controller", "events", "events/kinematics")
        }
        state = State(link=State.UP, mode=State.LOCAL)
        while not {"arm:controller.local", "arm:a", "arm:b"} <= client.alarms.keys():
            for (_, topic), publisher in publishers.items():
                code = {"events": "a", "events/kinematics": "b"}.get(topic)
                publisher.put(event(schema.Event.ERROR, code) if code else state)
            await asyncio.sleep(0.1)
        assert not [name for name in client.alarms if "replay" in name]


@pytest.mark.slow
async def test_a_router_that_was_away_is_no_alarm_of_everybody_behind_it(tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    mesh = SessionSettings(connect=(endpoint,), wait_s=5.0)
    router = await asyncio.to_thread(zenoh.open, router_config((endpoint,)))
    try:
        async with watched(mesh, tmp_path, settled_s=3.0) as client:
            recorder = Served(service="recorder", present_for=(("s", "-"),))
            async with open_session(mesh) as session, present(session, recorder):
                await client.until(lambda: {"recorder", "watch"} <= {s.service for s in client.mesh.services})
                await asyncio.to_thread(router.close)
                await asyncio.sleep(3.5)  # longer than the time for a restart
                router = await asyncio.to_thread(zenoh.open, router_config((endpoint,)))
                before = client.mesh.timestamp.ToNanoseconds()
                await client.until(lambda: client.mesh.timestamp.ToNanoseconds() > before + 5 * 10**9)
                assert not client.alarms, client.alarms
            # A service that really disappears is reported as before.
            await client.until(lambda: "-:service.gone:recorder" in client.alarms)
    finally:
        await asyncio.to_thread(router.close)
