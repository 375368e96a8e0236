"""Recordings as NumPy arrays: a file of this machine, beside the mcap package's reader and the CSV table."""

import csv
import logging
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates as JointStatesMessage
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from mcap.reader import make_reader
from mcap.records import Metadata
from mcap.writer import CompressionType, Writer
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.schema import register_schema

import robomesh
from robomesh import reason_codes as codes
from robomesh.contract.header import Header
from robomesh.contract.topics import topic
from robomesh.recordings.errors import CaptureError
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.recovery.recover import recover
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.record.export.tables import write_table
from services.export.span import Span
from tests.recordings import START_NS, Written, joints, write_recording

_Joint = schema.Description.Joint
DESCRIPTION = schema.Description(
    joints=[_Joint(name="waist", type=_Joint.ROTARY), _Joint(name="lift", type=_Joint.PRISMATIC)]
)


@pytest.fixture
def path(tmp_path):
    """A file with a rotary and a prismatic joint, 3 s at 100 Hz."""
    with Written(tmp_path / "trial.mcap") as file:
        file.put("description", DESCRIPTION, 0.0)
        for number in range(300):
            state = joints(waist=number / 100, lift=-number / 50)
            state.joints[0].velocity = 1.0
            file.put("joints", state, number / 100)
            tool = schema.KinematicState(tool_to_base=[1, 0, 0, number, *[0.0] * 12])
            if number % 5 == 0:
                if number == 100:
                    tool.clearance.distance = 0.25
                file.put("kinematics", tool, number / 100)
    return tmp_path / "trial.mcap"


def test_joints_are_what_the_mcap_packages_reader_reads(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        read = [each[2:] for each in reader.iter_decoded_messages(["robomesh/site/arm/joints"])]
    states = robomesh.open_recording(path).joints()
    assert states.names == ("waist", "lift")
    assert states.units == ("rad", "m")
    assert states.time_ns.tolist() == [message.publish_time for message, _ in read]
    assert states.received_ns.tolist() == [message.log_time for message, _ in read]
    assert states.sequence.tolist() == [message.sequence for message, _ in read]
    assert states.positions.tolist() == [[j.position for j in state.joints] for _, state in read]
    assert states.velocities[:, 0].tolist() == [1.0] * 300
    assert np.isnan(states.velocities[:, 1]).all()
    assert states.positions_deg[100].tolist() == pytest.approx([np.degrees(1.0), -2000.0])
    assert states.time[0] == np.datetime64(int(states.time_ns[0]), "ns")
    assert len(states) == 300


def test_joints_have_the_rows_and_times_of_the_csv_table(path, tmp_path):
    with RecordingFile(path) as file:
        write_table(file, Span(file.layout.start_ns, file.layout.end_ns), tmp_path / "joints.csv")
    header, *rows = csv.reader((tmp_path / "joints.csv").read_text(encoding="utf-8").splitlines())
    states = robomesh.open_recording(path).joints()
    column = {name: [row[header.index(name)] for row in rows] for name in header}
    assert [f"{each:.9f}" for each in states.time_s] == column["t [s]"]
    assert [repr(each) for each in states.positions[:, 0].tolist()] == column["waist [rad]"]
    assert [repr(each) for each in states.positions[:, 1].tolist()] == column["lift [m]"]


def test_units_are_read_again_after_a_read_of_the_description_that_failed(path, monkeypatch):
    recording = robomesh.open_recording(path)
    with monkeypatch.context() as broken:
        broken.setattr("robomesh.client.recordings.recording._MOST_BYTES", -1)
        broken.setattr("robomesh.client.recordings.recording._MOST_TIMES_THE_FILE", 0)
        with pytest.raises(robomesh.RecordingError, match="one after the other"):
            recording.joints()
    assert recording.joints().units == ("rad", "m")


def test_a_range_counts_from_the_recordings_start_and_includes_both_ends(path):
    recording = robomesh.open_recording(path)
    states = recording.joints(start_s=1.0, end_s=1.5)
    assert (states.received_ns[[0, -1]] - START_NS).tolist() == [1_000_000_000, 1_500_000_000]
    assert states.time_s[0] == pytest.approx(1.0, abs=1e-5)
    for start_s in (1000.0, float("nan"), 1e300):
        with pytest.raises(robomesh.RecordingError):
            recording.joints(start_s=start_s)
    with pytest.raises(robomesh.RecordingError) as outside:
        recording.joints(start_s=2.0, end_s=1.0)
    assert outside.value.code == codes.RECORDING_TIMES.name


def test_values_have_the_full_rate_of_their_topics_and_a_unit(path):
    recording = robomesh.open_recording(path)
    values = recording.values("kinematics/tool/x", "joints/lift/position", "kinematics/clearance")
    assert {name: (each.unit, len(each)) for name, each in values.items()} == {
        "kinematics/tool/x": ("m", 60),
        "joints/lift/position": ("m", 300),
        "kinematics/clearance": ("m", 1),
    }
    assert values["kinematics/tool/x"].values.tolist() == list(range(0, 300, 5))
    assert values["kinematics/clearance"].time_s.tolist() == pytest.approx([1.0], abs=1e-5)
    assert len(recording.values("kinematics/clearance", end_s=0.5)["kinematics/clearance"]) == 0
    assert "kinematics/tool/x" in recording.value_names()


@pytest.mark.parametrize("name", ["kinematics/tool/q", "power/x", "joints"])
def test_an_unknown_value_is_refused_with_the_names_there_are(path, name):
    with pytest.raises(robomesh.RecordingError) as refused:
        robomesh.open_recording(path).values(name)
    assert refused.value.code == codes.RECORDING_NO_VALUE.name
    there = refused.value.reason.values["topics"]
    assert there.startswith("kinematics/tool/x" if name == "kinematics/tool/q" else "description/..., joints")


def test_messages_and_events_are_decoded(tmp_path):
    path = write_recording(tmp_path / "trial.mcap")
    recording = robomesh.open_recording(path)
    assert recording.topic_names == ("controller", "description", "events", "frames", "joints", "video/front")
    assert [event.code for event in recording.events(start_s=1.0)] == ["second.1", "second.2", "second.3"]
    first, *others = recording.messages("controller")
    assert (first.site, first.robot, first.topic) == ("site", "arm", "controller")
    assert (first.message.rate_hz, first.received_ns) == (100.0, START_NS)
    assert first.time.microsecond == 999_999
    assert len(others) == 3
    assert next(iter(recording.messages("robomesh/site/arm/joints"))).message.joints[1].name == "elbow"
    with pytest.raises(robomesh.RecordingError) as missing:
        list(recording.messages("lease"))
    assert missing.value.code == codes.RECORDING_NO_TOPIC.name


def test_another_programs_file_with_two_robots_and_json_is_read_as_far_as_it_can_be(tmp_path, caplog):
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        states = register_schema(writer, JointStatesMessage)
        for robot in ("a", "b"):
            channel = writer.register_channel(f"/{robot}/joints", "protobuf", states)
            for number in range(3):
                data = joints(one=number).SerializeToString()
                writer.add_message(channel, START_NS + number, data, START_NS + number)
        json = writer.register_schema("foxglove.JointStates", "jsonschema", b"{}")
        channel = writer.register_channel("joints", "json", json)
        writer.add_message(channel, START_NS, b'{"joints":[]}', START_NS)
        writer.finish()
    recording = robomesh.open_recording(path)
    assert [sample.message.joints[0].position for sample in recording.messages("/a/joints")] == [0, 1, 2]
    with caplog.at_level(logging.WARNING):
        assert len(recording.joints()) == 0
    assert "1 messages of joints cannot be read" in caplog.text
    (sample,) = recording.messages("joints")
    assert (sample.message, sample.data) == (None, b'{"joints":[]}')
    assert recording.values("a/joints/one/position")["a/joints/one/position"].values.tolist() == [0, 1, 2]


# In a process of its own: the SDK numbers files and the clients of every server of a process together.
SDK = f"""
import sys
from foxglove import open_mcap
from foxglove.channels import JointStatesChannel
from foxglove.mcap import MCAPCompression, MCAPWriteOptions
from foxglove.messages import JointState, JointStates
compression = getattr(MCAPCompression, sys.argv[2], None)
with open_mcap(sys.argv[1], writer_options=MCAPWriteOptions(compression=compression)):
    channel = JointStatesChannel("/left/joint_states")
    for number in range(500):
        moved = [JointState(name="a", position=number), JointState(name="b", velocity=1.0)]
        channel.log(JointStates(joints=moved), log_time={START_NS} + number * 10_000_000)
    channel.close()
"""


@pytest.mark.slow
@pytest.mark.parametrize("compression", ["Zstd", "Lz4", "none"])
def test_a_file_of_foxgloves_sdk_is_read(tmp_path, compression):
    path = tmp_path / "sdk.mcap"
    subprocess.run([sys.executable, "-c", SDK, path, compression], check=True, timeout=60)
    recording = robomesh.open_recording(path)
    states = recording.joints("left/joint_states")
    assert states.names == ("a", "b")
    assert states.positions[:, 0].tolist() == list(range(500))
    assert np.isnan(states.positions[:, 1]).all()
    assert states.velocities[:, 1].tolist() == [1.0] * 500
    assert states.time_s[-1] == pytest.approx(4.99)
    assert recording.value_names() == ["left/joint_states/a/position", "left/joint_states/b/velocity"]


def test_a_file_that_is_still_being_written_has_what_was_written(tmp_path):
    path = tmp_path / "open.mcap"
    capture = Capture(path, {"site": "site", "robot": "arm", "name": "open"}, start_ns=START_NS)
    try:
        for number in range(2, 5):
            header = Header(source_time_ns=START_NS + number, sequence=number, publisher=1)
            data = joints(waist=number).SerializeToString()
            capture.add(
                "robomesh/site/arm/joints", topic("joints"), header, data, received_ns=START_NS + number
            )
        capture.hand_over()
        capture.write_out()
        assert capture.first_ns == START_NS + 2
        recording = robomesh.open_recording(path)
        assert recording.info.open
        assert recording.joints().sequence.tolist() == [2, 3, 4]
        assert recording.joints().time_s[0] == 0.0
    finally:
        capture.give_up()


def test_a_truncated_file_is_read_up_to_its_end(path, tmp_path):
    cut, data, counts = tmp_path / "cut.mcap", path.read_bytes(), []
    for keep in range(0, len(data), 1777):
        cut.write_bytes(data[:keep])
        try:
            states = robomesh.open_recording(cut).joints()
        except robomesh.RecordingError:
            counts.append(0)
        else:
            counts.append(len(states))
            assert states.positions[:, 0].tolist() == pytest.approx(np.arange(len(states)) / 100)
    assert counts == sorted(counts)
    assert len({count for count in counts if 0 < count < 300}) > 3


def test_what_is_no_recording_is_refused(tmp_path):
    for path, code in (
        (tmp_path / "gone.mcap", "recording.file"),
        (tmp_path, "recording.file"),
        (tmp_path / "a\0b", "recording.file"),
    ):
        with pytest.raises(robomesh.RecordingError) as refused:
            robomesh.open_recording(path)
        assert refused.value.code == code
    (tmp_path / "text.mcap").write_text("words")
    with pytest.raises(robomesh.RecordingError) as refused:
        robomesh.open_recording(str(tmp_path / "text.mcap"))
    assert refused.value.code == "recording.not_mcap"


def _file(path, fill, *, chunk_size=1 << 20):
    """Write a file with one channel of joints, as `fill(writer, channel)` does."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=chunk_size, compression=CompressionType.ZSTD)
        writer.start()
        schema_id = register_schema(writer, JointStatesMessage)
        fill(writer, writer.register_channel("robomesh/site/arm/joints", "protobuf", schema_id))
        writer.finish()
    return path


def _put(writer, channel, messages):
    for number, message in enumerate(messages):
        data = message if isinstance(message, bytes) else message.SerializeToString()
        writer.add_message(channel, START_NS + number, data, START_NS + number)


def _write(path, states, **options):
    return _file(path, lambda writer, channel: _put(writer, channel, states), **options)


@pytest.mark.slow
def test_a_small_file_whose_states_lack_most_joints_does_not_fill_the_memory(tmp_path):
    first = joints(**{f"j{number}": 0.0 for number in range(20_000)})
    path = _write(tmp_path / "wide.mcap", [first, *[joints()] * 50_000], chunk_size=1 << 30)
    tracemalloc.start()
    try:
        with pytest.raises(robomesh.RecordingError, match="too few joints in common"):
            robomesh.open_recording(path).joints()
        assert tracemalloc.get_traced_memory()[1] < 200 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.slow
def test_a_small_file_that_unpacks_to_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("robomesh.client.recordings.recording._MOST_BYTES", 1 << 20)
    monkeypatch.setattr("robomesh.client.recordings.recording._MOST_TIMES_THE_FILE", 0)
    path = _write(tmp_path / "long.mcap", [joints(waist=0.0, elbow=0.0)] * 60_000, chunk_size=1 << 30)
    recording = robomesh.open_recording(path)
    with pytest.raises(robomesh.RecordingError, match="one after the other"):
        recording.joints()
    assert sum(1 for _ in recording.messages("joints")) == 60_000


def test_a_time_out_of_range_is_refused(tmp_path):
    def fill(writer, channel):
        writer.add_message(channel, START_NS, joints(waist=1).SerializeToString(), (1 << 64) - 1)

    with pytest.raises(robomesh.RecordingError, match="a time out of range"):
        robomesh.open_recording(_file(tmp_path / "late.mcap", fill)).joints()


def test_states_may_name_no_joints_further_joints_and_one_name_twice(tmp_path):
    twice = JointStatesMessage()
    for position in (7, 8):
        twice.joints.add(name="waist", position=position)
    states = [JointStatesMessage(), joints(waist=1, lift=2), joints(lift=20, waist=10), joints(tool=3), twice]
    path = _write(tmp_path / "mixed.mcap", states)
    found = robomesh.open_recording(path).joints()
    assert found.names == ("waist", "lift", "tool", "waist")
    nan = float("nan")
    expected = [[nan] * 4, [1, 2, nan, nan], [10, 20, nan, nan], [nan, nan, 3, nan], [7, nan, nan, 8]]
    assert np.array_equal(found.positions, expected, equal_nan=True)


def test_a_topic_with_two_schemas_has_no_wrong_values(tmp_path, caplog):
    def fill(writer, channel):
        _put(writer, channel, [joints(waist=1)])
        other = register_schema(writer, schema.ControllerState)
        other = writer.register_channel("robomesh/site/arm/joints", "protobuf", other)
        _put(writer, other, [schema.ControllerState(rate_hz=5)])

    recording = robomesh.open_recording(_file(tmp_path / "two.mcap", fill))
    assert [sample.message for sample in recording.messages("joints")] == [None, None]
    assert len(recording.joints()) == 0
    assert "2 messages of robomesh/site/arm/joints cannot be read" in caplog.text


@pytest.mark.parametrize("name", ["foxglove.JointStates", "robomesh.KinematicState", "robomesh.Event"])
def test_a_schema_with_the_name_of_ours_and_other_fields_has_no_values(tmp_path, name):
    package, _, own = name.rpartition(".")
    file = FileDescriptorProto(name="other.proto", package=package, syntax="proto3")
    file.message_type.add(name=own)

    def fill(writer, channel):
        other = writer.register_schema(name, "protobuf", FileDescriptorSet(file=[file]).SerializeToString())
        _put(writer, writer.register_channel("robomesh/site/arm/raw", "protobuf", other), [b""])

    recording = robomesh.open_recording(_file(tmp_path / "other.mcap", fill))
    assert recording.value_names() == (["raw/severity"] if own == "Event" else [])


def test_false_statistics_make_no_result_shorter(tmp_path, caplog):
    def fill(writer, channel):
        _put(writer, channel, [joints(waist=number) for number in range(10)])
        statistics = writer._Writer__statistics
        statistics.message_start_time, statistics.message_end_time = 0, START_NS + 2
        statistics.channel_message_counts[channel] = 12

    recording = robomesh.open_recording(_file(tmp_path / "false.mcap", fill))
    assert recording.info.start_ns == START_NS
    assert len(recording.joints()) == len(recording.joints(end_s=1.0)) == 10
    assert "2 of 12 messages of robomesh/site/arm/joints are missing" in caplog.text


def test_what_a_summary_lists_many_times_is_read_once(tmp_path, monkeypatch):
    reads = []
    read = Metadata.read
    monkeypatch.setattr(Metadata, "read", lambda stream: reads.append(1) or read(stream))

    def fill(writer, channel):
        writer.add_metadata("robomesh", {"name": "many"})
        writer._Writer__metadata_indexes *= 1000
        _put(writer, channel, [joints(waist=1)])
        writer._Writer__finalize_chunk()
        writer._Writer__chunk_indices *= 1000

    recording = robomesh.open_recording(_file(tmp_path / "many.mcap", fill))
    assert recording.info.name == "many"
    assert len(recording.joints()) == 1
    assert len(reads) < 10


def test_a_small_file_whose_chunks_unpack_to_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("robomesh.recordings.records._MOST_UNPACKED_BYTES", 1 << 20)
    monkeypatch.setattr("robomesh.recordings.records._MOST_TIMES_THE_FILE", 0)
    path = _write(tmp_path / "bomb.mcap", [bytes(1 << 20)] * 2)
    for keep in (None, -100):  # with and without a summary
        (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:keep])
        with pytest.raises(robomesh.RecordingError, match="unpack to"):
            robomesh.open_recording(tmp_path / "cut.mcap")
        with pytest.raises(CaptureError, match="unpack to"):
            recover(tmp_path / "cut.mcap")


@pytest.mark.slow
def test_many_messages_of_a_small_chunk_do_not_wait_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("robomesh.recordings.reading._MOST_WAITING_BYTES", 1 << 20)
    path = _write(tmp_path / "many.mcap", [b""] * 30_000)
    with path.open("rb") as stream:  # by the format's own reader it is valid
        assert make_reader(stream).get_summary().statistics.message_count == 30_000
    with RecordingFile(path) as file:
        tracemalloc.start()
        try:
            times = [message.received_ns for message in file.messages()]
            assert tracemalloc.get_traced_memory()[1] < 5 << 20  # 8 MiB if all wait
        finally:
            tracemalloc.stop()
    assert times == sorted(times)
    assert len(times) == 30_000


def test_long_metadata_of_another_program_is_not_kept(tmp_path):
    def fill(writer, channel):
        writer.add_metadata("other", {"text": "x" * (2 << 20)})
        writer.add_metadata("robomesh", {"name": "ours"})
        _put(writer, channel, [joints(waist=1)])

    path = _file(tmp_path / "long.mcap", fill)
    for keep in (None, -100):  # with and without a summary
        (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:keep])
        with RecordingFile(tmp_path / "cut.mcap") as file:
            assert [each.name for each in file.layout.metadata] == ["robomesh"]


def test_messages_without_bytes_count_too(tmp_path, monkeypatch):
    monkeypatch.setattr("robomesh.client.recordings.recording._MOST_BYTES", 10_000)
    monkeypatch.setattr("robomesh.client.recordings.recording._MOST_TIMES_THE_FILE", 0)
    path = _write(tmp_path / "empty.mcap", [b""] * 1000)
    with pytest.raises(robomesh.RecordingError, match="one after the other"):
        robomesh.open_recording(path).joints()


@pytest.mark.slow
def test_long_messages_are_not_all_in_memory(tmp_path):
    state = joints(**{"n" * (1 << 20): 1.0})
    path = _write(tmp_path / "long.mcap", [state] * 200)
    recording = robomesh.open_recording(path)
    tracemalloc.start()
    try:
        assert sum(1 for _ in recording.messages("joints")) == 200
        assert tracemalloc.get_traced_memory()[1] < 100 << 20
    finally:
        tracemalloc.stop()


def test_a_file_that_another_recording_replaced_is_refused(path, tmp_path):
    recording = robomesh.open_recording(path)
    write_recording(tmp_path / "other.mcap").replace(path)
    with Written(tmp_path / "other.mcap") as file:
        file.put("joints", joints(waist=1), 100.0)
    (tmp_path / "other.mcap").replace(path)
    with pytest.raises(robomesh.RecordingError, match="it was replaced"):
        recording.joints()


def test_invalid_events_of_a_recording_are_left_out_with_a_warning(tmp_path, caplog):
    odd, newer = schema.Event(code="odd"), schema.Event(code="newer", severity=99)
    odd.timestamp.seconds = 1 << 62
    with Written(tmp_path / "events.mcap") as file:
        for number in range(50):
            file.put(f"events/s{number}", newer, 0.01 * number)
        file.put("events/s0", odd, 1.0)
    events = robomesh.open_recording(tmp_path / "events.mcap").events()
    assert [(event.code, event.severity) for event in events] == [("newer", "99")] * 50
    assert "1 events have a time out of range" in caplog.text
