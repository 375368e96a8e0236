"""Exports for Rerun, read back with Rerun's own reader and compared with the recording."""

import json
import math
import struct
import sys
from collections import defaultdict
from importlib.util import find_spec

import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.description import load
from robots.kinematics.model import build_model, link_placements
from services.command_line.main import run
from tests.recordings import START_NS, Written, joints, write_recording, write_swinging_arm

pytestmark = pytest.mark.skipif(find_spec("rerun") is None, reason="rerun is not installed")

y_to_z_up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
GLB_JSON, GLB_BINARY = 0x4E4F534A, 0x004E4942


@pytest.fixture(scope="module")
def swinging(tmp_path_factory):
    return write_swinging_arm(tmp_path_factory.mktemp("swinging") / "swinging.mcap")


def export(source, out, *options):
    assert run(["recordings", "export", str(source), str(out), *options]) == 0
    return content(out)


def content(path):
    """Return the values by entity and component, without the lists around single values."""
    from rerun.chunk import RrdReader  # takes half a second, in each worker

    found = defaultdict(lambda: defaultdict(list))
    for each in RrdReader(str(path)).stream():
        batch = each.to_record_batch()
        for name in batch.schema.names:
            column = batch.column(name)
            if name in ("publisher_time", "receive_time"):
                values = column.cast("int64").to_pylist()
            else:
                values = [value[0] if isinstance(value, list) else value for value in column.to_pylist()]
            found[str(each.entity_path)][name] += values
    return found


@pytest.mark.slow
def test_joints_and_events_are_the_files_on_both_timelines(swinging, tmp_path):
    found = export(swinging, tmp_path / "out.rrd", "--from", "0.5", "--to", "1")
    waist = found["/site/arm/joints/waist/position"]
    numbers = range(50, 101)
    assert waist["Scalars:scalars"] == [math.sin(number / 100) for number in numbers]
    assert waist["receive_time"] == [START_NS + number * 10_000_000 for number in numbers]
    # Published a microsecond before they were received.
    assert waist["publisher_time"] == [time_ns - 1000 for time_ns in waist["receive_time"]]
    assert waist["SeriesLines:names"] == ["waist [rad]"]
    events = found["/site/arm/events"]
    assert events["TextLog:level"] == ["WARN"]
    assert events["TextLog:text"] == ["odd: "]


def test_the_tool_has_its_position_speed_and_clearance(tmp_path):
    source = tmp_path / "tool.mcap"
    with Written(source) as file:
        state = schema.KinematicState(tool_to_base=range(16))
        state.linear_velocity.x, state.clearance.distance = 0.5, 0.25
        file.put("kinematics", state, 0.0)
    found = export(source, tmp_path / "out.rrd")
    shown = {
        name: found[f"/site/arm/kinematics/{name}"]["Scalars:scalars"]
        for name in ("tool/x", "tool/y", "tool/z", "tool/speed", "clearance")
    }
    assert shown == {"tool/x": [3], "tool/y": [7], "tool/z": [11], "tool/speed": [0.5], "clearance": [0.25]}
    assert found["/site/arm/kinematics/tool/speed"]["SeriesLines:names"] == ["tool speed [m/s]"]


def test_recorded_frames_keep_their_names_and_poses(tmp_path):
    source = tmp_path / "frames.mcap"
    with Written(source) as file:
        for number in range(3):
            frames = FrameTransforms()
            one = frames.transforms.add(parent_frame_id="site", child_frame_id="site/arm/base")
            one.translation.x, one.rotation.z, one.rotation.w = number, 0.6, 0.8
            frames.transforms.add(parent_frame_id="site", child_frame_id="site/table")
            file.put("frames", frames, number)
    found = export(source, tmp_path / "out.rrd", "--from", "1.5")
    base = found["/site/arm/frames/base"]
    # The frame before the span too, so that the arm has a place from its start.
    assert [place[0] for place in base["Transform3D:translation"]] == [1, 2]
    assert base["Transform3D:quaternion"][0] == pytest.approx([0, 0, 0.6, 0.8])
    assert base["Transform3D:parent_frame"] == ["site"] * 2
    assert base["Transform3D:child_frame"] == ["site/arm/base"] * 2
    assert found["/site/arm/frames/site/table"]["Transform3D:child_frame"] == ["site/table"] * 2


def test_a_recording_without_frames_gets_them_from_its_joints(swinging, tmp_path):
    found = export(swinging, tmp_path / "out.rrd", "--from", "1", "--to", "1")
    model = build_model(load("pt600"))
    home = np.deg2rad([joint.home for joint in load("pt600").joints])
    expected = link_placements(model, [math.sin(1.0), *home[1:]])
    for name, placement in zip(model.link_names, expected, strict=True):
        rows = found[f"/site/arm/frames/{name}"]
        assert rows["Transform3D:child_frame"] == [f"site/arm/{name}"]
        assert rows["Transform3D:translation"][0] == pytest.approx(placement[:3, 3], abs=1e-6)
        # Rerun's matrices are in column order.
        turned = np.array(rows["Transform3D:mat3x3"][0]).reshape(3, 3).T
        assert turned == pytest.approx(placement[:3, :3], abs=1e-6)


def test_shapes_are_attached_to_their_links_with_z_up(swinging, tmp_path):
    found = export(swinging, tmp_path / "out.rrd", "--to", "0")
    for name in ("base", "forearm"):
        link = found[f"/site/arm/links/{name}"]
        assert bytes(link["Asset3D:blob"][0])[:4] == b"glTF"
        assert link["Transform3D:parent_frame"] == [f"site/arm/{name}"]
        assert pytest.approx(y_to_z_up) == np.array(link["Transform3D:mat3x3"][0]).reshape(3, 3).T


def test_an_old_shape_and_a_fixture_stand_upright(tmp_path, capsys):
    source = tmp_path / "old.mcap"
    description = schema.Description(name="arm")
    description.links.add(name="base", mesh="base", color="#ff8000")
    description.links.add(name="hand", mesh="hand", mesh_sha256="00")
    table = description.fixtures.add(name="table", mesh="base")
    table.fixture_to_site[:] = [*(0, -1, 0, 5), *(1, 0, 0, 6), *(0, 0, 1, 7), *(0, 0, 0, 1)]
    with Written(source) as file:
        file.put("description", description, 0.0)
        file.attach("mesh/base", triangle({"robomesh": {"up": "z"}}))
        file.put("joints", joints(waist=0.0), 0.0)
    found = export(source, tmp_path / "out.rrd")
    base, fixture = found["/site/arm/links/base"], found["/site/arm/fixtures/table"]
    assert np.array(base["Transform3D:mat3x3"][0]).reshape(3, 3) == pytest.approx(np.eye(3))
    assert base["Asset3D:albedo_factor"] == [0xFF8000FF]
    assert fixture["Transform3D:parent_frame"] == ["site"]
    assert fixture["Transform3D:translation"] == [[5, 6, 7]]
    assert np.array(fixture["Transform3D:mat3x3"][0]).reshape(3, 3).T[0] == pytest.approx([0, -1, 0])
    assert "without a body: old.mcap: it holds no mesh of hand" in capsys.readouterr().err


def triangle(extras):
    """Return a GLB of one triangle without a colour."""
    document = {
        "asset": {"version": "2.0", "extras": extras},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = np.eye(3, dtype="<f4").tobytes()
    body = (
        struct.pack("<II", len(text), GLB_JSON) + text + struct.pack("<II", len(binary), GLB_BINARY) + binary
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def test_video_begins_with_the_key_frame_before_the_span(tmp_path):
    source = write_recording(tmp_path / "video.mcap", seconds=2.0)
    video = export(source, tmp_path / "out.rrd", "--from", "0.7")["/site/arm/video/front"]
    pictures = [bytes(sample) for sample in video["VideoStream:sample"]]
    assert len(pictures) == 30
    assert pictures[0].endswith(b"\x6550")
    assert video["VideoStream:is_keyframe"] == [number % 10 == 0 for number in range(30)]
    assert video["publisher_time"] == sorted(set(video["publisher_time"]))


def test_a_repeated_picture_keeps_its_place(tmp_path):
    source = tmp_path / "repeated.mcap"
    with Written(source) as file:
        for number, (at_s, repeated) in enumerate([(0.0, False), (1.0, True), (1.0, False)]):
            data = bytes([0, 0, 0, 1, 0x65, number])
            file.put("video/front", CompressedVideo(format="h264", data=data), at_s, repeated=repeated)
    video = export(source, tmp_path / "out.rrd")["/site/arm/video/front"]
    assert [bytes(sample)[-1] for sample in video["VideoStream:sample"]] == [0, 1, 2]
    assert video["publisher_time"] == sorted(set(video["publisher_time"]))


def test_the_counts_are_printed(swinging, tmp_path, capsys):
    export(swinging, tmp_path / "out.rrd", "--json")
    printed = json.loads(capsys.readouterr().out)
    assert (printed["states"], printed["events"], printed["transforms"]) == (201, 1, 201 * 7)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("description", "no joints, tool, frames, video or event in that time"),
        ("", "it holds no topic of a robot"),
    ],
)
def test_a_recording_with_nothing_to_show_is_refused(tmp_path, capsys, file, text):
    source = tmp_path / "empty.mcap"
    with Written(source) as written:
        if file:
            written.put(file, schema.Description(name="arm"), 0.0)
    assert run(["recordings", "export", str(source), str(tmp_path / "out.rrd")]) == 2
    assert text in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty.mcap"]


def test_a_missing_library_is_one_line(swinging, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert run(["recordings", "export", str(swinging), str(tmp_path / "out.rrd")]) == 2
    assert capsys.readouterr().err == (
        "robomesh: this needs the package rerun, which is not installed: ./dev add rerun\n"
    )


def test_a_folder_that_does_not_exist_is_one_line(swinging, tmp_path, capsys):
    assert run(["recordings", "export", str(swinging), str(tmp_path / "none" / "out.rrd")]) == 2
    assert "cannot be written" in capsys.readouterr().err
