"""Subscriptions of the recorder: delivery to sinks, first messages of a file, sequence numbers and times."""

import asyncio
import contextlib
import time
from types import SimpleNamespace

import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from robomesh.contract.header import Header, pack
from robomesh.contract.topics import TOPICS, topic
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas.robomesh_pb2 import Event, EventList, RecordingQuery
from robomesh.wire.session import open_session
from services.recorder import subscriptions
from services.recorder.disk import RecordingLevel
from services.recorder.file_writer import CaptureSink
from services.recorder.settings import Flight
from services.recorder.subscriptions import QUIET, interval_s
from tests.conftest import run
from tests.recordings import KEY_PICTURE, PICTURE, START_NS
from tests.services.recording import (
    WITHIN_S,
    put_states,
    recording_site,
    trace_off,
    trace_on,
    until,
    until_indexed,
)
from tests.services.test_recordings_elsewhere import counted

ARM = "robomesh/site/arm"
JOINTS, VIDEO, EVENTS = f"{ARM}/joints", f"{ARM}/video/front", f"{ARM}/events"


class Sink:
    def __init__(self):
        self.taken = []

    def take(self, key, row, header, payload, received_ns):
        self.taken.append((key, header.sequence))

    def drained(self):
        pass


def picture(data):
    return CompressedVideo(format="h264", data=data).SerializeToString()


def test_a_sink_receives_and_counts_as_lost_only_its_own_topics(mesh):
    async def main():
        async with open_session(mesh) as service, open_session(mesh) as other:

            def put(key, number, data=b""):
                other.zenoh_session.put(key, data, attachment=pack(Header(7, number, number)))

            subscribed = subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored)
            states, all_of_it, later = Sink(), Sink(), Sink()
            try:
                with subscribed.lock:
                    robot = subscribed.robot("arm")
                    robot.attach(states, frozenset({"joints"}))
                    robot.attach(all_of_it, frozenset({"joints", "video/front"}))
                while len(all_of_it.taken) < 2:  # until the router knows the subscribers
                    put(JOINTS, 1)
                    put(VIDEO, 1, picture(KEY_PICTURE))
                    await asyncio.sleep(0.02)
                put(VIDEO, 5, picture(KEY_PICTURE))
                put(JOINTS, 9)
                await until(lambda: len(all_of_it.taken) >= 4)
                with subscribed.lock:
                    lost = [robot.lost(sink) for sink in (states, all_of_it)]
                    robot.detach(all_of_it)
                    robot.attach(later, frozenset({"joints", "video/front"}))
                    lost_later = robot.lost(later)
                return states.taken, all_of_it.taken, lost, lost_later
            finally:
                subscribed.close()

    states, all_of_it, lost, lost_later = run(main())
    assert [key for key, _ in states] == [JOINTS] * 2
    assert {key for key, _ in all_of_it} == {JOINTS, VIDEO}
    assert lost == [{JOINTS: 7}, {JOINTS: 7, VIDEO: 3}]
    assert lost_later == {}


async def test_a_recording_continues_after_invalid_messages(mesh, tmp_path):
    async with recording_site(mesh, tmp_path, flight=Flight(minutes=1.0)) as session:
        joints = session.declare_publisher("site", "arm", "joints")
        await until(lambda: joints.watched)
        put = session.zenoh_session.put
        # Not an event, and a source time before 1970.
        put(EVENTS, b"\xff\xff", attachment=pack(Header(7, 1, 0)))
        put(EVENTS, Event(code="early").SerializeToString(), attachment=pack(Header(7, 2, -1)))
        answer = await trace_on(session, name="trial")
        await put_states(joints, range(20))
        while True:
            recording = await session.ask(
                "robomesh/site/-/recordings/info",
                RecordingQuery(file=answer.file),
                timeout_s=WITHIN_S,
            )
            if any(each.topic == JOINTS and each.messages >= 20 for each in recording.topics):
                return
            await asyncio.sleep(0.05)


async def test_a_history_with_an_invalid_time_is_skipped_and_later_events_are_taken(mesh):
    async with open_session(mesh) as service, open_session(mesh) as other:
        event = Event(code="bad")
        event.timestamp.nanos = 2_000_000_000
        list_of = EventList(events=[event]).SerializeToString()

        def reply(query):
            query.reply(EVENTS, list_of, attachment=pack(Header(7, 1, 0)))

        queryable = other.zenoh_session.declare_queryable(EVENTS, reply)
        subscribed, sink = (
            subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored),
            Sink(),
        )
        try:
            with subscribed.lock:
                subscribed.robot("arm").attach(sink, frozenset({"events"}))
            number = 1
            while not sink.taken:
                number += 1
                other.zenoh_session.put(EVENTS, b"", attachment=pack(Header(7, number, 0)))
                await asyncio.sleep(0.02)
        finally:
            subscribed.close()
            queryable.undeclare()


async def test_a_failing_sink_ends_no_other_robots_recording(mesh, caplog):
    class Failing(Sink):
        def take(self, key, row, header, payload, received_ns):
            raise RuntimeError("injected error")

    async with open_session(mesh) as service, open_session(mesh) as other:
        subscribed, sink = (
            subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored),
            Sink(),
        )
        try:
            with subscribed.lock:
                subscribed.robot("bad").attach(Failing(), frozenset({"joints"}))
                subscribed.robot("arm").attach(sink, frozenset({"joints"}))
            number = 0
            while not ("injected error" in caplog.text and sink.taken and number > sink.taken[0][1] + 10):
                number += 1
                for key in ("robomesh/site/bad/joints", JOINTS):
                    other.zenoh_session.put(key, b"", attachment=pack(Header(7, number, number)))
                await asyncio.sleep(0.02)
            await until(lambda: len(sink.taken) > 5)
        finally:
            subscribed.close()


def test_the_rings_of_a_hundred_robots_fit_into_memory():
    rings = {row.name: subscriptions._ring(row) for row in TOPICS.values() if row.recorded}
    assert rings["joints"] == 2000
    assert rings["audit"] == 512
    # Without video, which is recorded on request only; 270 bytes a message.
    states = sum(size for name, size in rings.items() if not name.startswith("video/"))
    assert states * 100 * 270 < 256 << 20


def test_a_new_file_takes_older_pictures_only_if_its_decoder_needs_and_can_use_them(mesh, monkeypatch):
    async def main():
        async with open_session(mesh) as service, open_session(mesh) as other:
            subscribed = subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored)
            first = Sink()

            async def put(numbers, *, key_frames=()):
                for number in numbers:
                    data = picture(KEY_PICTURE if number in key_frames else PICTURE)
                    other.zenoh_session.put(VIDEO, data, attachment=pack(Header(7, number, number)))
                await until(lambda: first.taken[-1:] == [(VIDEO, number)])

            async def taken_by_new_sink(number):
                """Return what a sink takes with the first picture after it was attached."""
                sink = Sink()
                with subscribed.lock:
                    subscribed.robot("arm").attach(sink, frozenset({"video/front"}))
                await put([number])
                with subscribed.lock:
                    subscribed.robot("arm").detach(sink)
                return [taken for _, taken in sink.taken]

            try:
                with subscribed.lock:
                    subscribed.robot("arm").attach(first, frozenset({"video/front"}))
                while not first.taken:  # until the router knows the subscriber
                    other.zenoh_session.put(VIDEO, picture(PICTURE), attachment=pack(Header(7, 1, 1)))
                    await asyncio.sleep(0.02)
                found = {"no key frame yet": await taken_by_new_sink(2)}
                await put(range(3, 7), key_frames=(3, 5))
                found["the last of two key frames"] = await taken_by_new_sink(7)
                await put([9])
                found["a lost picture"] = await taken_by_new_sink(10)
                await put([11], key_frames=(11,))
                found["a key frame after it"] = await taken_by_new_sink(12)
                monkeypatch.setattr(subscriptions, "_MAX_PREAMBLE_BYTES", 0)
                found["too many bytes"] = await taken_by_new_sink(13), await taken_by_new_sink(14)
                return found
            finally:
                subscribed.close()

    assert run(main(), timeout_s=60.0) == {
        "no key frame yet": [2],
        "the last of two key frames": [5, 6, 7],
        "a lost picture": [10],
        "a key frame after it": [11, 12],
        "too many bytes": ([11, 12, 13], [14]),
    }


def test_a_recording_begins_with_a_new_picture_and_with_an_old_one_only_to_decode_it(
    mesh, tmp_path, monkeypatch
):
    monkeypatch.setattr(subscriptions, "_ANSWER_S", WITHIN_S)

    async def main():
        async with recording_site(mesh, tmp_path, views=("front", "top")) as session:
            front, top = (
                session.declare_publisher("site", "arm", f"video/{view}") for view in ("front", "top")
            )
            joints = session.declare_publisher("site", "arm", "joints")
            for publisher in (front, top):
                publisher.put(CompressedVideo(format="h264", data=KEY_PICTURE + b"old"), key_frame=True)
            await trace_on(session)
            await until(lambda: front.watched and top.watched and joints.watched)
            await put_states(joints, range(5))
            await counted(session, {"joints": 5})
            front.put(CompressedVideo(format="h264", data=KEY_PICTURE + b"new"), key_frame=True)
            top.put(CompressedVideo(format="h264", data=PICTURE + b"new"))
            await counted(session, {"video/front": 1, "video/top": 1})
            done = await trace_off(session)
            await until_indexed(tmp_path / "arm" / done.file)
            return tmp_path / "arm" / done.file

    with RecordingFile(run(main(), timeout_s=60.0)) as file:
        (last,) = [message.received_ns for message in file.last(JOINTS, file.layout.end_ns, 1)]
        front, top = (
            [
                (CompressedVideo.FromString(each.data).data, each.received_ns >= last)
                for each in file.messages([f"{ARM}/video/{view}"])
            ]
            for view in ("front", "top")
        )
    assert front == [(KEY_PICTURE + b"new", True)]
    assert top == [(KEY_PICTURE + b"old", True), (PICTURE + b"new", True)]


def test_setting_the_clock_during_a_recording_shifts_no_message(tmp_path):
    path = tmp_path / "a.mcap"
    about = {"site": "site", "robot": "arm", "name": "trial", "started_by": "request"}
    capture = Capture(path, about, start_ns=START_NS)  # not the current time
    begun_ns = time.monotonic_ns()
    part = CaptureSink(capture, SimpleNamespace(level=RecordingLevel.ALL), begun_ns=begun_ns)
    for number, at_ns in enumerate((-5_000_000_000, 0, 1_000_000_000, 2_000_000_000)):
        part.take(JOINTS, topic("joints"), Header(7, number, 0), b"", begun_ns + at_ns)
    capture.finish({})
    with RecordingFile(path) as file:
        times = [message.received_ns - START_NS for message in file.messages()]
    assert times[:2] == [0, 0], "earlier messages are dated at the beginning"
    assert times[3] - times[2] == 1_000_000_000


def test_a_live_event_with_a_slow_clock_is_recorded_after_a_history_dated_it_earlier(mesh):
    async def main():
        async with open_session(mesh) as service, open_session(mesh) as other:
            list_of = EventList(events=[Event(code=f"{number}") for number in (1, 2)]).SerializeToString()

            def reply(query):
                query.reply(EVENTS, list_of, attachment=pack(Header(7, 2, 0)))

            queryable = other.zenoh_session.declare_queryable(EVENTS, reply)
            subscribed, sink = (
                subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored),
                Sink(),
            )
            try:
                with subscribed.lock:
                    robot = subscribed.robot("arm")
                    robot.attach(sink, frozenset({"events"}))
                    topic_subscription = robot._topics["events"]
                await until(lambda: EVENTS in topic_subscription._sequences)
                while not sink.taken:  # until the router knows the subscriber
                    other.zenoh_session.put(EVENTS, b"", attachment=pack(Header(7, 2, 0)))
                    await asyncio.sleep(0.02)
                other.zenoh_session.put(EVENTS, b"", attachment=pack(Header(7, 4, 0)))
                await until(lambda: len(sink.taken) >= 2)
                with subscribed.lock:
                    return sink.taken, robot.lost(sink)
            finally:
                subscribed.close()
                queryable.undeclare()

    taken, lost = run(main())
    assert taken == [(EVENTS, 2), (EVENTS, 4)]
    assert lost == {EVENTS: 1}


def test_a_history_with_events_before_the_first_live_one_is_recorded_whole(mesh):
    async def main():
        async with open_session(mesh) as service, open_session(mesh) as other:

            def reply(query):
                events = [Event(code=f"{number}") for number in range(2, 8)]
                for event in events:
                    event.timestamp.GetCurrentTime()
                query.reply(
                    EVENTS, EventList(events=events).SerializeToString(), attachment=pack(Header(7, 7, 0))
                )

            subscribed, sink = (
                subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored),
                Sink(),
            )
            try:
                with subscribed.lock:
                    robot = subscribed.robot("arm")
                    robot.attach(sink, frozenset({"events"}))
                while not sink.taken:  # until the router knows the subscriber
                    other.zenoh_session.put(EVENTS, b"", attachment=pack(Header(7, 7, 0)))
                    await asyncio.sleep(0.02)
                queryable = other.zenoh_session.declare_queryable(EVENTS, reply)
                while len(sink.taken) < 6:  # until the router knows the queryable
                    await asyncio.to_thread(robot.refresh)
                    await asyncio.sleep(0.1)
                queryable.undeclare()
                with subscribed.lock:
                    return sink.taken, robot.lost(sink)
            finally:
                subscribed.close()

    taken, lost = run(main())
    assert sorted(number for _, number in taken) == [2, 3, 4, 5, 6, 7]
    assert not +lost


def test_the_end_of_a_recording_takes_also_what_is_in_a_ring_that_is_seldom_drained(mesh, monkeypatch):
    async def main():
        async with open_session(mesh) as service, open_session(mesh) as other:
            subscribed = subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored)
            seldom, sink = asyncio.Event(), Sink()
            with monkeypatch.context() as patch, contextlib.closing(subscribed):
                patch.setattr(subscriptions, "_MAX_INTERVAL_S", 3600.0)
                loop, of_time = asyncio.get_running_loop(), subscriptions.interval_s

                def interval(took_s, full):
                    if full == QUIET and sink.attached:
                        loop.call_soon_threadsafe(seldom.set)
                    return of_time(took_s, full)

                sink.attached = False
                patch.setattr(subscriptions, "interval_s", interval)
                with subscribed.lock:
                    robot = subscribed.robot("arm")
                    robot.attach(sink, frozenset({"joints"}))
                    sink.attached = True
                await seldom.wait()
                while not sink.taken:  # until the router knows the subscriber
                    other.zenoh_session.put(JOINTS, b"", attachment=pack(Header(7, 1, 1)))
                    await asyncio.sleep(0.02)
                    with subscribed.lock:
                        robot.drain()

    run(main())


async def test_a_publisher_that_answers_too_late_is_queried_again(mesh, monkeypatch):
    monkeypatch.setattr(subscriptions, "_ANSWER_S", 0.3)
    missed, key = [], "robomesh/site/arm/description"

    def answer(query):
        if len(missed) < 2:
            missed.append(query)  # while it is kept, Zenoh waits for its answer
        else:
            query.reply(key, b"\n\x03arm", attachment=pack(Header(7, 1, 0)))
            query.drop()

    async with open_session(mesh) as service, open_session(mesh) as other:
        queryable = other.zenoh_session.declare_queryable(key, answer)
        while not await asyncio.to_thread(lambda: [*service.zenoh_session.get(key, timeout=0.3)]):
            missed.clear()
        missed.clear()
        subscribed, sink = subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored), Sink()
        with contextlib.closing(subscribed):
            with subscribed.lock:
                subscribed.robot("arm").attach(sink, frozenset({"description"}))
            while not sink.taken:
                await asyncio.sleep(0.02)
        queryable.undeclare()
    assert [key for key, _ in sink.taken] == [key]


def test_a_ring_that_fills_is_drained_at_once_however_busy_the_thread_is():
    # 100,000 joint states a second: the ring of 2,000 places would overflow in the longest interval.
    assert interval_s(took_s=0.006, full=0.5) < 0.001
    assert interval_s(took_s=0.006, full=0.1) == pytest.approx(0.02)
    assert interval_s(took_s=0.0, full=0.0) == pytest.approx(0.004)
    assert interval_s(took_s=0.0, full=QUIET) == pytest.approx(0.02)
