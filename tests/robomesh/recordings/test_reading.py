"""Reading files by topic and time: closed, unchunked, truncated, and of other programs."""

import struct
import tracemalloc

import pytest
import zstandard
from mcap.records import Channel, Chunk, ChunkIndex, Schema
from mcap.writer import Writer

from robomesh.recordings import layout, records
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.files import describe_file
from robomesh.recordings.h264 import holds_key_frame
from robomesh.recordings.layout import layout_of
from robomesh.recordings.names import find_file
from robomesh.recordings.reading import RecordingFile
from tests.recordings import START_NS, write_recording

JOINTS, VIDEO = "robomesh/site/arm/joints", "robomesh/site/arm/video/front"


def at(seconds):
    return START_NS + round(seconds * 1e9)


def seconds(messages):
    return [(message.received_ns - START_NS) / 1e9 for message in messages]


@pytest.fixture(params=["chunked", "unchunked", "cut"])
def file(request, tmp_path):
    path = write_recording(tmp_path / "trial.mcap", chunked=request.param == "chunked")
    if request.param == "cut":
        # Its writer was killed: no summary, and half a message at the end.
        with path.open("rb") as stream:
            whole = stream.read()
        path.write_bytes(whole[: whole.rindex(b"399") + 3 if b"399" in whole else len(whole) * 9 // 10])
    with RecordingFile(path) as opened:
        yield opened


def test_range_of_one_topic_has_the_messages_received_in_it(file):
    found = list(file.messages([JOINTS], start_ns=at(1.0), end_ns=at(1.05)))
    assert seconds(found) == [1.0, 1.01, 1.02, 1.03, 1.04]
    assert {message.topic for message in found} == {JOINTS}
    assert found[0].source_ns == at(1.0) - 1000


def test_messages_of_all_topics_are_sorted_by_time(file):
    times = [message.received_ns for message in file.messages(start_ns=at(0.5), end_ns=at(1.5))]
    assert len(times) > 100
    assert times == sorted(times)


def test_state_at_a_time_is_the_newest_message_of_each_topic(file):
    newest = file.state_at([*file.topics], at(2.345))
    assert seconds([newest[JOINTS], newest["robomesh/site/arm/events"]]) == [2.34, 2.0]
    assert seconds([newest["robomesh/site/arm/description"]]) == [0.0]


def test_last_messages_of_a_topic_are_sorted_oldest_first(file):
    assert seconds(file.last(JOINTS, at(2.0), 4)) == [1.97, 1.98, 1.99, 2.0]
    assert seconds(file.last("robomesh/site/arm/events", at(2.5), 100)) == [0.0, 1.0, 2.0]


def test_video_begins_at_the_previous_key_frame(file):
    key_frame = file.newest(VIDEO, at(1.3), holds_key_frame)
    assert key_frame is not None
    assert seconds([key_frame]) == [1.0]
    assert holds_key_frame(key_frame.data)
    later = file.newest(VIDEO, at(1.3))
    assert not holds_key_frame(later.data)


def test_attachment_is_read_from_its_position(file):
    assert file.attachment("mesh/base") == b"glTF of the base"
    with pytest.raises(RecordingError, match="has no attachment 'x': there are mesh/base"):
        file.attachment("x")


def test_error_of_a_missing_topic_lists_the_topics(file):
    with pytest.raises(RecordingError, match=r"has no topic 'x': there are .*robomesh/site/arm/joints"):
        next(file.messages(["x"]))


def test_late_message_in_a_chunk_is_still_in_order(tmp_path):
    path = tmp_path / "late.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=64)
        writer.start()
        schema = writer.register_schema("text", "", b"")
        channel = writer.register_channel("words", "", schema)
        for time_ns in (1, 2, 9, 3, 4, 8, 5, 6, 7, 10):
            writer.add_message(channel, time_ns, b"a word that fills its chunk soon", time_ns)
        writer.finish()
    with RecordingFile(path) as file:
        assert len(file.layout.blocks) > 3
        assert [message.received_ns for message in file.messages()] == list(range(1, 11))
        assert file.newest("words", 8).received_ns == 8
        assert file.schema_name("words") == "text"
        assert file.decoder("words") is None


@pytest.mark.parametrize("keep", range(0, 4000, 391))
def test_truncated_file_is_read_to_its_end_or_refused_with_a_sentence(tmp_path, keep):
    path = write_recording(tmp_path / "trial.mcap", seconds=0.3)
    path.write_bytes(path.read_bytes()[:keep])
    words = ""
    try:
        recording = describe_file(path)
    except RecordingError as error:
        words = str(error)
    else:
        with RecordingFile(path) as file:
            assert sum(1 for _ in file.messages()) == sum(topic.messages for topic in recording.topics)
        assert recording.problem_reason.code == "recording.killed"
    assert not words or "trial.mcap" in words


def test_changed_byte_in_a_chunk_is_an_error_and_the_rest_is_readable(tmp_path):
    path = write_recording(tmp_path / "trial.mcap", video=False)
    block = layout_of(path).blocks[3]
    data = bytearray(path.read_bytes())
    data[block.offset + block.length // 2] ^= 0xFF
    path.write_bytes(data)
    with RecordingFile(path) as file:
        with pytest.raises(RecordingError, match="damaged near byte"):
            list(file.messages())
        after = list(file.messages([JOINTS], start_ns=block.end_ns + 1))
        assert seconds(after)[-1] == 3.99


def test_summary_of_a_closed_file_equals_a_scan_of_its_records(tmp_path):
    chunked, plain = (
        describe_file(write_recording(tmp_path / f"{name}.mcap", chunked=name == "chunked"))
        for name in ("chunked", "plain")
    )
    assert list(chunked.topics) == list(plain.topics)
    assert (chunked.start, chunked.duration) == (plain.start, plain.duration)
    assert (chunked.problem, plain.problem, plain.attachments) == ("", "", ["mesh/base"])


def test_names_never_lead_outside_the_folder(tmp_path):
    folder = tmp_path / "recordings"
    (folder / "arm").mkdir(parents=True)
    outside = write_recording(tmp_path / "outside.mcap", seconds=0.1)
    (folder / "arm" / "link.mcap").symlink_to(outside)
    inside = write_recording(folder / "arm" / "inside.mcap", seconds=0.1)
    assert find_file(folder, "inside.mcap") == inside
    for name in ("../outside.mcap", str(outside), "arm/inside.mcap", "link.mcap", "*.mcap", "", "inside.txt"):
        with pytest.raises(RecordingError, match="no recording"):
            find_file(folder, name)


def write_bomb(path, claimed_bytes, packed):
    """Write a file of one chunk with a false declared size."""
    chunk = Chunk(
        compression="zstd",
        data=packed,
        message_start_time=1,
        message_end_time=1,
        uncompressed_crc=0,
        uncompressed_size=claimed_bytes,
    )
    contents = records.Contents()
    contents.schemas[1] = Schema(id=1, data=b"", encoding="", name="text")
    contents.channels[1] = Channel(id=1, topic="words", message_encoding="", schema_id=1, metadata={})
    contents.note_message(1, 1)
    start, data = records.start(), records.record_bytes(chunk)
    contents.chunks.append(
        ChunkIndex(
            chunk_length=len(data),
            chunk_start_offset=len(start),
            compression="zstd",
            compressed_size=len(packed),
            message_end_time=1,
            message_index_length=0,
            message_index_offsets={1: 0},
            message_start_time=1,
            uncompressed_size=claimed_bytes,
        )
    )
    path.write_bytes(start + data + contents.end(len(start) + len(data)))


@pytest.mark.parametrize("claimed_bytes", [1 << 20, 32 << 20])
def test_chunk_with_a_false_size_is_refused_and_takes_no_memory(tmp_path, claimed_bytes):
    path = tmp_path / "bomb.mcap"
    packed = zstandard.ZstdCompressor().compress(bytes(32 << 20))
    write_bomb(path, claimed_bytes, packed)
    assert path.stat().st_size < 10_000
    tracemalloc.start()
    try:
        with RecordingFile(path) as file, pytest.raises(RecordingError, match="damaged near byte"):
            list(file.messages())
        assert tracemalloc.get_traced_memory()[1] < claimed_bytes + (8 << 20)
    finally:
        tracemalloc.stop()


def test_impossible_lengths_are_refused_with_a_sentence(tmp_path):
    path = write_recording(tmp_path / "trial.mcap", video=False)
    offset = layout_of(path).blocks[3].offset
    data = path.read_bytes()
    for length in (1 << 40, (1 << 64) - 1):
        at = data.index(struct.pack("<Q", offset), data.rindex(b"robomesh/site/arm/joints"))
        path.write_bytes(data[: at + 8] + struct.pack("<Q", length) + data[at + 16 :])
        with pytest.raises(RecordingError, match="the limit is"):
            RecordingFile(path)


def test_growing_file_is_scanned_once_and_a_replaced_file_again(tmp_path, monkeypatch):
    whole = write_recording(tmp_path / "whole.mcap", chunked=False).read_bytes()
    path = tmp_path / "grows.mcap"
    path.write_bytes(whole[: len(whole) // 2 + 7])
    half = layout_of(path)
    read = []
    scan_appended = layout._Scan.scan_appended

    def record_scan(scan, stream):
        read.append(scan.offset)
        scan_appended(scan, stream)

    monkeypatch.setattr(layout._Scan, "scan_appended", record_scan)
    end = len(whole) * 3 // 4
    path.write_bytes(whole[:end])
    grown = layout_of(path)
    assert read[0] > len(whole) // 3
    assert sum(grown.counts.values()) > sum(half.counts.values())
    again = tmp_path / "again.mcap"
    again.write_bytes(whole[:end])
    assert layout_of(again) == grown
    assert read[1] == len(records.MAGIC)
    other = write_recording(tmp_path / "other.mcap", chunked=False, video=False).read_bytes()
    path.write_bytes(other[: len(other) * 3 // 4])
    assert "robomesh/site/arm/video/front" not in {each.topic for each in layout_of(path).channels.values()}
