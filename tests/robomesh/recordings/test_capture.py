"""Writing, truncating, recovering and rewriting recordings."""

import os
import struct

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory

from robomesh.contract.header import Header
from robomesh.contract.topics import TOPICS, topic
from robomesh.recordings.errors import CaptureError
from robomesh.recordings.files import describe_file
from robomesh.recordings.layout import layout_of
from robomesh.recordings.names import ROBOT_DESCRIPTION
from robomesh.recordings.recovery.recover import State, close_in_place, is_ours, recover, state_of
from robomesh.recordings.recovery.rewrite import rewrite
from robomesh.recordings.writing import indexed_writer
from robomesh.recordings.writing.capture import Capture
from tests.recordings import write_recording

ABOUT = {"site": "site", "robot": "arm", "name": "trial", "started_by": "request"}
JOINTS, EVENTS = "robomesh/site/arm/joints", "robomesh/site/arm/events"
SECOND = 1_000_000_000


def test_the_usual_decoders_read_every_recorded_topic(tmp_path):
    """One channel is not protobuf: viewers' URDF layers take only ROS 2's std_msgs/String."""
    path, header = tmp_path / "trial.mcap", Header(7, 1, SECOND)
    capture = Capture(path, ABOUT, start_ns=SECOND)
    rows = {f"robomesh/site/arm/{row.name}".replace("*", "x"): row for row in TOPICS.values() if row.recorded}
    for key, row in rows.items():
        capture.add(key, row, header, row.schema().SerializeToString(), received_ns=SECOND)
    capture.add_text(ROBOT_DESCRIPTION, "<robot name='臂'/>", header, received_ns=SECOND)
    capture.finish({})
    rewrite([path], path)

    def read(*factories, topics=None):
        with path.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=factories)
            return {channel.topic: found for _, channel, _, found in reader.iter_decoded_messages(topics)}

    assert read(DecoderFactory(), topics=[*rows]).keys() == rows.keys()
    ros2 = pytest.importorskip("mcap_ros2.decoder", reason="the rest needs the package mcap-ros2-support")
    found = read(DecoderFactory(), ros2.DecoderFactory())
    assert found.keys() == {*rows, ROBOT_DESCRIPTION}
    assert found[ROBOT_DESCRIPTION].data == "<robot name='臂'/>"


def payload(number):
    return struct.pack("<I", number) * 50


def write(path, numbers, *, missed=None, end=True, about=ABOUT):
    """Write a file with these numbers, 0.01 s apart; `end`: close it."""
    capture = Capture(path, about, start_ns=SECOND)
    capture.attach("robot.toml", "application/toml", b'name = "arm"', time_ns=SECOND)
    for number in numbers:
        header = Header(7, number, SECOND + number)
        capture.add(
            JOINTS, topic("joints"), header, payload(number), received_ns=SECOND + number * 10_000_000
        )
    capture.hand_over()
    if end:
        capture.finish(missed or {})
    else:
        capture.write_out()
        capture.give_up()


def numbers_in(path):
    with path.open("rb") as stream:
        messages = make_reader(stream).iter_messages(topics=[JOINTS])
        return [struct.unpack_from("<I", message.data)[0] for _, _, message in messages]


def attached_to(path):
    with path.open("rb") as stream:
        return {each.name: each.data for each in make_reader(stream).iter_attachments()}


@pytest.mark.slow
def test_closed_file_is_complete_and_an_indexed_one_has_the_same_contents(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, range(20_000), missed={JOINTS: 3, EVENTS: 0})
    assert state_of(path) is State.CLOSED
    progress = []
    closed = (numbers_in(path), attached_to(path))
    rewrite([path], path, progress=progress.append)
    assert state_of(path) is State.INDEXED
    assert (numbers_in(path), attached_to(path)) == closed
    assert closed == (list(range(20_000)), {"robot.toml": b'name = "arm"'})
    (joints,) = describe_file(path).topics
    assert (joints.topic, joints.messages, joints.lost) == (JOINTS, 20_000, 3)
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary.statistics.chunk_count == 5
    assert all(chunk.compression == "zstd" for chunk in summary.chunk_indexes)
    assert all(chunk.uncompressed_size < 1.01 * (1 << 20) for chunk in summary.chunk_indexes)


def test_file_cut_at_any_byte_is_recovered_to_its_last_complete_message(tmp_path):
    whole, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    write(whole, range(6), end=False)
    data = whole.read_bytes()
    ends = [data.index(payload(number)) + 200 for number in range(6)]
    for length in range(len(data) - 700, len(data), 23):
        cut.write_bytes(data[:length])
        assert state_of(cut) is State.UNFINISHED
        recover(cut)
        assert numbers_in(cut) == list(range(sum(end <= length for end in ends)))
        assert describe_file(cut).recovered
        assert describe_file(cut).problem == ""


def test_recovered_file_lists_the_messages_missing_by_their_numbers(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, [0, 1, 5, 6, 9], end=False)
    recover(path)
    (joints,) = describe_file(path).topics
    assert (joints.messages, joints.lost) == (5, 5)


def test_original_is_kept_if_the_new_file_differs(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    write(path, range(100))
    before = path.read_bytes()
    compressor = indexed_writer.zstandard.ZstdCompressor

    class Forgetful:
        def __init__(self, **settings):
            self._right = compressor(**settings)

        def compress(self, data):
            return self._right.compress(data[:-1] + b"!")

    monkeypatch.setattr(indexed_writer.zstandard, "ZstdCompressor", Forgetful)
    with pytest.raises(CaptureError, match=r"cannot be read|not the same"):
        rewrite([path], path)
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == ["a.mcap"]


def test_several_files_become_one_without_repeated_first_messages(tmp_path):
    first, second, target = tmp_path / "1.mcap", tmp_path / "2.mcap", tmp_path / "saved.mcap"
    write(first, range(10), missed={JOINTS: 2})
    write(second, [9, *range(10, 20)], end=False)  # each repeats the robot's description
    rewrite([first, second], target, about={"name": "saved", "cause": "link lost"})
    assert numbers_in(target) == list(range(20))
    recording = describe_file(target)
    assert (recording.name, recording.cause, recording.robot) == ("saved", "link lost", "arm")
    assert recording.topics[0].lost == 2
    assert first.exists()


def test_file_on_a_full_disk_is_closed_in_place(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, range(10), end=False)
    os.truncate(path, path.stat().st_size - 3)
    close_in_place(path, {JOINTS: 4, EVENTS: 0})
    assert state_of(path) is State.CLOSED
    assert [each.lost for each in describe_file(path).topics] == [4]
    assert numbers_in(path) == list(range(9))


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n"[:5], b"no recording at all", bytes(100)])
def test_other_file_is_refused_with_a_sentence_and_unchanged(tmp_path, content):
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(CaptureError, match=r"a\.mcap: no"):
        recover(path)
    assert path.read_bytes() == content


def test_file_that_cannot_be_created_is_refused_with_a_sentence(tmp_path):
    (tmp_path / "folder").write_text("a file")
    with pytest.raises(CaptureError, match="cannot be written"):
        Capture(tmp_path / "folder" / "a.mcap", ABOUT, start_ns=0)


def test_damaged_chunk_of_a_cut_file_is_omitted_and_counted(tmp_path):
    whole = write_recording(tmp_path / "whole.mcap", video=False)
    blocks, messages = layout_of(whole).blocks, sum(topic.messages for topic in describe_file(whole).topics)
    data = bytearray(whole.read_bytes()[: max(block.offset + block.length for block in blocks) + 5])
    data[blocks[9].offset + blocks[9].length // 2] ^= 0xFF
    path = tmp_path / "a.mcap"
    path.write_bytes(data)
    recovered = recover(path)
    assert (recovered.damaged, recovered.cut) == (1, True)
    assert messages - 150 < recovered.messages < messages
    assert sum(topic.messages for topic in describe_file(path).topics) == recovered.messages


def test_closed_file_with_unreadable_messages_is_not_rewritten(tmp_path):
    whole = write_recording(tmp_path / "whole.mcap", chunked=False)
    data = bytearray(whole.read_bytes())
    begin = layout_of(whole).blocks[0].offset
    data[begin + 8] = 0xFF  # a length that no record has
    path = tmp_path / "a.mcap"
    path.write_bytes(data)
    with pytest.raises(CaptureError, match=r"a\.mcap: only \d+ of \d+ messages can be read"):
        recover(path)
    assert path.read_bytes() == data


def test_damage_far_before_the_end_is_refused_but_trailing_zeros_are_cut(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, range(30_000), end=False)
    assert path.stat().st_size > 6 << 20
    data = bytearray(path.read_bytes())
    at = data.index(payload(100)) - 31  # its opcode
    path.write_bytes(data[:at] + bytes(6 << 20))
    assert recover(path).messages == 100
    data[at] = 0
    path.write_bytes(data)
    with pytest.raises(CaptureError, match="damaged near byte"):
        recover(path)
    assert path.read_bytes() == data


def test_metadata_of_another_program_truncates_nothing(tmp_path):
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start()
        channel = writer.register_channel(JOINTS, "", writer.register_schema("text", "", b""))
        for number in range(100):
            writer.add_message(channel, number + 1, payload(number), number + 1, number)
            if number == 9:
                writer.add_metadata("robomesh.lost", {JOINTS: "none"})
        writer.finish()
    assert state_of(path) is State.CLOSED
    assert not is_ours(path)
    assert recover(path).messages == 100
    own = tmp_path / "own.mcap"
    write(own, range(3), end=False)
    assert is_ours(own)


def test_file_that_is_being_written_is_not_recovered(tmp_path):
    path = tmp_path / "a.mcap"
    capture = Capture(path, ABOUT, start_ns=SECOND)
    capture.write_out()
    try:
        assert state_of(path) is State.OPEN
        inode = path.stat().st_ino
        with pytest.raises(CaptureError, match=r"a\.mcap is being recorded"):
            recover(path)
        assert path.stat().st_ino == inode
    finally:
        capture.finish({})
    assert state_of(path) is not State.OPEN
