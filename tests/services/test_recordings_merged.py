"""Recordings after `merge`, `filter` and `recover` of the `mcap` tools.

The tests merge with the tool's rule; with `mcap` on the `PATH`, the last one runs the tool itself.
"""

import csv
import json
import re
import shutil
import subprocess

import pytest
import zenoh
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

import robomesh
from robomesh.contract.endpoints import router_config
from robomesh.recordings.files import describe_file
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.recovery.recover import State, recover, state_of
from robomesh.recordings.series.downsampling import known_values
from robomesh.wire.session import SessionSettings
from services.command_line.main import run as command
from services.player.recording_source import RecordingSource
from tests.conftest import run
from tests.ports import free_port
from tests.recordings import START_NS, Written, joints, merge, write_capture
from tests.services.recording import put_states, recording_site, trace_off, trace_on, until, until_indexed
from tests.services.test_recordings_elsewhere import counted

pytestmark = pytest.mark.slow

JOINTS = "robomesh/site/arm/joints"
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Return two recordings of one arm by the recorder, with the numbers 0 to 19 and 20 to 39."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(router_config((endpoint,))):
        mesh = SessionSettings(connect=(endpoint,), wait_s=10.0)
        return run(record(mesh, tmp_path_factory.mktemp("recordings")), timeout_s=60.0)


async def record(mesh, folder):
    paths = []
    async with recording_site(mesh, folder) as session:
        publisher = session.declare_publisher("site", "arm", "joints")
        for begin in (0, 20):
            await trace_on(session, name="trial")
            await until(lambda: publisher.watched)
            await put_states(publisher, range(begin, begin + 20))
            await counted(session, {"joints": 20})
            paths.append(folder / "arm" / (await trace_off(session)).file)
            await until_indexed(paths[-1])
            await until(lambda: not publisher.watched)
    return paths


def positions(path):
    return robomesh.open_recording(path).joints().positions[:, 0].tolist()


def sources(path):
    """Return the recordings of a merged file: robot, name, start [s], duration [s], losses."""
    return [
        (
            each.robot,
            each.name,
            (each.start.ToNanoseconds() - START_NS) / SECOND,
            each.duration.ToNanoseconds() / SECOND,
            {topic.topic: topic.lost for topic in each.topics},
        )
        for each in describe_file(path).merged_from
    ]


def test_two_recordings_of_the_recorder_can_be_merged_and_read(recorded, tmp_path):
    merged = merge(recorded, tmp_path / "merged.mcap")
    found = describe_file(merged)
    assert (found.site, found.robot, found.name) == ("site", "arm", "trial")
    assert [(each.robot, each.name) for each in found.merged_from] == [("arm", "trial")] * 2
    alone = [describe_file(path) for path in recorded]
    for one, source in zip(found.merged_from, alone, strict=True):
        assert not source.merged_from
        assert one.start.ToNanoseconds() <= source.start.ToNanoseconds()
        end_ns = one.start.ToNanoseconds() + one.duration.ToNanoseconds()
        assert end_ns == source.start.ToNanoseconds() + source.duration.ToNanoseconds()
    assert positions(merged) == list(range(40))


def test_a_file_keeps_its_name_in_a_merge_when_it_is_renamed_or_copied(recorded, tmp_path):
    copy = shutil.copy(recorded[0], tmp_path / "other.mcap")
    with pytest.raises(ValueError, match=r"robomesh:site/arm/20\S+_trial' was previously"):
        merge([recorded[0], copy], tmp_path / "merged.mcap")


def test_a_merged_file_lists_its_recordings_with_their_losses(tmp_path, capsys):
    first = write_capture(tmp_path / "1.mcap", range(100), missed=3)
    second = write_capture(tmp_path / "2.mcap", range(200, 250), robot="other")
    merged = merge([first, second], tmp_path / "merged.mcap")
    assert sources(merged) == [
        ("arm", "trial", 0.0, 0.99, {JOINTS: 3}),
        ("other", "trial", 2.0, 0.49, {}),
    ]
    assert describe_file(merged).robot == ""
    assert command(["recordings", "info", str(merged)]) == 0
    printed = capsys.readouterr().out
    assert "several robots" in printed
    assert "merged from 2 recordings" in printed
    # Already the next day east of UTC+2.
    assert re.search(r"from site/arm trial, 2023-11-1[45]", printed)
    assert "1.0 s, 3 lost" in printed
    assert command(["recordings", "info", str(merged), "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["merged_from"]
    assert [(each["robot"], each["lost"]) for each in listed] == [("arm", 3), ("other", 0)]


def test_a_publication_in_two_merged_recordings_is_read_once(tmp_path, caplog):
    first, second = (
        write_capture(tmp_path / "1.mcap", range(100)),
        write_capture(tmp_path / "2.mcap", range(50, 150)),
    )
    merged = merge([first, second], tmp_path / "merged.mcap")
    assert positions(merged) == list(range(150))
    assert not caplog.text
    with RecordingFile(merged) as file:
        last = [JointStates.FromString(each.data) for each in file.last(JOINTS, START_NS + SECOND, 5)]
    assert [each.joints[0].position for each in last] == [96, 97, 98, 99, 100]
    table = tmp_path / "out.csv"
    assert command(["recordings", "export", str(merged), str(table)]) == 0
    with table.open(newline="") as stream:
        times = [row["time"] for row in csv.DictReader(stream)]
    assert times == sorted(set(times))
    assert len(times) == 150


@pytest.mark.parametrize("ending", ["csv", "png", "mp4", "rrd"])
def test_a_merge_of_several_robots_is_not_exported(tmp_path, capsys, ending):
    if ending == "rrd":
        pytest.importorskip("rerun")
    merged = merged_robots(tmp_path)
    assert command(["recordings", "export", str(merged), str(tmp_path / f"out.{ending}")]) == 2
    assert "merged from recordings of several robots: site/arm, site/other" in capsys.readouterr().err


def test_a_merge_of_several_robots_is_neither_played_nor_opened(tmp_path):
    merged = merged_robots(tmp_path)
    with RecordingFile(merged) as file:
        for read in (RecordingSource, robomesh.open_recording, lambda _, file=file: known_values(file)):
            with pytest.raises(robomesh.RecordingError) as refused:
                read(merged)
            assert refused.value.reason.code == "recording.several_robots"


def test_a_robot_without_messages_is_not_counted(tmp_path):
    path = tmp_path / "filtered.mcap"
    with Written(path, robot="other") as file:
        file.put("joints", joints(waist=1.0), 0.0)
        schema_id = next(iter(file._channels.values()))
        file._writer.register_channel(JOINTS, "protobuf", schema_id)
    source = RecordingSource(path)
    source.close()
    assert source.of_robot == "other"


def merged_robots(folder):
    first = write_capture(folder / "1.mcap", range(10))
    return merge([first, write_capture(folder / "2.mcap", range(10), robot="other")], folder / "merged.mcap")


def test_a_recording_merged_with_topics_of_another_program_is_not_taken_for_the_recording(tmp_path):
    camera = tmp_path / "camera.mcap"
    with camera.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="camera")
        writer.add_metadata("calibration", {"fx": "1"})
        channel = writer.register_channel("/camera", "json", writer.register_schema("t", "jsonschema", b"{}"))
        for number in range(3):  # without numbers and publisher's times
            writer.add_message(channel, START_NS + 100 * SECOND + number, b"{}", 0, 0)
        writer.finish()
    merged = merge([write_capture(tmp_path / "1.mcap", range(10)), camera], tmp_path / "merged.mcap")
    assert sources(merged) == [("arm", "trial", 0.0, 0.09, {})]
    assert positions(merged) == list(range(10))
    with RecordingFile(merged) as file:
        assert len(list(file.messages(["/camera"]))) == 3


def test_a_cut_recording_still_describes_itself(tmp_path):
    path = write_capture(tmp_path / "1.mcap", range(100))
    path.write_bytes(path.read_bytes()[:-500])
    with path.open("rb") as stream:
        records = iter(StreamReader(stream).records)
        assert [type(next(records)).__name__ for _ in range(2)] == ["Header", "Metadata"]
    cut = describe_file(path)
    assert (cut.site, cut.robot, cut.name, cut.started_by) == ("site", "arm", "trial", "request")
    recover(path)
    assert describe_file(path).recovered
    assert describe_file(path).name == "trial"


def test_recovery_of_a_merged_file_keeps_its_recordings_and_attachments(tmp_path):
    first = write_capture(tmp_path / "1.mcap", range(100), missed=3)
    second = write_capture(tmp_path / "2.mcap", range(200, 250))
    merged = merge([first, second], tmp_path / "merged.mcap")
    merged.write_bytes(merged.read_bytes()[:-8])
    assert state_of(merged) is State.UNFINISHED
    recover(merged)
    assert sources(merged) == [
        ("arm", "trial", 0.0, 0.99, {JOINTS: 3}),
        ("arm", "trial", 2.0, 0.49, {}),
    ]
    with RecordingFile(merged) as file:
        assert file.attachment("robot.toml") == b"2"
    assert merged.read_bytes().count(b"robot.toml") >= 2
    (counted,) = describe_file(merged).topics
    assert (counted.messages, counted.lost) == (150, 3)


def test_metadata_of_an_earlier_version_is_read_and_keeps_its_names(tmp_path):
    path = tmp_path / "old.mcap"
    with Written(path) as file:
        file.put("joints", joints(waist=1.0), 0.0)
        file._writer.add_metadata("robomesh.lost", {JOINTS: "3"})
    recover(path)
    found = describe_file(path)
    assert (found.robot, found.name, found.topics[0].lost) == ("arm", "old", 3)
    with path.open("rb") as stream:
        names = [each.name for each in StreamReader(stream).records if type(each).__name__ == "Metadata"]
    assert names == ["robomesh", "robomesh.lost"]


@pytest.mark.skipif(shutil.which("mcap") is None, reason="mcap is not on the PATH")
def test_the_mcap_tool_merges_filters_and_recovers_without_flags(recorded, tmp_path):
    def mcap(*words):
        done = subprocess.run(["mcap", *words], capture_output=True, text=True, timeout=60.0, check=False)
        assert done.returncode == 0, done.stderr

    merged, filtered, cut = (tmp_path / f"{name}.mcap" for name in ("merged", "filtered", "cut"))
    mcap("merge", *map(str, recorded), "-o", str(merged))
    assert positions(merged) == list(range(40))
    mcap("filter", str(recorded[0]), "-y", ".*/joints", "-o", str(filtered))
    assert positions(filtered) == list(range(20))
    killed = write_capture(tmp_path / "killed.mcap", range(10), closed=False)
    mcap("recover", str(killed), "-o", str(cut))
    assert (describe_file(cut).name, positions(cut)) == ("trial", list(range(10)))
    for path in (*recorded, merged, filtered, cut):
        mcap("doctor", str(path))
