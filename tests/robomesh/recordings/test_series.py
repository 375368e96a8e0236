"""Values over time: their names, and downsampling without losing peaks."""

import math

import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto

from robomesh.recordings.errors import RecordingError
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.series.downsampling import SeriesReader, known_values
from robomesh.recordings.series.values import unit_of, values_of
from robomesh.schemas import robomesh_pb2 as schema
from tests.recordings import START_NS, Written, joints, write_recording


def series_of(path, *names, start_s=0.0, end_s=None, points=1000):
    with RecordingFile(path) as file:
        end_ns = file.layout.end_ns if end_s is None else START_NS + round(end_s * 1e9)
        start_ns = START_NS + round(start_s * 1e9)
        return SeriesReader().read(file, names, start_ns=start_ns, end_ns=end_ns, points=points)


def test_values_of_a_recording_have_names(tmp_path):
    with RecordingFile(write_recording(tmp_path / "trial.mcap")) as file:
        known = known_values(file)
    assert {"joints/waist/position", "joints/elbow/position", "controller/rate_hz"} <= set(known)
    assert not any(name.startswith(("video", "frames", "description")) for name in known)


def test_peak_of_one_message_among_many_is_never_lost(tmp_path):
    path = tmp_path / "peak.mcap"
    with Written(path) as file:
        for number in range(5000):
            file.put("joints", joints(waist=7.0 if number == 3210 else math.sin(number / 500)), number / 100)
    for points in (10, 333, 10_000):
        (waist,) = series_of(path, "joints/waist/position", points=points)
        assert len(waist.times_s) <= points
        assert max(waist.highest) == 7.0
        peak = waist.times_s[list(waist.highest).index(7.0)]
        assert peak == pytest.approx(32.1, abs=50 / points + 0.01)
    assert waist.unit == "rad"
    assert all(waist.lowest <= waist.highest)


def test_short_time_span_has_each_message(tmp_path):
    path = write_recording(tmp_path / "trial.mcap")
    (elbow, waist) = series_of(
        path, "joints/elbow/position", "joints/waist/position", start_s=1.0, end_s=1.1, points=1000
    )
    assert list(waist.lowest) == list(waist.highest) == [number / 100 for number in range(100, 111)]
    assert list(elbow.highest) == [-value for value in waist.highest]
    assert waist.times_s == pytest.approx(waist.highest, abs=0.001)


def test_error_of_an_unknown_value_lists_the_topics(tmp_path):
    path = write_recording(tmp_path / "trial.mcap")
    with pytest.raises(
        RecordingError, match=r"no value 'power/x': there are controller/\.\.\., events/\.\.\., joints/\.\.\."
    ):
        series_of(path, "power/x")
    (nothing,) = series_of(path, "joints/none/position")
    assert len(nothing.times_s) == 0


def test_prismatic_joint_is_in_metres(tmp_path):
    path = tmp_path / "slides.mcap"
    description = schema.Description()
    description.joints.add(name="waist", type=schema.Description.Joint.ROTARY)
    description.joints.add(name="rail", type=schema.Description.Joint.PRISMATIC)
    with Written(path) as file:
        file.put("description", description, 0.0)
        file.put("joints", joints(waist=1.0, rail=2.0), 0.1)
    found = series_of(path, "joints/rail/position", "joints/waist/position")
    assert [series.unit for series in found] == ["m", "rad"]


def test_values_of_kinematics_have_short_names_and_metres():
    state = schema.KinematicState(
        tool_to_base=[0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 1],
        linear_velocity=schema.Vector3(x=3, y=4),
        clearance=schema.Clearance(distance=0.25),
        limit_margins=[schema.LimitMargin(name="waist", lower=2, upper=0.5)],
    )
    values = dict(values_of("robomesh.KinematicState", state))
    assert values == {
        "tool/x": 1,
        "tool/y": 2,
        "tool/z": 3,
        "tool/roll": 0,
        "tool/pitch": 0,
        "tool/yaw": 0,
        "tool/speed": 5,
        "clearance": 0.25,
        "margin/waist": 0.5,
    }
    units = {name: unit_of(f"kinematics/{name}") for name in values}
    assert (units["tool/x"], units["tool/speed"], units["clearance"]) == ("m", "m/s", "m")


def test_numbers_of_any_protobuf_message_have_names_except_maps_and_times():
    message = FileDescriptorProto()
    message.public_dependency.extend([4, 5])
    field = message.message_type.add(name="Thing").field.add(name="size", number=7)
    field.type = FieldDescriptorProto.TYPE_INT32
    values = dict(values_of("any", message))
    assert values["public_dependency/1"] == 5
    assert values["message_type/Thing/field/size/number"] == 7


class Nonsense:
    """A message with invalid bytes."""

    DESCRIPTOR = joints().DESCRIPTOR

    def SerializeToString(self):  # noqa: N802
        return b"\xff"


def test_unreadable_message_is_omitted_alone(tmp_path, caplog):
    path = tmp_path / "trial.mcap"
    with Written(path) as file:
        for number in range(10):
            file.put("joints", joints(waist=number), number)
            file.put("joints", Nonsense(), number + 0.5)
    (waist,) = series_of(path, "joints/waist/position", points=100)
    assert list(waist.lowest) == list(range(10))
    with RecordingFile(path) as file:
        assert known_values(file) == ["joints/waist/position"]
    assert "10 messages of joints cannot be read" in caplog.text


def test_of_a_thousand_values_the_requested_ones_and_few_others_are_cached(tmp_path):
    path = tmp_path / "names.mcap"
    with Written(path) as file:
        for number in range(2):
            file.put("joints", joints(**{f"j{name}": name for name in range(1000)}), number)
    reader = SeriesReader()
    for names in (["joints/j999/position"], ["joints/j5/position", "joints/j998/position"]):
        with RecordingFile(path) as file:
            first, last = file.layout.start_ns, file.layout.end_ns
            found = reader.read(file, names, start_ns=first, end_ns=last, points=100)
        assert [list(each.highest) for each in found] == [[float(name[8:-9])] * 2 for name in names]
        assert sum(each.bytes for each in reader._kept.values()) < 35 * 20_000 * 16
