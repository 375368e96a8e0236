"""What the recorder takes from the mesh: to whom it gives what, what it keeps, and which time it gives it."""

import asyncio
import time
from types import SimpleNamespace

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from mcap_files.capture import Capture
from mcap_files.reading import RecordingFile
from robomesh.header import Header, pack
from robomesh.schemas.robomesh_pb2 import Event, EventList, RecordingQuery
from robomesh.session import open_session
from robomesh.topics import TOPICS, topic
from services.recorder import subscriptions
from services.recorder.disk import Taken
from services.recorder.file_writer import Part
from services.recorder.settings import Flight
from tests.conftest import run
from tests.recordings import KEY_PICTURE, PICTURE, START_NS
from tests.services.recording import WITHIN_S, put_states, recording_site, trace_on, until

ARM = "robomesh/site/arm"
JOINTS, VIDEO, EVENTS = f"{ARM}/joints", f"{ARM}/video/front", f"{ARM}/events"


class Sink:
    def __init__(self):
        self.taken = []

    def take(self, key, row, header, payload, received_ns):
        self.taken.append((key, header.sequence))

    def swept(self):
        pass


def picture(data):
    return CompressedVideo(format="h264", data=data).SerializeToString()


def test_who_takes_a_robots_joints_is_given_no_video_and_misses_none_of_it(mesh):
    async def main():
        async with open_session(mesh) as own, open_session(mesh) as other:

            def put(key, number, data=b""):
                other.zenoh_session.put(key, data, attachment=pack(Header(7, number, number)))

            taking = subscriptions.Intake(own.zenoh_session, "site", own.ignored)
            states, all_of_it, later = Sink(), Sink(), Sink()
            try:
                with taking.lock:
                    robot = taking.robot("arm")
                    robot.attach(states, frozenset({"joints"}))
                    robot.attach(all_of_it, frozenset({"joints", "video/front"}))
                while len(all_of_it.taken) < 2:  # until the router knows who listens
                    put(JOINTS, 1)
                    put(VIDEO, 1, picture(KEY_PICTURE))
                    await asyncio.sleep(0.02)
                put(VIDEO, 5, picture(KEY_PICTURE))
                put(JOINTS, 9)
                await until(lambda: len(all_of_it.taken) >= 4)
                with taking.lock:
                    lost = [robot.lost(sink) for sink in (states, all_of_it)]
                    robot.detach(all_of_it)
                    robot.attach(later, frozenset({"joints", "video/front"}))
                    afresh = robot.lost(later)
                return states.taken, all_of_it.taken, lost, afresh
            finally:
                taking.close()

    states, all_of_it, lost, afresh = run(main())
    assert [key for key, _ in states] == [JOINTS] * 2
    assert {key for key, _ in all_of_it} == {JOINTS, VIDEO}
    assert lost == [{JOINTS: 7}, {JOINTS: 7, VIDEO: 3}]
    assert afresh == {}


def test_what_cannot_be_read_ends_no_recording_of_what_follows(mesh, tmp_path):
    async def main():
        async with recording_site(mesh, tmp_path, flight=Flight(minutes=1.0)) as session:
            joints = session.declare_publisher("site", "arm", "joints")
            await until(lambda: joints.watched)
            put = session.zenoh_session.put
            # No event, and a clock that was before 1970.
            put(EVENTS, b"\xff\xff", attachment=pack(Header(7, 1, 0)))
            put(EVENTS, Event(code="early").SerializeToString(), attachment=pack(Header(7, 2, -1)))
            answer = await trace_on(session, name="trial")
            await put_states(joints, range(20))
            while True:
                told = await session.ask(
                    "robomesh/site/-/recordings/info",
                    RecordingQuery(file=answer.file),
                    timeout_s=WITHIN_S,
                )
                if any(each.topic == JOINTS and each.messages >= 20 for each in told.topics):
                    return
                await asyncio.sleep(0.05)

    run(main(), timeout_s=60)


def test_a_list_with_a_time_that_is_none_is_left_out_and_what_follows_is_taken(mesh):
    async def main():
        async with open_session(mesh) as own, open_session(mesh) as other:
            event = Event(code="bad")
            event.timestamp.nanos = 2_000_000_000
            list_of = EventList(events=[event]).SerializeToString()

            def tell(query):
                query.reply(EVENTS, list_of, attachment=pack(Header(7, 1, 0)))

            queryable = other.zenoh_session.declare_queryable(EVENTS, tell)
            taking, sink = subscriptions.Intake(own.zenoh_session, "site", own.ignored), Sink()
            try:
                with taking.lock:
                    taking.robot("arm").attach(sink, frozenset({"events"}))
                number = 1
                while not sink.taken:
                    number += 1
                    other.zenoh_session.put(EVENTS, b"", attachment=pack(Header(7, number, 0)))
                    await asyncio.sleep(0.02)
            finally:
                taking.close()
                queryable.undeclare()

    run(main(), timeout_s=60)


def test_a_sink_that_fails_at_a_message_ends_no_other_robots_recording(mesh, caplog):
    class Failing(Sink):
        def take(self, key, row, header, payload, received_ns):
            raise RuntimeError("a fault of ours")

    async def main():
        async with open_session(mesh) as own, open_session(mesh) as other:
            taking, sink = subscriptions.Intake(own.zenoh_session, "site", own.ignored), Sink()
            try:
                with taking.lock:
                    taking.robot("bad").attach(Failing(), frozenset({"joints"}))
                    taking.robot("arm").attach(sink, frozenset({"joints"}))
                number = 0
                while not (
                    "a fault of ours" in caplog.text and sink.taken and number > sink.taken[0][1] + 10
                ):
                    number += 1
                    for key in ("robomesh/site/bad/joints", JOINTS):
                        other.zenoh_session.put(key, b"", attachment=pack(Header(7, number, number)))
                    await asyncio.sleep(0.02)
                await until(lambda: len(sink.taken) > 5)
            finally:
                taking.close()

    run(main(), timeout_s=60)


def test_no_ring_is_larger_than_its_topic_needs():
    rings = {row.name: subscriptions._ring(row) for row in TOPICS.values() if row.recorded}
    assert rings["joints"] == 2000
    assert rings["audit"] == 512
    # Of a robot, without video: what a recorder of a hundred robots has room for.
    states = sum(size for name, size in rings.items() if not name.startswith("video/"))
    assert states * 100 * 300 < 256 << 20


def test_a_long_time_between_key_frames_is_kept_whole_or_not_at_all(monkeypatch):
    kept = subscriptions._Kept()
    for number in range(1000):
        kept.add((Header(7, number, 0), PICTURE, 0))
    assert len(kept.entries) == 1000
    monkeypatch.setattr(subscriptions, "_MOST_KEPT_BYTES", 1000)
    kept.add((Header(7, 1000, 0), PICTURE, 0))
    kept.add((Header(7, 1001, 0), PICTURE, 0))
    assert kept.entries == [], "what begins in its middle cannot be decoded"
    kept.begin()
    kept.add((Header(7, 1002, 0), KEY_PICTURE, 0))
    assert len(kept.entries) == 1


def test_a_clock_that_is_set_while_it_is_recorded_moves_no_message(tmp_path):
    path = tmp_path / "a.mcap"
    about = {"site": "site", "robot": "arm", "name": "trial", "started_by": "request"}
    capture = Capture(path, about, start_ns=START_NS)  # whatever the clock says now
    begun_ns = time.monotonic_ns()
    part = Part(capture, SimpleNamespace(taken=Taken.ALL), begun_ns=begun_ns)
    for number, at_ns in enumerate((-5_000_000_000, 0, 1_000_000_000, 2_000_000_000)):
        part.take(JOINTS, topic("joints"), Header(7, number, 0), b"", begun_ns + at_ns)
    capture.finish({})
    with RecordingFile(path) as file:
        times = [message.received_ns - START_NS for message in file.messages()]
    assert times[:2] == [0, 0], "what was told before stands at the beginning"
    assert times[3] - times[2] == 1_000_000_000


def test_an_event_is_recorded_though_its_publishers_clock_is_behind_and_a_list_tells_it_first(mesh):
    async def main():
        async with open_session(mesh) as own, open_session(mesh) as other:
            list_of = EventList(events=[Event(code=f"{number}") for number in (1, 2)]).SerializeToString()

            def tell(query):
                query.reply(EVENTS, list_of, attachment=pack(Header(7, 2, 0)))

            queryable = other.zenoh_session.declare_queryable(EVENTS, tell)
            taking, sink = subscriptions.Intake(own.zenoh_session, "site", own.ignored), Sink()
            try:
                with taking.lock:
                    robot = taking.robot("arm")
                    robot.attach(sink, frozenset({"events"}))
                    tap = robot._taps["events"]
                await until(lambda: EVENTS in tap._seen)
                while not sink.taken:  # until the router knows who listens
                    other.zenoh_session.put(EVENTS, b"", attachment=pack(Header(7, 2, 0)))
                    await asyncio.sleep(0.02)
                other.zenoh_session.put(EVENTS, b"", attachment=pack(Header(7, 4, 0)))
                await until(lambda: len(sink.taken) >= 2)
                with taking.lock:
                    return sink.taken, robot.lost(sink)
            finally:
                taking.close()
                queryable.undeclare()

    taken, lost = run(main())
    assert taken == [(EVENTS, 2), (EVENTS, 4)]
    assert lost == {EVENTS: 1}


def test_of_a_list_that_tells_what_came_before_the_first_event_all_is_recorded(mesh):
    async def main():
        async with open_session(mesh) as own, open_session(mesh) as other:

            def tell(query):
                events = [Event(code=f"{number}") for number in range(2, 8)]
                for event in events:
                    event.timestamp.GetCurrentTime()
                query.reply(
                    EVENTS, EventList(events=events).SerializeToString(), attachment=pack(Header(7, 7, 0))
                )

            taking, sink = subscriptions.Intake(own.zenoh_session, "site", own.ignored), Sink()
            try:
                with taking.lock:
                    robot = taking.robot("arm")
                    robot.attach(sink, frozenset({"events"}))
                while not sink.taken:  # until the router knows who listens
                    other.zenoh_session.put(EVENTS, b"", attachment=pack(Header(7, 7, 0)))
                    await asyncio.sleep(0.02)
                queryable = other.zenoh_session.declare_queryable(EVENTS, tell)
                await asyncio.to_thread(robot.refresh)
                await until(lambda: len(sink.taken) >= 6)
                queryable.undeclare()
                with taking.lock:
                    return sink.taken, robot.lost(sink)
            finally:
                taking.close()

    taken, lost = run(main())
    assert sorted(number for _, number in taken) == [2, 3, 4, 5, 6, 7]
    assert not +lost
