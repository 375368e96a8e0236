"""The assignment of streams to encoding threads."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor

from renderer.service.encoding_threads import EncodingThread, EncodingThreads, thread_count


class Encoders:
    """Records the thread of each call."""

    def __init__(self, allowed=None):
        self.calls, self._allowed = [], allowed

    def process(self, picture, camera, job):
        if self._allowed is not None:
            assert self._allowed.wait(20)
        self.calls.append((job, threading.current_thread().name))

    def end(self, stream):
        self.calls.append((f"end {stream}", threading.current_thread().name))


def test_streams_are_spread_and_keep_their_thread():
    made = [Encoders(), Encoders()]
    with ThreadPoolExecutor(1) as first, ThreadPoolExecutor(1) as second:
        threads = EncodingThreads(map(EncodingThread, (first, second), made))
        a, b, c = (threads.of(stream) for stream in "abc")
        assert a is not b
        assert threads.of("a") is a
        threads.end("b")
        # `b` has left one of the two threads, so the next stream gets that one.
        assert threads.of("d") is (b if c is a else a if c is b else None)
        threads.keep({"a"})
        threads.end("never seen")
    ended = [call for each in made for call, _ in each.calls]
    assert sorted(ended) == ["end b", "end c", "end d"]


async def test_pictures_of_a_thread_are_in_order_and_those_of_another_do_not_wait():
    allowed = threading.Event()
    slow, fast = Encoders(allowed), Encoders()
    with ThreadPoolExecutor(1, "slow") as first, ThreadPoolExecutor(1, "fast") as second:
        threads = EncodingThreads([EncodingThread(first, slow), EncodingThread(second, fast)])
        a, b = threads.of("a"), threads.of("b")
        await a.start(a.process(None, None, 1))
        waiting = asyncio.create_task(a.start(a.process(None, None, 2)))
        for number in range(3):
            await b.start(b.process(None, None, number))
        await b.start(b.process(None, None, 3))
        assert not waiting.done()
        allowed.set()
        await waiting
        await a.start(a.process(None, None, 3))
        for thread in (a, b):
            await thread.start(asyncio.sleep(0))
    assert [job for job, _ in slow.calls] == [1, 2, 3]
    assert [job for job, _ in fast.calls] == [0, 1, 2, 3]
    assert {name.partition("_")[0] for _, name in slow.calls} == {"slow"}


async def test_a_picture_that_waits_is_dropped_with_its_task():
    allowed = threading.Event()
    encoders = Encoders(allowed)
    with ThreadPoolExecutor(1) as executor:
        thread = EncodingThread(executor, encoders)
        await thread.start(thread.process(None, None, 1))
        waiting = asyncio.create_task(thread.start(thread.process(None, None, 2)))
        await asyncio.sleep(0)
        waiting.cancel()
        await asyncio.gather(waiting, return_exceptions=True)
        allowed.set()
    assert 2 not in [job for job, _ in encoders.calls]


def test_a_process_of_two_cores_has_one_thread(monkeypatch):
    for cores, threads in ((1, 1), (2, 1), (4, 2), (16, 8), (64, 8)):
        monkeypatch.setattr("os.sched_getaffinity", lambda _, cores=cores: set(range(cores)))
        assert thread_count() == threads
