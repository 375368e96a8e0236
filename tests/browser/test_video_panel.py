"""The camera panel decodes real H.264 in a real Chromium, from the joiner's frames on."""

import threading
from contextlib import contextmanager

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from playwright.sync_api import expect

from tests.browser.robot_page import (
    video_age,
    video_picture,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)

WIDTH, HEIGHT = 320, 180


class Encoder:
    """H.264 encoder of plain pictures: one frame a message, a key frame first."""

    def __init__(self):
        self._codec = av.CodecContext.create("libx264", "w")
        self._codec.width, self._codec.height, self._codec.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        self._codec.options = {"preset": "superfast", "tune": "zerolatency", "x264-params": "keyint=250"}

    def frame(self, red, green, blue):
        picture = np.full((HEIGHT, WIDTH, 3), (red, green, blue), dtype=np.uint8)
        (packet,) = self._codec.encode(av.VideoFrame.from_ndarray(picture, format="rgb24"))
        return CompressedVideo(data=bytes(packet), format="h264"), packet.is_keyframe


def pixel(page):
    return page.evaluate(
        "() => { const c = document.querySelector('.camera canvas');"
        "return [...c.getContext('2d').getImageData(c.width / 2, c.height / 2, 1, 1).data].slice(0, 3) }"
    )


@contextmanager
def repeated(act, interval_s=0.1):
    """Call an action again and again during the block."""
    end = threading.Event()

    def go():
        while not end.wait(interval_s):
            act()

    thread = threading.Thread(target=go)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()


def publisher_of(plant, topic):
    async def declare():
        return plant.session.declare_publisher("hall", "arm", topic)

    return plant.call(declare())


def test_a_joiner_sees_the_frames_since_the_key_frame_then_live_ones(open_page, plant):
    publisher, encoder = publisher_of(plant, "video/front"), Encoder()
    for colour in ((200, 30, 30), (30, 200, 30)):
        message, key = encoder.frame(*colour)
        publisher.put(message, key_frame=key)
    page = open_page("#/hall/arm", drawn=False)
    expect(video_picture(page)).to_have_attribute("data-drawn", "true")
    page.wait_for_function("() => document.querySelector('.camera canvas').width === 320")
    # The earlier picture is shown as stale, because its age is not known.
    expect(video_age(page)).to_have_text("stale, age unknown")
    red, green, _ = pixel(page)
    assert green > 150 > red
    with repeated(lambda: publisher.put(encoder.frame(30, 30, 200)[0])):
        expect(video_age(page)).to_have_count(0)
        page.wait_for_function(
            "() => { const c = document.querySelector('.camera canvas');"
            "return c.getContext('2d').getImageData(9, 9, 1, 1).data[2] > 150 }"
        )
    expect(video_age(page)).to_contain_text("stale 1")
    publisher.close()
