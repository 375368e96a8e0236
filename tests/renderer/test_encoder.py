"""Encoders: their output is decoded by FFmpeg, as a browser would."""

import av
import cv2
import numpy as np
import pytest

from renderer.encoding import encoder as encoders
from renderer.encoding.encoder import H264Encoder, jpeg, open_encoder
from renderer.errors import NoEncoderError
from renderer.service.key_frames import KeyFrameClock

SIZE = (320, 180)
IDR, SPS, PPS = 5, 7, 8


def pictures(count):
    """Yield pictures of a red square that moves over grey."""
    for number in range(count):
        picture = np.full((SIZE[1], SIZE[0], 3), 128, dtype=np.uint8)
        picture[60:120, 10 + 4 * number : 70 + 4 * number] = (200, 30, 30)
        yield picture


def units(data):
    """Return the types of the NAL units of an Annex B packet."""
    assert data.startswith((b"\0\0\0\1", b"\0\0\1"))
    starts = [at + 3 for at in range(len(data) - 3) if data[at : at + 3] == b"\0\0\1"]
    return [data[at] & 31 for at in starts]


def decoded(packets):
    decoder = av.CodecContext.create("h264", "r")
    # One thread: several threads would delay pictures.
    decoder.thread_count = 1
    frames = [frame for data in packets for frame in decoder.decode(av.Packet(data))]
    return frames + decoder.decode(None)


def test_each_picture_is_one_packet_and_all_are_decoded():
    encoder = open_encoder(SIZE, 30)
    packets = [
        encoder.encode(picture, key_frame=number % 10 == 0) for number, picture in enumerate(pictures(40))
    ]
    frames = decoded([packet.data for packet in packets])
    assert len(frames) == 40
    assert [packet.key_frame for packet in packets] == [number % 10 == 0 for number in range(40)]
    for frame, picture in zip(frames, pictures(40), strict=True):
        seen = cv2.cvtColor(frame.to_ndarray(format="yuv420p"), cv2.COLOR_YUV2RGB_I420)
        assert np.abs(seen.astype(int) - picture).mean() < 4


def test_only_key_frames_are_intra_and_have_parameter_sets():
    encoder = open_encoder(SIZE, 30)
    for number, picture in enumerate(pictures(30)):
        kinds = units(encoder.encode(picture, key_frame=number in (0, 7)).data)
        if number in (0, 7):
            assert [kind for kind in kinds if kind in (SPS, PPS, IDR)] == [SPS, PPS, IDR]
        else:
            assert not {SPS, PPS, IDR} & set(kinds)


def test_a_stream_can_be_joined_at_any_key_frame():
    encoder = open_encoder(SIZE, 30)
    packets = [encoder.encode(picture, key_frame=n in (0, 12)).data for n, picture in enumerate(pictures(20))]
    assert len(decoded(packets[12:])) == 8


def test_the_stream_declares_its_colour_space():
    encoder = H264Encoder(SIZE, 30, codec="libx264")
    frame = decoded([encoder.encode(picture, key_frame=True).data for picture in pictures(1)])[0]
    assert (frame.colorspace, frame.color_range) == (6, 1)


def test_an_encoder_that_cannot_be_opened_is_an_error():
    with pytest.raises(NoEncoderError, match="libx264 cannot be opened"):
        H264Encoder((0, 0), 30, codec="libx264")


def test_a_jpeg_shows_the_picture():
    (picture,) = pictures(1)
    seen = cv2.cvtColor(cv2.imdecode(np.frombuffer(jpeg(picture), np.uint8), 1), cv2.COLOR_BGR2RGB)
    assert np.abs(seen.astype(int) - picture).mean() < 4


def test_a_key_frame_is_first_and_then_every_two_seconds():
    clock = KeyFrameClock()
    made = []
    for tick in range(150):
        now = 100.0 + tick / 30
        if clock.due(now):
            clock.made(now)
            made.append(tick)
    assert made == [0, 60, 120]


def test_at_most_one_key_frame_a_second_is_forced():
    clock = KeyFrameClock()
    made = []
    for tick in range(90):
        now = 100.0 + tick / 30
        clock.ask(now)
        if clock.due(now):
            clock.made(now)
            made.append(tick)
    assert made == [0, 30, 60]


@pytest.mark.slow
def test_a_limited_bit_rate_is_kept_for_any_content():
    size, fps, most = (640, 360), 15, 250e3
    noise = np.random.default_rng(0)
    encoder = open_encoder(size, fps, most_bits_per_s=most)
    bits = []
    for number in range(10 * fps):
        # Every pixel changes in every picture.
        picture = cv2.resize(noise.integers(0, 256, (18, 32, 3), dtype=np.uint8), size)
        bits.append(8 * len(encoder.encode(picture, key_frame=number % (2 * fps) == 0).data))
    seconds = [sum(bits[at : at + fps]) for at in range(fps, len(bits), fps)]
    assert sum(seconds) / len(seconds) < 1.1 * most
    assert max(seconds) < 1.6 * most
    # A key frame takes at most half a second to send.
    assert max(bits) < 0.5 * most


def test_a_preferred_encoder_that_does_not_work_is_replaced():
    encoder = open_encoder(SIZE, 30, codec="h264_that_there_is_not")
    assert encoder.name in ("h264_nvenc", "libx264")


@pytest.mark.parametrize("most_bits_per_s", [0.0, 250e3])
def test_ffmpeg_knows_the_options_of_nvenc(most_bits_per_s):
    """They are read before the driver is loaded, so this holds without a GPU too."""
    reason = ""
    try:
        H264Encoder((640, 360), 30, codec="h264_nvenc", most_bits_per_s=most_bits_per_s)
    except NoEncoderError as error:
        reason = str(error)
    assert "option" not in reason
    assert not reason or any(cause in reason for cause in encoders._CAUSES.values())


def test_the_reason_against_nvenc_is_in_plain_words():
    lines = ["OpenEncodeSessionEx failed: unsupported device (2): (no details)", "No capable devices found"]
    assert encoders._reason(lines) == f"this GPU has no NVENC ({'; '.join(lines)})"
    assert encoders._reason(["Cannot load libnvidia-encode.so.1"]).startswith("the NVIDIA driver's libnvidia")
    assert encoders._reason(["dimensions not set", "dimensions not set"]) == "dimensions not set"


def test_the_reason_for_a_worse_encoder_is_logged(monkeypatch, caplog):
    monkeypatch.setattr(encoders, "_CODECS", {"h264_none": {}, "libx264": encoders._CODECS["libx264"]})
    with caplog.at_level("INFO"):
        assert encoders.best_codec(SIZE, 30) == "libx264"
    assert "h264_none cannot be opened" in caplog.text
    assert "libx264 is used instead" in caplog.text
    monkeypatch.setattr(encoders, "_CODECS", {"h264_none": {}})
    with pytest.raises(NoEncoderError, match=r"no H\.264 encoder works: h264_none cannot be opened"):
        encoders.best_codec(SIZE, 30)
