"""Values of a robot from its flight recorder and its recordings, compared with those that `mcap` reads."""

import math

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from mcap.reader import make_reader

from robomesh.recordings.errors import RecordingError
from robomesh.schemas import robomesh_pb2 as schema
from services.recorder.reading.answers import Answers
from tests.recordings import START_NS, Written, joints

S_NS = 1_000_000_000
WAIST = "joints/waist/position"


def write(path, start_s, end_s, *, hz=100, spike_at=None, robot="arm"):
    path.parent.mkdir(parents=True, exist_ok=True)
    with Written(path, robot=robot) as file:
        for i in range(round(start_s * hz), round(end_s * hz)):
            at_s = i / hz
            position = 50.0 if i == spike_at else math.sin(at_s / 7)
            file.put("joints", joints(waist=position, lift=at_s), at_s)
            if i % 5 == 0:
                state = schema.KinematicState()
                state.own_clearance.distance = at_s
                file.put("kinematics", state, at_s)
    return path


@pytest.fixture
def folder(tmp_path):
    flight = tmp_path / ".flight" / "arm"
    write(flight / "2026-01-01T00-00-00.000000Z.mcap", 100, 130)
    write(flight / "2026-01-01T00-00-30.000000Z.mcap", 130, 160, spike_at=14321)
    write(tmp_path / "arm" / "same.mcap", 120, 150, spike_at=14321)  # in the flight recorder too
    write(tmp_path / "arm" / "before.mcap", 40, 60)
    write(tmp_path / "other" / "other.mcap", 90, 100, robot="other")
    return tmp_path


def ask(folder, *names, start_s, end_s, points=100, robot="arm", answers=None):
    request = schema.SeriesRequest(robot=robot, values=names, points=points)
    request.start.FromNanoseconds(START_NS + round(start_s * S_NS))
    request.end.FromNanoseconds(START_NS + round(end_s * S_NS))
    return (answers or Answers(folder)).series(request)


def samples(folder):
    """Return time since the start [s] and position of all states, read by `mcap`."""
    found = {}
    for path in folder.rglob("*.mcap"):
        with path.open("rb") as stream:
            for _, _, message in make_reader(stream).iter_messages(topics=["robomesh/site/arm/joints"]):
                (waist,) = (j for j in JointStates.FromString(message.data).joints if j.name == "waist")
                found[message.publish_time - START_NS] = waist.position
    return sorted(found.items())


@pytest.mark.slow
def test_each_interval_has_the_lowest_and_highest_value_of_all_files(folder):
    answer = ask(folder, WAIST, "kinematics/own_clearance", start_s=0, end_s=200)
    waist, own = answer.series
    read = samples(folder)
    assert (waist.unit, own.unit) == ("rad", "m")
    assert max(waist.highest) == 50.0
    assert min(waist.lowest) == min(value for _, value in read)
    for at_s, low, high in zip(waist.times_s, waist.lowest, waist.highest, strict=True):
        # A closed file is read into intervals of 0.05 s, so a state on a border may be in the next interval.
        near = [v for t, v in read if abs(t / S_NS - at_s) <= 1.05]
        sure = [v for t, v in read if abs(t / S_NS - at_s) <= 0.95]
        assert min(near) <= low <= min(sure, default=low)
        assert max(sure, default=high) <= high <= max(near)
    spans = [(span.start_s, span.end_s) for span in answer.recorded]
    assert spans == [pytest.approx((40, 60), abs=0.1), pytest.approx((100, 160), abs=0.1)]
    times = list(waist.times_s)
    assert not [at for at in times if 62 < at < 98]  # what was not recorded has no data
    assert times == sorted(set(times))


@pytest.mark.slow
def test_a_closer_view_of_a_long_recording_has_all_its_points(tmp_path):
    write(tmp_path / "arm" / "long.mcap", 0, 1500, hz=20)
    (waist,) = ask(tmp_path, WAIST, start_s=1000, end_s=1010, points=200).series
    # One state each; a state on a border may be in the next interval.
    assert len(waist.times_s) >= 198


def test_a_second_request_reads_only_files_that_have_changed(folder, monkeypatch):
    answers = Answers(folder)
    first = ask(folder, WAIST, start_s=0, end_s=200, answers=answers)
    monkeypatch.setattr("services.recorder.reading.robot_series.cut", lambda *_: pytest.fail("read again"))
    assert ask(folder, WAIST, start_s=0, end_s=200, answers=answers) == first


def test_a_file_that_is_still_written_is_read_to_its_end(folder):
    live = folder / ".flight" / "arm" / "2026-01-01T00-01-00.000000Z.mcap"
    with Written(live, chunked=False) as file:
        for i in range(16000, 16500):
            file.put("joints", joints(waist=float(i)), i / 100)
        file._stream.flush()
        (waist,) = ask(folder, WAIST, start_s=155, end_s=175, points=1000).series
        assert waist.highest[-1] >= 16400


def test_values_of_another_robot_or_of_no_recording_are_absent(folder):
    answer = ask(folder, WAIST, "joints/gone/position", "nothing", start_s=88, end_s=100, robot="other")
    assert [(each.name, bool(each.times_s)) for each in answer.series] == [
        (WAIST, True),
        ("joints/gone/position", False),
        ("nothing", False),
    ]
    assert not ask(folder, WAIST, start_s=0, end_s=10, robot="none").recorded


@pytest.mark.parametrize(
    ("robot", "start_s", "end_s", "code"),
    [
        ("../arm", 0, 1, "key.name"),
        ("arm", 1, 0, "recording.times"),
        ("arm", 0, 0, "recording.times"),
        ("arm", 0, 86_401, "recording.too_long"),
    ],
)
def test_an_invalid_request_is_refused(folder, robot, start_s, end_s, code):
    with pytest.raises(RecordingError) as refused:
        ask(folder, WAIST, start_s=start_s, end_s=end_s, robot=robot)
    assert refused.value.reason.code == code
