"""Reduced views for a slow line: the requests to the renderer, and their times."""

import asyncio
from types import SimpleNamespace

import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from robomesh.contract.header import Header
from robomesh.contract.keys import parse_key
from robomesh.errors import RefusedError
from robomesh.publications.subscription import Sample
from robomesh.schemas.robomesh_pb2 import ViewAnswer, ViewRequest
from robomesh.wire.session import open_session
from services.console.common.requested_views import LOWEST_STEP, Views, reduced_request
from services.console.websocket import adaptive_video, send_queues
from services.console.websocket.adaptive_video import AdaptiveVideo
from services.console.websocket.framing import SampleBatch

KEY = "robomesh/s/r/video/top"
KEY_FRAME = b"\0\0\0\1\x67\x42\xc0\x1f\0\0\0\1\x65\x88"
DELTA = b"\0\0\0\1\x41\x9a\x01"
WHOLE = ViewAnswer(topic="video/free-0", image="image/free-0", width=1280, height=720, fps=30)


def sample(number, data, key=KEY):
    payload = CompressedVideo(data=data).SerializeToString()
    return Sample(key, parse_key(key), payload, Header(1, number, 0), True, 0.0)


@pytest.mark.parametrize("step", range(1, LOWEST_STEP + 1))
def test_each_step_is_smaller_slower_and_of_fewer_bits_than_the_one_above(step):
    above, below = (reduced_request(ViewRequest(of="top"), WHOLE, each) for each in (step - 1, step))
    assert below.of == "top"
    assert below.width < above.width
    assert below.height < above.height
    assert below.fps < above.fps
    assert below.most_bits_per_s < (above.most_bits_per_s or 1e9)
    assert below.width % 2 == below.height % 2 == 0


def test_a_small_view_is_never_reduced_to_a_size_that_no_picture_has():
    small = reduced_request(ViewRequest(), ViewAnswer(width=64, height=64, fps=1), LOWEST_STEP)
    assert (small.width, small.height, small.fps) == (64, 64, 1.0)


class SharedSubscriptions:
    """Recorder of subscriptions."""

    def __init__(self):
        self.joined = {}
        self.log = []

    def join(self, key, sink):
        self.joined.setdefault(key, []).append(sink)
        self.log.append(key)

    def leave(self, key, sink):
        self.joined[key].remove(sink)
        if not self.joined[key]:
            del self.joined[key]

    def give(self, key, sample):
        for sink in tuple(self.joined[key]):
            sink(SampleBatch([sample]))

    def give_all(self, sample):
        for key in tuple(self.joined):
            self.give(key, sample)


class Steps:
    """Reduced views of a renderer; `refused`: there are none."""

    def __init__(self, refused=False):
        self.refused, self.asked = refused, 0

    async def reduced(self, key, step, asker):
        self.asked += 1
        if self.refused:
            raise RefusedError("a recording's video is as it is")
        return key if step == 0 else f"{key}-{step}"


class Clock:
    def __init__(self, monkeypatch):
        self.now = 100.0
        for module in (adaptive_video, send_queues):
            monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now))


def watch(feeds, views=None):
    return AdaptiveVideo(
        KEY, feeds, views or Steps(), asker="li", on_frame=lambda: None, on_starved=lambda key: None
    )


async def settled():
    for _ in range(10):
        await asyncio.sleep(0)


async def test_a_fast_browser_is_never_reduced(monkeypatch):
    clock, feeds = Clock(monkeypatch), SharedSubscriptions()
    video = watch(feeds)
    for number in range(300):
        clock.now += 0.033
        feeds.give(KEY, sample(number, DELTA if number % 60 else KEY_FRAME))
        assert video.pop() is not None
    await settled()
    assert feeds.log == [KEY]
    video.close()
    assert feeds.joined == {}


async def test_a_slow_browser_is_reduced_and_gets_no_old_frames(monkeypatch):
    clock, feeds = Clock(monkeypatch), SharedSubscriptions()
    video = watch(feeds)
    for number in range(40):
        clock.now += 0.033
        feeds.give(KEY, sample(number, DELTA if number else KEY_FRAME))
    assert video.pop() is None
    await settled()
    assert (video.step, list(feeds.joined)) == (1, [f"{KEY}-1"])
    for number in range(40):
        clock.now += 0.066
        if f"{KEY}-1" in feeds.joined:
            feeds.give(f"{KEY}-1", sample(number, DELTA if number else KEY_FRAME))
        await settled()
    video.pop()
    await settled()
    assert (video.step, list(feeds.joined)) == (2, [f"{KEY}-2"])
    video.close()
    assert feeds.joined == {}


async def test_a_blocked_browser_requests_no_reduced_view(monkeypatch):
    clock, feeds, steps = Clock(monkeypatch), SharedSubscriptions(), Steps()
    video = watch(feeds, steps)
    for number in range(300):
        clock.now += 0.033
        feeds.give(KEY, sample(number, DELTA if number % 60 else KEY_FRAME))
        await settled()
    assert steps.asked == 0
    video.pop()  # the line accepts data again
    await settled()
    assert (video.step, list(feeds.joined)) == (1, [f"{KEY}-1"])
    video.close()


async def test_a_view_that_cannot_be_reduced_goes_on_at_key_frames(monkeypatch):
    clock, feeds = Clock(monkeypatch), SharedSubscriptions()
    video = watch(feeds, Steps(refused=True))
    for number in range(40):
        clock.now += 0.033
        feeds.give(KEY, sample(number, DELTA if number else KEY_FRAME))
    await settled()
    assert (video.step, list(feeds.joined)) == (0, [KEY])
    assert video.pop() is None
    feeds.give(KEY, sample(12, DELTA))
    assert video.pop() is None
    feeds.give(KEY, sample(13, KEY_FRAME))
    assert video.pop().header.sequence == 13
    video.close()


async def test_a_refused_reduction_is_not_requested_with_every_frame(monkeypatch):
    clock, feeds, steps = Clock(monkeypatch), SharedSubscriptions(), Steps(refused=True)
    video = watch(feeds, steps)
    for number in range(300):
        clock.now += 0.033
        feeds.give(KEY, sample(number, DELTA if number % 10 else KEY_FRAME))
        if number % 20 == 0:
            video.pop()
        await settled()
    assert 1 <= steps.asked <= 2  # in ten seconds
    video.close()


async def test_a_recovered_browser_gets_the_larger_view_later_after_each_failure(monkeypatch):
    monkeypatch.setattr(adaptive_video, "_ADAPT_EVERY_S", 0.0)
    clock, feeds = Clock(monkeypatch), SharedSubscriptions()
    video = watch(feeds)

    async def choke():
        for number in range(40):
            clock.now += 0.033
            feeds.give_all(sample(number, DELTA if number else KEY_FRAME))
        video.pop()
        await settled()

    async def take(seconds):
        until = clock.now + seconds
        while clock.now < until:
            clock.now += 0.5
            feeds.give_all(sample(0, KEY_FRAME))
            video.pop()
            await settled()

    await choke()
    assert video.step == 1
    await take(8.0)
    assert video.step == 1
    await take(4.0)
    assert video.step == 0
    await choke()
    assert video.step == 1
    # It was too much: the next attempt is after twice the time.
    await take(12.0)
    assert video.step == 1
    await take(10.0)
    assert video.step == 0
    video.close()


async def test_shared_and_requested_views_are_reduced(mesh):
    asked = []

    async def answer(request):
        asked.append(request.message)
        number = len(asked)
        return ViewAnswer(
            topic=f"video/free-{number}",
            image=f"image/free-{number}",
            width=request.message.width or 1280,
            height=request.message.height or 720,
            fps=request.message.fps or 30,
        )

    async with open_session(mesh) as own, open_session(mesh) as other:
        other.answer("s", "r", "views/*", answer)
        views = Views(own)
        assert await views.reduced(KEY, 1, "li") == "robomesh/s/r/video/free-2"
        assert (asked[-1].of, asked[-1].width, asked[-1].height, asked[-1].fps) == ("top", 640, 360, 15)
        page_asked = ViewRequest(of="front", width=320, height=180, fps=10)
        views.learn(
            "robomesh/s/r", page_asked, ViewAnswer(topic="video/free-9", width=320, height=180, fps=10)
        )
        await views.reduced("robomesh/s/r/video/free-9", 1, "li")
        assert (asked[-1].of, asked[-1].width, asked[-1].fps) == ("front", 160, 5)
        assert await views.reduced(KEY, 0, "li") == KEY
