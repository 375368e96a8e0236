"""Log times of a recording: never before the publish time, also on a busy machine."""

import asyncio
import time

from mcap.reader import make_reader

from robomesh.contract.header import Header, pack
from robomesh.publications.wall_clock import WallClock
from robomesh.recordings.writing.capture import Capture
from robomesh.wire.session import open_session
from services.recorder import captures, subscriptions
from tests.conftest import run
from tests.services.recording import put_states, recording_site, trace_off, trace_on, until, until_indexed

JOINTS = "robomesh/site/arm/joints"


def messages_of(path):
    with path.open("rb") as stream:
        return [message for _, _, message in make_reader(stream).iter_messages()]


def test_a_busy_recorder_dates_no_message_before_its_publication(mesh):
    class SlowSink:
        def __init__(self):
            self.times = []

        def take(self, key, row, header, payload, received_ns):
            self.times.append((header.source_time_ns, received_ns))
            time.sleep(0.02)

        def drained(self):
            pass

    async def main():
        async with open_session(mesh) as service, open_session(mesh) as other:
            subscribed = subscriptions.Subscriptions(service.zenoh_session, "site", service.ignored)
            sink, wall_clock = SlowSink(), WallClock()
            try:
                with subscribed.lock:
                    subscribed.robot("arm").attach(sink, frozenset({"joints"}))
                number = 0
                while len(sink.times) < 50:
                    number += 1
                    header = Header(7, number, time.time_ns())
                    other.zenoh_session.put(JOINTS, b"", attachment=pack(header))
                    await asyncio.sleep(0.005)
            finally:
                subscribed.close()
            wall_clock.was_set()
            return [wall_clock.latest_ns(received_ns) - source_ns for source_ns, received_ns in sink.times]

    assert min(run(main(), timeout_s=60)) >= 0


def test_a_slowly_created_file_dates_no_message_before_its_publication(mesh, tmp_path, monkeypatch):
    class SlowCapture(Capture):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            time.sleep(0.2)

    monkeypatch.setattr(captures, "Capture", SlowCapture)

    async def main():
        async with recording_site(mesh, tmp_path) as session:
            joints = session.declare_publisher("site", "arm", "joints")
            answer = await trace_on(session, name="trial")
            await until(lambda: joints.watched)
            await put_states(joints, range(50))
            await trace_off(session)
            path = tmp_path / "arm" / answer.file
            await until_indexed(path)
            return path

    messages = messages_of(run(main(), timeout_s=60))
    assert len(messages) >= 45
    assert min(message.log_time - message.publish_time for message in messages) >= 0


async def test_setting_the_clock_forward_begins_the_next_file(mesh, tmp_path, monkeypatch):
    async with recording_site(mesh, tmp_path) as session:
        joints = session.declare_publisher("site", "arm", "joints")
        first = await trace_on(session, name="trial")
        await until(lambda: joints.watched)
        await put_states(joints, range(20))
        real = time.time_ns
        monkeypatch.setattr(time, "time_ns", lambda: real() + 3600 * 10**9)
        set_ns, paths = time.time_ns(), []
        while len(paths) < 2:
            await put_states(joints, range(5))
            paths = sorted((tmp_path / "arm").glob("*_trial*.mcap"), key=lambda path: path.stat().st_ino)
        await put_states(joints, range(20))
        await trace_off(session)
        (second,) = (path for path in paths if path.name != first.file)
        await until_indexed(second)
        second, set_ns = second, set_ns
    assert ".part2" in second.name
    messages = [message for message in messages_of(second) if message.publish_time >= set_ns]
    assert len(messages) >= 15  # the request may overtake the last states
    assert min(message.log_time - message.publish_time for message in messages) >= 0
