"""Send queues: samples for a slow browser, and for one that joins later."""

import time
from dataclasses import replace

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from robomesh.contract import topics
from robomesh.contract.header import Header
from robomesh.contract.keys import Key
from robomesh.publications.subscription import Sample
from services.console.websocket.send_queues import drop_outdated, queue_for

KEY = b"\0\0\0\1\x67\x42\xc0\x1f\0\0\0\1\x68\xce\0\0\0\1\x65\x88"
DELTA = b"\0\0\0\1\x41\x9a\x01"


def sample(number, data=b"", *, topic="joints", live=True):
    payload = CompressedVideo(data=data).SerializeToString() if topic.startswith("video") else data
    return Sample(f"robomesh/s/r/{topic}", Key("s", "r", topic), payload, Header(1, number, 0), live, 0.0)


def frame(number, data, *, live=True):
    return sample(number, data, topic="video/top", live=live)


def numbers(queue):
    out = []
    while (each := queue.pop()) is not None:
        out.append(each.header.sequence)
    return out


def test_of_state_only_the_newest_waits():
    queue = queue_for(topics.topic("joints"))
    for number in range(1, 100):
        queue.push(sample(number))
    assert numbers(queue) == [99]


def test_of_state_that_came_in_one_burst_all_is_passed_on():
    queue, now = queue_for(topics.topic("joints")), time.monotonic() + 3600.0
    queue.push(sample(1))
    for number in range(2, 6):
        queue.push(replace(sample(number), received=now))
    assert numbers(queue) == [2, 3, 4, 5]
    for number in range(1000):
        queue.push(replace(sample(number), received=now))
    assert len(queue.held()) < 10


def test_after_a_stall_recent_samples_and_the_newest_of_each_key_pass():
    row, now = topics.topic("joints"), time.monotonic() + 3600.0
    old = [sample(number) for number in range(5)]
    other = replace(sample(5), key="robomesh/s/other/joints")
    new = [replace(sample(number), received=now) for number in range(6, 9)]
    assert drop_outdated(row, [*old, other, *new]) == [other, *new]
    assert drop_outdated(row, [*old, other]) == [old[-1], other]
    assert drop_outdated(row, new) == new
    assert drop_outdated(topics.topic("events"), old) == old


def test_events_keep_their_order_and_are_bounded():
    queue = queue_for(topics.topic("events"))
    queue.push(sample(7, topic="events", live=False))
    for number in range(8, 12):
        queue.push(sample(number, topic="events"))
    assert numbers(queue) == [7, 8, 9, 10, 11]
    for number in range(1000):
        queue.push(sample(number, topic="events"))
    assert numbers(queue) == list(range(800, 1000))


def test_another_publishers_list_replaces_all_entries():
    queue = queue_for(topics.topic("events"), hold=True)
    for number in range(5):
        queue.push(sample(number, topic="events"))
    queue.push(replace(sample(5, topic="events", live=False), header=Header(2, 5, 0)))
    assert [each.header.sequence for each in queue.held()] == [5]


def test_entries_missed_in_an_outage_are_appended():
    queue = queue_for(topics.topic("events"), hold=True)
    for number in range(5):
        queue.push(sample(number, topic="events"))
    queue.push(sample(7, topic="events", live=False))
    assert [each.header.sequence for each in queue.held()] == [0, 1, 2, 3, 4, 7]


def test_video_begins_with_a_key_frame():
    queue = queue_for(topics.topic("video/top"))
    queue.push(frame(1, DELTA))
    assert queue.starved
    assert numbers(queue) == []
    queue.push(frame(2, KEY))
    queue.push(frame(3, DELTA))
    assert not queue.starved
    assert numbers(queue) == [2, 3]


def test_slow_video_goes_on_at_the_next_key_frame():
    queue = queue_for(topics.topic("video/top"))
    queue.push(frame(1, KEY))
    for number in range(2, 20):
        queue.push(frame(number, DELTA))
    queue.push(frame(20, KEY))
    queue.push(frame(21, DELTA))
    assert numbers(queue) == [20, 21]


def test_video_without_key_frames_does_not_grow_but_asks_for_one():
    queue = queue_for(topics.topic("video/top"))
    queue.push(frame(1, KEY))
    for number in range(2, 1000):
        queue.push(frame(number, DELTA))
    assert numbers(queue) == []
    assert queue.starved


def test_a_new_browser_gets_the_frames_since_the_last_key_frame():
    held = queue_for(topics.topic("video/top"), hold=True)
    for number, data in enumerate([KEY, DELTA, DELTA, KEY, DELTA], start=1):
        held.push(frame(number, data))
    assert [each.header.sequence for each in held.held()] == [4, 5]
