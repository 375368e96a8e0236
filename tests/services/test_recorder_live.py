"""Recorder during a recording: its state topic, split files, subscriptions, disk marks, outages."""

import asyncio
import math

import pytest
import zenoh
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from mcap.reader import make_reader

from robomesh import reason_codes as codes
from robomesh.contract.endpoints import router_config
from robomesh.errors import RefusedError
from robomesh.recordings.files import describe_file
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings
from services.recorder.settings import FreeSpace, Split
from tests.conftest import run
from tests.ports import free_port
from tests.refusals import refused
from tests.services.recording import put_states, recording_site, trace_off, trace_on, until, until_indexed

JOINTS, VIDEO = "robomesh/site/arm/joints", "robomesh/site/arm/video/front"
KEY_FRAME, OTHER = b"\0\0\1\x67key", b"\0\0\1\x41other"


def payloads(path, topic):
    with path.open("rb") as stream:
        return [message.data for _, _, message in make_reader(stream).iter_messages(topics=[topic])]


async def next_state(session, condition):
    """Return the recorder's first state of the arm that meets the condition."""
    subscription = session.subscribe("robomesh/site/arm/recording", newest=100)
    try:
        async for sample in subscription:
            if condition(sample.message()):
                return sample.message()
    finally:
        subscription.close()


async def test_the_recording_topic_counts_recorded_and_lost_messages_live(mesh, tmp_path):
    async with recording_site(mesh, tmp_path) as session:
        joints = session.declare_publisher("site", "arm", "joints")
        await trace_on(session, name="seen", views=["-"])
        await until(lambda: joints.watched)
        await put_states(joints, range(3))
        joints._sequence += 4  # simulates a congested link that dropped four
        await put_states(joints, range(3))
        seen = await next_state(session, lambda now: now.open and any(row.lost for row in now.topics))
        (row,) = [row for row in seen.topics if row.topic == JOINTS]
        assert (seen.name, row.messages, row.lost) == ("seen", 6, 4)
        await trace_off(session)
        ended = await next_state(session, lambda now: not now.open and not now.HasField("indexing"))
        assert (ended.name, ended.problem) == ("seen", "")


def test_a_capture_continues_in_numbered_files_that_begin_with_a_key_frame(mesh, tmp_path):
    async def main():
        split = Split.model_construct(minutes=0.01)
        async with recording_site(mesh, tmp_path, split=split, views=("front",)) as session:
            joints, video = (
                session.declare_publisher("site", "arm", name) for name in ("joints", "video/front")
            )
            session.declare_publisher("site", "arm", "description").put(schema.Description(name="arm"))
            await trace_on(session, name="long")
            await until(lambda: joints.watched and video.watched)
            number, last, folder = 0, math.inf, tmp_path / "arm"
            while number <= last:
                if len(list(folder.glob("*.mcap"))) >= 3:
                    last = min(last, number)  # a picture for the third file
                data = (KEY_FRAME if number % 10 == 0 else OTHER) + bytes([number % 250])
                video.put(CompressedVideo(data=data, format="h264"), key_frame=number % 10 == 0)
                await put_states(joints, [number], hz=50)
                number += 1
            await trace_off(session)
            files = sorted(folder.glob("*.mcap"))
            for file in files:
                await until_indexed(file)
            return number, files

    number, files = run(main())
    assert [describe_file(file).part for file in files] == list(range(1, len(files) + 1))
    recorded = [payloads(file, JOINTS) for file in files]
    assert sum(map(len, recorded)) == number, "a message is missing or duplicated between two files"
    with_video = [file for file in files if payloads(file, VIDEO)]
    assert len(with_video) > 1
    for file in with_video:
        pictures = [CompressedVideo.FromString(data).data for data in payloads(file, VIDEO)]
        assert pictures[0].startswith(KEY_FRAME)
    for file in files:
        assert len(payloads(file, "robomesh/site/arm/description")) == 1
        assert all(row.lost == 0 for row in describe_file(file).topics)


async def test_video_is_subscribed_only_while_it_is_recorded(mesh, tmp_path):
    async with recording_site(mesh, tmp_path, views=("front",)) as session:
        front, top = (session.declare_publisher("site", "arm", f"video/{name}") for name in ("front", "top"))
        await trace_on(session, views=["top"])
        await until(lambda: top.watched)
        assert not front.watched
        await trace_off(session)
        await until(lambda: not top.watched)
        await trace_on(session)
        await until(lambda: front.watched)
        await trace_off(session)
        with pytest.raises(RefusedError) as error:
            await trace_on(session, views=["a/b"])
        (cause,) = error.value.reason.causes
        assert (cause.code, cause.values["what"], cause.values["name"]) == ("key.chunk", "view", "a/b")
        view = schema.View(name="front")
        description = schema.Description(name="arm", views=[view])
        session.declare_publisher("site", "arm", "description").put(description)
        views = "front, free, close, far"
        with refused(codes.VIEW_UNKNOWN_OF, view="side", robot="arm", views=views):
            await trace_until_refused(session, views=["side"])
        for view in ("free", "close", "far", "free-1920x1080"):
            await trace_on(session, views=[view])
            await trace_off(session)


async def trace_until_refused(session, **fields):
    """Start and stop traces until the recorder has received the description and refuses."""
    while True:
        await trace_on(session, **fields)
        await trace_off(session)


async def pictures(video):
    while True:
        video.put(CompressedVideo(data=KEY_FRAME), key_frame=True)
        await asyncio.sleep(0.05)


async def test_below_the_mark_video_is_dropped_counted_and_reported(mesh, tmp_path):
    free = FreeSpace(warn_mib=0, video_mib=1 << 42, states_mib=0)
    async with recording_site(mesh, tmp_path, free=free, views=("front",)) as session:
        joints, video = (session.declare_publisher("site", "arm", name) for name in ("joints", "video/front"))
        events = session.subscribe("robomesh/site/-/events/recorder", newest=100)
        await trace_on(session)
        await until(lambda: joints.watched and video.watched)
        await put_states(joints, range(5))
        # A first picture may be the past of the subscription, and no picture overtakes the capture's end.
        shows = asyncio.create_task(pictures(video))
        await next_state(session, lambda now: any(row.topic == VIDEO for row in now.topics))
        shows.cancel()
        done = await trace_off(session)
        message = (await anext(events)).message()
        received = message.events if isinstance(message, schema.EventList) else [message]
        event, topics = received[0], {row.topic: (row.messages, row.lost) for row in done.topics}
    assert event.code == "recorder.gives_up"
    assert event.severity == schema.Event.Severity.CRITICAL

    assert topics[JOINTS] == (5, 0)
    messages, lost = topics[VIDEO]
    assert messages == 0
    assert lost > 0


@pytest.mark.slow
def test_events_of_an_outage_are_in_the_file_and_counted_back(tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    mesh = SessionSettings(connect=(endpoint,), wait_s=10.0)

    async def main():
        first = zenoh.open(router_config((endpoint,)))
        try:
            async with recording_site(mesh, tmp_path) as session:
                events = session.declare_publisher("site", "arm", "events")
                session.declare_presence("site", "arm", "gateway")
                await trace_on(session)
                await until(lambda: events.watched)
                put_event(events, "before")
                await asyncio.to_thread(first.close)
                for number in range(5):
                    put_event(events, f"during {number}")
                first = zenoh.open(router_config((endpoint,)))
                await until(lambda: session.connected and events.watched)
                put_event(events, "after")
                await next_state(session, lambda now: any(row.messages == 7 for row in now.topics))
                done = await trace_off(session)
                path = tmp_path / "arm" / done.file
                await until_indexed(path)
                return path
        finally:
            first.close()

    path = run(main(), timeout_s=120.0)
    texts = [schema.Event.FromString(data).text for data in payloads(path, "robomesh/site/arm/events")]
    assert sorted(texts) == sorted(["before", *(f"during {number}" for number in range(5)), "after"])
    (row,) = describe_file(path).topics
    assert row.lost == 0


def put_event(publisher, text):
    event = schema.Event(severity=schema.Event.Severity.INFO, text=text)
    event.timestamp.GetCurrentTime()
    publisher.put(event)
