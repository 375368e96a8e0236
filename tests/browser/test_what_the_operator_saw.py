"""With a frozen picture no operator can start a motion; the audit log has the picture that was seen."""

import asyncio
import json
import re
from statistics import median

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from playwright.sync_api import expect

from services.recorder import recorder
from tests.browser.robot_page import (
    ARM,
    button,
    clear_stop,
    control_notice,
    degrees,
    fault,
    joints_notice,
    ready,
    region,
    requests,
    scene,
    serious,
    set_speed,
    state_word,
    stop_button,
    video_picture,
)
from tests.browser.test_video_panel import publisher_of, repeated
from tests.site import wait_until

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)
BLOCK, BITS = 32, 16
PRESSES = 30
KEY_FRAME_EACH = 10
# At each press: the number on the canvas, as the browser shows it to the operator.
READ = """(canvas, block, bits) => {
    const pixels = canvas.getContext('2d').getImageData(0, 0, block * bits, block).data;
    let number = 0;
    for (let bit = 0; bit < bits; bit++)
        if (pixels[4 * ((block / 2) * block * bits + bit * block + block / 2)] > 127) number |= 1 << bit;
    return number;
}"""
READ_STILL = f"([block, bits]) => ({READ})(document.querySelector('.seen-still canvas'), block, bits)"
READ_AT_PRESS = f"""([block, bits]) => {{
    const canvas = document.querySelector('.camera canvas');
    const read = () => ({READ})(canvas, block, bits);
    window.seen = [];
    const press = (event) => event.target.closest('.command-row') && window.seen.push(read());
    window.addEventListener('click', press, true);
}}"""


class NumberedVideo:
    """Video whose pictures show their numbers as black and white squares, one a bit."""

    def __init__(self, publisher):
        self._publisher = publisher
        self.count = 0
        self.sequences = {}
        self._codec = av.CodecContext.create("libx264", "w")
        self._codec.width, self._codec.height, self._codec.pix_fmt = BLOCK * BITS, BLOCK, "yuv420p"
        self._codec.options = {
            "preset": "superfast",
            "tune": "zerolatency",
            "x264-params": f"keyint={KEY_FRAME_EACH}",
        }

    def publish(self):
        self.count += 1
        squares = [255 * (self.count >> bit & 1) for bit in range(BITS)]
        row = np.repeat(np.array(squares, dtype=np.uint8), BLOCK)
        picture = np.repeat(np.tile(row, (BLOCK, 1))[:, :, np.newaxis], 3, axis=2)
        (packet,) = self._codec.encode(av.VideoFrame.from_ndarray(picture, format="rgb24"))
        message = CompressedVideo(data=bytes(packet), format="h264")
        header = self._publisher.put(message, key_frame=packet.is_keyframe)
        self.sequences[self.count] = header.sequence


def trace_button(page):
    return page.get_by_role("button", name=re.compile("^Trace o"))


@pytest.fixture
def video(plant):
    publisher = publisher_of(plant, "video/front")
    yield NumberedVideo(publisher)
    publisher.close()


@pytest.fixture
def recorded(plant, tmp_path):
    """Run a recorder of the front view, which records while the controller's trace is on."""

    async def start():
        settings = recorder.Settings(site="hall", robots=("arm",), folder=tmp_path, views=("front",))
        return plant.loop.create_task(recorder.serve(plant.session, settings))

    async def end():
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    task = plant.call(start())
    yield
    plant.call(end())


def until(plant, condition):
    """Wait until the state of the arm's recording meets a condition."""

    async def wait():
        async with asyncio.timeout(60):
            async for sample in plant.session.subscribe("robomesh/hall/arm/recording"):
                if condition(sample.message()):
                    return

    asyncio.run_coroutine_threadsafe(wait(), plant.loop).result(70)


def count_of(recording, topic):
    return sum(each.messages for each in recording.topics if each.topic.endswith(topic))


def traces(plant):
    """Return the audit entries of the Trace button."""
    lines = (plant.audit / "hall" / "arm.jsonl").read_text().splitlines()
    return [entry for entry in map(json.loads, lines) if entry["request"].startswith("TRACE")]


def test_a_frozen_video_lets_no_motion_start_until_it_is_live_or_off(open_page, video):
    page = open_page(ARM, drawn=False)
    with repeated(video.publish):
        expect(video_picture(page)).to_have_attribute("data-drawn", "true")
        ready(page)
        expect(button(page, "waist +1°")).to_be_enabled()
    for name in ("Home", "waist +1°"):
        expect(button(page, name)).to_be_disabled()
    why = re.compile("^No new motion: the video “Front”.* is \\d+\\s*s old")
    expect(control_notice(page)).to_have_text(why)
    expect(joints_notice(page)).to_have_text(why)
    expect(page.get_by_role("button", name="Stop request")).to_be_enabled()
    expect(button(page, "Hold")).to_be_enabled()
    with repeated(video.publish):
        expect(button(page, "waist +1°")).to_be_enabled()
    expect(button(page, "waist +1°")).to_be_disabled()
    page.get_by_label("View", exact=True).last.select_option("off")
    expect(video_picture(page)).to_have_count(0)
    expect(button(page, "waist +1°")).to_be_enabled()
    button(page, "Release").click()


def test_a_video_that_freezes_ends_a_jog_but_no_motion(open_page, video):
    page = open_page(ARM, drawn=False)
    with repeated(video.publish):
        expect(video_picture(page)).to_have_attribute("data-drawn", "true")
        ready(page)
        page.get_by_label("Speed").fill("1")
        page.get_by_label("Speed").press("Enter")
        button(region(page, "Joints"), "5").click()
        before = degrees(page, "waist")
        for _ in range(3):
            button(page, "waist +5°").click()
        expect(state_word(page)).to_have_text("Moving")
    expect(button(page, "waist +5°")).to_be_disabled()
    expect(state_word(page)).to_have_text("Idle", timeout=60_000)
    page.wait_for_timeout(1000)
    # The step that had begun, and none of those that waited.
    assert degrees(page, "waist") == pytest.approx(before + 5, abs=0.1)
    button(page, "Release").click()


def test_a_step_of_the_tool_is_followed_to_its_end_although_the_video_freezes(open_page, video):
    page = open_page(ARM, drawn=False)
    tool = region(page, "Tool")
    with repeated(video.publish):
        expect(video_picture(page)).to_have_attribute("data-drawn", "true")
        ready(page)
        set_speed(page, 1)
        button(tool, "Base").click()
        button(tool, "20").click()
        button(tool, "Base X +20\u202fmm").click()
        expect(state_word(page)).to_have_text("Running · moving")
    expect(button(tool, "Base X +20\u202fmm")).to_be_disabled()
    expect(tool.get_by_label("Outcome", exact=True)).to_contain_text("Done: Base X +20")
    button(page, "Release").click()


def test_a_frozen_state_lets_no_motion_start(open_page, plant):
    page = open_page(ARM, drawn=False)
    ready(page)
    with fault(plant, "burst"):
        expect(button(page, "Home")).to_be_disabled()
        expect(control_notice(page)).to_have_text(re.compile("^No (new )?motion: "))
        expect(page.get_by_role("button", name="Stop request")).to_be_enabled()
    expect(button(page, "Home")).to_be_enabled(timeout=60_000)
    button(page, "Release").click()


def test_a_drawing_that_stands_still_while_the_arm_moves_lets_no_motion_start(open_page):
    page = open_page(ARM)
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    ready(page)
    set_speed(page, 1)
    button(region(page, "Joints"), "5").click()
    page.evaluate("() => { window.requestAnimationFrame = () => 1; }")
    # At rest the old picture is still right.
    page.wait_for_timeout(1500)
    expect(button(page, "waist +5°")).to_be_enabled()
    button(page, "waist +5°").click()
    expect(state_word(page)).to_have_text("Moving")
    expect(joints_notice(page)).to_have_text(re.compile("^No new motion: the 3-D picture is .* old"))
    expect(button(page, "waist +5°")).to_be_disabled()
    stop_button(page).click()
    clear_stop(page)


def test_the_audit_log_names_the_picture_that_was_on_the_screen(open_page, plant, video):
    page = open_page(ARM, drawn=False)
    with repeated(video.publish, interval_s=0.04):
        expect(video_picture(page)).to_have_attribute("data-drawn", "true")
        ready(page)
        page.evaluate(READ_AT_PRESS, [BLOCK, BITS])
        before = len(traces(plant))
        for count in range(PRESSES):
            trace_button(page).click()
            page.wait_for_timeout(7 * (count % 9))  # any phase of the pictures
        wait_until(lambda: len(traces(plant)) == before + PRESSES)
        seen = page.evaluate("() => window.seen")
    written = [entry["values"] for entry in traces(plant)[before:]]
    assert len(seen) == len(written) == PRESSES
    for number, values in zip(seen, written, strict=True):
        assert values["page_view"] == "front"
        assert abs(int(values["page_picture"]) - video.sequences[number]) <= 1
    # On a busy machine a single one may be late.
    for age in ("page_picture_age_s", "page_state_age_s"):
        assert 0 <= median(float(values[age]) for values in written) < 1
    button(page, "Release").click()


@pytest.mark.long
def test_the_picture_of_a_request_is_opened_from_a_recording(open_page, plant, video, recorded):
    page = open_page(ARM, drawn=False)
    with repeated(video.publish):
        expect(video_picture(page)).to_have_attribute("data-drawn", "true")
        ready(page)
        trace = trace_button(page)
        if trace.get_attribute("aria-pressed") == "true":
            trace.click()
        expect(trace).to_have_attribute("aria-pressed", "false")
        trace.click()
        expect(trace).to_have_attribute("aria-pressed", "true")
        until(plant, lambda recording: recording.open and count_of(recording, "video/front") > 20)
        page.evaluate(READ_AT_PRESS, [BLOCK, BITS])
        trace.click()
        until(plant, lambda recording: not recording.open)
        ended = video.count
        wait_until(lambda: video.count > ended + 40)
        set_speed(page, 90)
        button(page, "Release").click()
    button(page, "Requests").click()
    requests(page).filter(has_text="trace off").first.get_by_role("button").click()
    dialog = page.get_by_role("dialog", name="What the page showed")
    still = dialog.get_by_role("img")
    expect(still).to_be_visible()
    expect(dialog).to_contain_text("Reported by the page")
    (seen,) = page.evaluate("() => window.seen")
    assert page.evaluate(READ_STILL, [BLOCK, BITS]) == pytest.approx(seen, abs=1)
    assert serious(page) == []
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    # A picture that no recording has is said to be missing.
    requests(page).get_by_role("button").first.click()
    expect(dialog).to_contain_text("No recording of this site has this picture.")
