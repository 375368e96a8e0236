"""Recordings of messages received in bursts are shown by their source times."""

import csv
import io
from contextlib import nullcontext

import numpy as np
import pytest
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from robomesh.recordings.reading import RecordedMessage, RecordingFile
from robomesh.recordings.series.downsampling import SeriesReader
from robomesh.recordings.series.publisher_time import PublisherTimes
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.record.export.export import ExportOptions
from services.command_line.record.export.export import run as export
from services.player.recording_source import RecordingSource
from tests.recordings import START_NS, joints

JOINTS, KINEMATICS = "robomesh/site/arm/joints", "robomesh/site/arm/kinematics"
MS = 1_000_000
STATES, TOGETHER = 200, 8
HOUR_NS = 3600 * 10**9


def bunched(path, *, clock_ahead_ns=0):
    """Write states at 100 Hz of a waist that turns at 1 rad/s, received in bursts of eight."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="test")
        about = {"site": "site", "robot": "arm", "name": path.stem, "started_by": "request"}
        writer.add_metadata("robomesh", about)
        states, tools = joints(waist=0.0), schema.KinematicState(tool_to_base=[1.0] * 16)
        channels = {
            key: writer.register_channel(key, "protobuf", register_schema(writer, type(message)))
            for key, message in ((JOINTS, states), (KINEMATICS, tools))
        }
        for number in range(STATES):
            at_ns = START_NS + number * 10 * MS
            received_ns = START_NS + (number // TOGETHER + 1) * TOGETHER * 10 * MS
            source_ns = at_ns + clock_ahead_ns
            data = joints(waist=number / 100).SerializeToString()
            writer.add_message(channels[JOINTS], received_ns, data, source_ns, number)
            if number % 5 == 0:
                tools.tool_to_base[3] = number / 100
                data = tools.SerializeToString()
                writer.add_message(channels[KINEMATICS], received_ns, data, source_ns, number // 5)
        writer.finish()
    return path


def exported(path, folder):
    out = folder / "out.csv"
    export(nullcontext(path), out, ExportOptions(), as_json=True)
    return out.read_text()


def test_table_has_a_row_for_each_state_with_evenly_spaced_times(tmp_path, capsys):
    header, *rows = csv.reader(io.StringIO(exported(bunched(tmp_path / "a.mcap"), tmp_path)))
    capsys.readouterr()
    assert header[:3] == ["time", "received", "sequence"]
    assert len(rows) == STATES
    times = np.array([row[0].rstrip("Z") for row in rows], dtype="datetime64[ns]").astype(np.int64)
    assert np.diff(times).tolist() == [10 * MS] * (STATES - 1)
    assert len({row[1] for row in rows}) == STATES // TOGETHER, "received together"
    assert [int(row[2]) for row in rows] == list(range(STATES))
    waist, tool_x = header.index("waist [rad]"), header.index("tool x [m]")
    speed = np.diff([float(row[waist]) for row in rows]) / (np.diff(times) * 1e-9)
    assert speed == pytest.approx(np.ones(STATES - 1))
    # The row of a joint state has the tool's state with the same time.
    assert all(row[tool_x] == row[waist] for row in rows[::5])


@pytest.mark.parametrize("clock_ahead_ns", [0, -HOUR_NS, 30 * 365 * 24 * HOUR_NS])
def test_series_use_source_times_for_any_clock_offset(tmp_path, clock_ahead_ns):
    with RecordingFile(bunched(tmp_path / "a.mcap", clock_ahead_ns=clock_ahead_ns)) as file:
        first, last = file.layout.start_ns, file.layout.end_ns
        (series,) = SeriesReader().read(
            file, ["joints/waist/position"], start_ns=first, end_ns=last, points=10_000
        )
    assert len(series.times_s) >= 0.9 * STATES, "each state has a time of its own"
    inner = slice(TOGETHER, -TOGETHER)
    steps = np.diff(series.times_s[inner])
    assert steps == pytest.approx(np.full(len(steps), 0.01), abs=0.001)


def test_replay_publishes_each_state_at_its_source_time(tmp_path):
    source = RecordingSource(bunched(tmp_path / "a.mcap"))
    try:
        source.seek(source.start_ns)
        played, _ = source.take(source.end_ns, speed=1.0)
    finally:
        source.close()
    at_ns = [each.at_ns for each in played if each.topic == "joints"]
    assert at_ns == [START_NS + number * 10 * MS for number in range(TOGETHER, STATES)]


def message(received_ns, source_ns, topic=JOINTS):
    return RecordedMessage(received_ns, (0, 0), topic, source_ns, 0, b"")


def test_repeated_message_with_an_old_time_uses_its_receive_time():
    times, second = PublisherTimes(), 10**9
    assert times.of(message(100 * second, 100 * second - MS)) == 100 * second - MS
    assert times.of(message(101 * second, 100 * second - MS)) == 101 * second
    assert times.of(message(102 * second, 0)) == 102 * second
    assert times.of(message(103 * second, 103 * second - 2 * MS)) == 103 * second - 2 * MS
