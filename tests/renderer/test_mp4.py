"""MP4 from a stream's packets, read back by FFmpeg, complete or truncated."""

import io

import av
import numpy as np
import pytest

from renderer.encoding.encoder import H264Encoder
from renderer.encoding.mp4 import FragmentedMp4
from renderer.errors import Mp4Error
from robomesh.recordings.h264 import is_key_frame, picture_size

# Not a multiple of 16: the parameter set has a cropping rectangle.
SIZE = (334, 190)
START_NS = 1_700_000_000_000_000_000


def packets(count, *, size=SIZE, key_frames=10):
    """Yield packets of a red square that moves over grey."""
    encoder = H264Encoder(size, 30, codec="libx264")
    for number in range(count):
        picture = np.full((size[1], size[0], 3), 128, dtype=np.uint8)
        picture[60:120, 10 + 4 * number : 70 + 4 * number] = (200, 30, 30)
        yield encoder.encode(picture, key_frame=number % key_frames == 0).data


def written(count, *, times_ns=None, **options):
    mp4 = FragmentedMp4()
    times = times_ns or [START_NS + number * 40_000_000 for number in range(count)]
    data = [mp4.add(packet, at) for packet, at in zip(packets(count, **options), times, strict=True)]
    return mp4, data


def read(data):
    with av.open(io.BytesIO(data)) as file:
        return list(file.decode(video=0))


def test_every_picture_is_read_back_at_its_time():
    mp4, data = written(30)
    frames = read(b"".join(data))
    assert [round(frame.time, 3) for frame in frames] == [round(0.04 * number, 3) for number in range(30)]
    assert {(frame.width, frame.height) for frame in frames} == {SIZE}
    red = frames[20].to_ndarray(format="rgb24")[90, 100].astype(int)
    assert np.abs(red - (200, 30, 30)).max() < 25
    assert mp4.pictures == 30
    assert mp4.duration_s == pytest.approx(29 * 0.04 + 1 / 30, abs=1e-4)


def test_an_unfinished_file_plays_up_to_its_end():
    _, data = written(30)
    whole = b"".join(data[:17])
    assert len(read(whole)) == 17
    assert len(read(whole + data[17][: len(data[17]) // 2])) == 17


def test_a_reader_finds_the_key_frames():
    _, data = written(30)
    with av.open(io.BytesIO(b"".join(data))) as file:
        key_frames = [packet.is_keyframe for packet in file.demux(video=0) if packet.size]
    assert key_frames == [number % 10 == 0 for number in range(30)]


def test_a_file_begins_with_the_first_key_frame():
    mp4 = FragmentedMp4()
    stream = list(packets(15))
    assert [is_key_frame(packet) for packet in stream] == [number % 10 == 0 for number in range(15)]
    data = [mp4.add(packet, START_NS + number * 10**7) for number, packet in enumerate(stream[3:])]
    assert [bool(part) for part in data] == [False] * 7 + [True] * 5
    assert len(read(b"".join(data))) == 5


def test_repeated_or_decreasing_times_keep_the_order():
    times = [START_NS + at * 10**6 for at in (0, 40, 40, 30, 200)]
    frames = read(b"".join(written(5, times_ns=times)[1]))
    at = [frame.time for frame in frames]
    assert at == sorted(set(at))
    assert at[-1] == pytest.approx(0.2, abs=1e-4)


def test_long_gaps_between_pictures_are_kept():
    times = [START_NS + at * 10**9 for at in (0, 1, 3600, 3601)]
    frames = read(b"".join(written(4, times_ns=times)[1]))
    assert [frame.time for frame in frames] == pytest.approx([0, 1, 3600, 3601])


def test_a_stream_with_changed_parameters_is_rejected():
    mp4, _ = written(5)
    (other,) = packets(1, size=(640, 360))
    with pytest.raises(Mp4Error, match="has changed"):
        mp4.add(other, START_NS + 10**9)


@pytest.mark.parametrize("packet", [b"", b"no video", b"\0\0\0\1", b"\0\0\1\x09\xf0"])
def test_a_packet_without_a_picture_is_rejected(packet):
    with pytest.raises(Mp4Error, match=r"no H\.264 picture"):
        FragmentedMp4().add(packet, START_NS)


def test_a_key_frame_without_parameter_sets_is_rejected():
    with pytest.raises(Mp4Error, match="SPS and PPS"):
        FragmentedMp4().add(b"\0\0\1\x65abc", START_NS)


@pytest.mark.parametrize("size", [(64, 64), (320, 180), (640, 360), (854, 480), (1280, 720), (1920, 1080)])
def test_the_size_is_read_from_the_parameter_set(size):
    (packet,) = packets(1, size=size)
    sps = next(unit for unit in packet.split(b"\0\0\1") if unit and unit[0] & 31 == 7)
    assert picture_size(sps.rstrip(b"\0")) == size


@pytest.mark.parametrize("sps", [b"\x67", b"\x67\x42", b"\x67" + b"\0" * 9, b"\x67\x64\x00\x1f\x00"])
def test_an_invalid_parameter_set_is_rejected(sps):
    reason = r"truncated|not supported|not 4:2:0"
    with pytest.raises(ValueError, match=reason):
        picture_size(sps)
    with pytest.raises(Mp4Error, match=reason):
        FragmentedMp4().add(b"\0\0\1" + sps + b"\0\0\1\x68\x01\0\0\1\x65abc", START_NS)
