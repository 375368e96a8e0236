"""Export as a Rerun recording: the arm in 3-D, video, joints and tool over time, events.

Entities are below `/<site>/<robot>`: `links`, `fixtures`, `frames`, `named_frames`, `joints`, `kinematics`,
`video` and `events`. Frames keep their names: every transform names parent and child as the recorded message.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from renderer.scene.appearance import Appearance, appearance_of, frame_placements, placements_at
from renderer.scene.views import camera_of
from robomesh.contract.keys import FREE, parse_key
from robomesh.extras import missing
from robomesh.recordings.h264 import is_key_frame
from robomesh.recordings.reading import RecordedMessage, RecordingFile
from robomesh.recordings.series.downsampling import known_values, units_of
from robomesh.recordings.series.publisher_time import PublisherTimes
from robomesh.recordings.series.values import values_of
from robomesh.schemas import robomesh_pb2 as schema
from robots.shapes.files.gltf import glb_to_z_up, read_glb
from services.command_line.record.export.plots import COLORS, panels_of
from services.command_line.record.export.recorded_video import recorded_pictures
from services.command_line.record.export.rerun_layout import PUBLISHER_TIME, RECEIVE_TIME, blueprint
from services.command_line.terminal.output import print_line, progress
from services.export.errors import ExportError
from services.export.shapes import recorded_shape
from services.export.span import Span, decoded, description_of, topics_of

if TYPE_CHECKING:
    import rerun as rr
    from google.protobuf.message import Message

# Rows of an entity that are sent together. Rerun recommends chunks of a few thousand rows, at most 12 MiB.
_ROWS, _BYTES = 4096, 4 << 20
_TOOL_AXES_M = 0.1
_VALUES = {"joints": JointStates, "kinematics": schema.KinematicState, "signals": schema.Signals}
_ABOUT = ("site", "robot", "name", "started_by", "cause", "part", "recovered")
_REPORT_EACH = 5000
_SEVERITY = schema.Event.Severity


class Transform(NamedTuple):
    """A placement of one frame in another, with its rotation as quaternion (x, y, z, w) or matrix (3, 3)."""

    parent: str
    child: str
    translation: Any
    rotation: Any


def write_rerun(file: RecordingFile, span: Span, target: Path) -> Counter[str]:
    """Write the recording; return the numbers of states, transforms, pictures and events.

    Raises:
        ExportError: If rerun-sdk is missing, the file cannot be written, or nothing can be shown.
        RecordingError: If the recording is damaged.
        RendererError: If the robot's description or a mesh is invalid.
    """
    try:
        import rerun as rr
    except ModuleNotFoundError:
        raise ExportError(missing("rerun")) from None
    topics = topics_of(file)
    if not topics:
        raise ExportError(f"{file.path.name}: it holds no topic of a robot")
    key = parse_key(next(iter(topics.values())))
    # Rerun keeps one layout per application, and each robot has its own entities.
    stream = rr.RecordingStream(f"robomesh_{key.site}_{key.robot}")
    try:
        with stream:
            stream.save(target)
            return _Export(rr, stream, file, span, topics).write()
    except RuntimeError as error:
        # The library reports a full disk and a missing folder so.
        raise ExportError(f"{target.parent}: cannot be written: {error}") from None


class _Rows:
    """Rows of one entity that have not been sent."""

    def __init__(self, send: Callable[[Sequence[tuple[int, int]], list[Any]], None]) -> None:
        self._send = send
        self._times: list[tuple[int, int]] = []
        self._values: list[Any] = []
        self._bytes = 0

    def add(self, publisher_ns: int, received_ns: int, value: Any, size: int = 0) -> None:
        self._times.append((publisher_ns, received_ns))
        self._values.append(value)
        self._bytes += size
        if len(self._values) >= _ROWS or self._bytes >= _BYTES:
            self.send()

    def send(self) -> None:
        if self._values:
            self._send(self._times, self._values)
        self._times, self._values, self._bytes = [], [], 0


class _Export:
    """One export; `rr` is the module, which only this export imports."""

    def __init__(
        self,
        library: Any,
        stream: rr.RecordingStream,
        file: RecordingFile,
        span: Span,
        topics: dict[str, str],
    ) -> None:
        self._rr, self._stream = library, stream
        self._file, self._span, self._topics = file, span, topics
        key = parse_key(next(iter(topics.values())))
        self._site, self._robot = key.site, key.robot
        self._description = description_of(file)
        known = known_values(file)
        self._panels = panels_of(known)
        self._colors = {
            value: COLORS[number % len(COLORS)]
            for panel in self._panels
            for number, value in enumerate(panel.values)
        }
        self._unit = units_of(file, known)
        self._rows: dict[str, _Rows] = {}
        self._counts: Counter[str] = Counter()

    def write(self) -> Counter[str]:
        rr, about = self._rr, self._file.layout.about
        appearance = None
        if self._description is not None and self._description.urdf:
            appearance = appearance_of(self._description)
        eye = None if appearance is None else camera_of(appearance, FREE)
        self._stream.send_blueprint(blueprint(self._path, self._site, self._views, self._panels, eye))
        self._stream.send_recording_name(about.get("name") or self._file.path.stem)
        self._stream.send_recording_start_time_nanos(self._file.layout.start_ns)
        if known := {name: about[name] for name in _ABOUT if about.get(name)}:
            self._stream.send_property("robomesh", rr.AnyValues(**known))
        self._write_body()
        with progress("Rerun recording") as report:
            self._write_messages(appearance, report)
            self._write_video()
        for rows in self._rows.values():
            rows.send()
        if not self._rows:
            raise ExportError(f"{self._file.path.name}: no joints, tool, frames, video or event in that time")
        return self._counts

    # ------------------------------------------------------------------- body

    def _write_body(self) -> None:
        """Write links, fixtures and named frames, if the recording describes the robot."""
        rr = self._rr
        self._log([], rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        if self._description is None:
            return
        for link in self._description.links:
            self._write_shape(["links", link.name], link, f"{self._frame_prefix}{link.name}", np.eye(4))
        for fixture in self._description.fixtures:
            fixture_to_site = np.array(fixture.fixture_to_site).reshape(4, 4)
            self._write_shape(["fixtures", fixture.name], fixture, self._site, fixture_to_site)
        for frame in self._description.frames:
            axes = rr.TransformAxes3D(_TOOL_AXES_M), rr.CoordinateFrame(f"{self._frame_prefix}{frame.name}")
            self._log(["named_frames", frame.name], *axes)

    def _write_shape(
        self,
        path: Sequence[str],
        body: schema.Description.Link | schema.Description.Fixture,
        parent: str,
        body_to_parent: Any,
    ) -> None:
        rr = self._rr
        if not body.mesh:
            return
        try:
            glb = recorded_shape(self._file, body)
        except ExportError as error:
            print_line(f"robomesh: without a body: {error}", err=True)
            return
        # Rerun draws the file's own axes, which glTF defines as y up.
        shape_to_parent = body_to_parent @ glb_to_z_up(glb)
        own = any(each.color or each.colors is not None for each in read_glb(glb))
        color = None if own or not body.color else _rgb(body.color)
        self._log(
            path,
            rr.Asset3D(contents=glb, media_type=rr.MediaType.GLB, albedo_factor=color),
            rr.Transform3D(
                translation=shape_to_parent[:3, 3], mat3x3=shape_to_parent[:3, :3], parent_frame=parent
            ),
        )

    # --------------------------------------------------------------- messages

    def _write_messages(self, appearance: Appearance | None, report: Callable[[float], None]) -> None:
        file, span, times = self._file, self._span, PublisherTimes()
        events = [name for name in self._topics if name.split("/")[0] == "events"]
        names = {self._topics[name]: name for name in (*_VALUES, "frames", *events) if name in self._topics}
        frames = self._topics.get("frames")
        if frames is not None and span.start_ns > file.layout.start_ns:
            # So that the arm has a place from the first moment.
            before = file.newest(frames, span.start_ns - 1)
            if before is not None:
                self._take_frames(times.of(before), before)
        recorded = frames is not None and file.newest(frames, span.end_ns) is not None
        for number, message in enumerate(
            file.messages(names, start_ns=span.start_ns, end_ns=span.end_ns + 1)
        ):
            name, at_ns = names[message.topic], times.of(message)
            if name == "frames":
                self._take_frames(at_ns, message)
            elif name in _VALUES:
                self._take_values(name, at_ns, message, None if recorded else appearance)
            elif (event := decoded(schema.Event, message.data)) is not None:
                self._add(name.split("/"), at_ns, message, event, self._event_columns)
                self._counts["events"] += 1
            if number % _REPORT_EACH == 0:
                report(span.share(message.received_ns))

    def _take_frames(self, at_ns: int, message: RecordedMessage) -> None:
        for each in getattr(decoded(FrameTransforms, message.data), "transforms", ()):
            at, turn = each.translation, each.rotation
            rotation = (turn.x, turn.y, turn.z, turn.w)
            transform = Transform(each.parent_frame_id, each.child_frame_id, (at.x, at.y, at.z), rotation)
            self._add_transform(at_ns, message, transform)

    def _take_values(
        self, name: str, at_ns: int, message: RecordedMessage, appearance: Appearance | None
    ) -> None:
        """Add joints, tool or signals.

        With an appearance, which a recording without frames needs, add also the links.
        """
        state: Message | None = decoded(_VALUES[name], message.data)
        if state is None:
            return
        for value, number in values_of(state.DESCRIPTOR.full_name, state):
            self._add(f"{name}/{value}".split("/"), at_ns, message, number, self._scalar_columns)
        if isinstance(state, JointStates):
            self._counts["states"] += 1
            if appearance is not None:
                positions = {
                    joint.name: joint.position for joint in state.joints if joint.HasField("position")
                }
                every = placements_at(appearance, positions)
                links = {
                    link.name: every[link.name] for link in appearance.description.links if link.name in every
                }
                for frame, placement in {**links, **frame_placements(appearance, every)}.items():
                    child = f"{self._frame_prefix}{frame}"
                    transform = Transform(self._site, child, placement[:3, 3], placement[:3, :3])
                    self._add_transform(at_ns, message, transform)

    def _write_video(self) -> None:
        rr = self._rr
        for name in self._views:
            newest_ns = 0
            path = name.split("/")
            for at_ns, message, picture in recorded_pictures(self._file, self._span, self._topics[name]):
                if picture.format != "h264":
                    raise ExportError(f"{self._file.path.name}: {name} is {picture.format}, not h264")
                if not newest_ns:
                    self._log(path, rr.VideoStream(rr.VideoCodec.H264))
                # Pictures must keep their order, also if the picture before was dated by its receipt.
                newest_ns = max(at_ns, newest_ns + 1)
                self._add(path, newest_ns, message, picture.data, self._video_columns, len(picture.data))
                self._counts["pictures"] += 1

    # ------------------------------------------------------------------- rows

    def _add_transform(self, at_ns: int, message: RecordedMessage, transform: Transform) -> None:
        path = ["frames", *transform.child.removeprefix(self._frame_prefix).split("/")]
        self._add(path, at_ns, message, transform, self._transform_columns)
        self._counts["transforms"] += 1

    def _add(
        self,
        path: Sequence[str],
        at_ns: int,
        message: RecordedMessage,
        value: Any,
        columns: Callable[[list[Any]], Any],
        size: int = 0,
    ) -> None:
        entity = "/".join(path)
        rows = self._rows.get(entity)
        if rows is None:
            whole = self._path(path)
            if columns == self._scalar_columns:
                color = _rgb(self._colors.get(entity, COLORS[0]))
                self._log(path, self._rr.SeriesLines(names=self._legend(entity), colors=color))

            def send(times: Sequence[tuple[int, int]], values: list[Any]) -> None:
                publisher, received = np.array(times, dtype="datetime64[ns]").T
                timelines = ((PUBLISHER_TIME, publisher), (RECEIVE_TIME, received))
                indexes = [self._rr.TimeColumn(name, timestamp=column) for name, column in timelines]
                self._stream.send_columns(whole, indexes, columns(values), strict=True)

            rows = self._rows[entity] = _Rows(send)
        rows.add(at_ns, message.received_ns, value, size)

    def _scalar_columns(self, values: list[float]) -> Any:
        return self._rr.Scalars.columns(scalars=values)

    def _event_columns(self, events: list[schema.Event]) -> Any:
        text = [f"{event.code}: {event.text}" for event in events]
        level = self._rr.TextLogLevel
        levels = {
            _SEVERITY.DEBUG: level.DEBUG,
            _SEVERITY.WARNING: level.WARN,
            _SEVERITY.ERROR: level.ERROR,
            _SEVERITY.CRITICAL: level.CRITICAL,
        }
        return self._rr.TextLog.columns(text=text, level=[levels.get(e.severity, level.INFO) for e in events])

    def _video_columns(self, pictures: list[bytes]) -> Any:
        keys = [is_key_frame(picture) for picture in pictures]
        return self._rr.VideoStream.columns(sample=pictures, is_keyframe=keys)

    def _transform_columns(self, transforms: list[Transform]) -> Any:
        rotations = np.array([each.rotation for each in transforms])
        return self._rr.Transform3D.columns(
            translation=np.array([each.translation for each in transforms]),
            **({"quaternion": rotations} if rotations.ndim == 2 else {"mat3x3": rotations}),
            parent_frame=[each.parent for each in transforms],
            child_frame=[each.child for each in transforms],
        )

    # ------------------------------------------------------------------ names

    @property
    def _frame_prefix(self) -> str:
        return f"{self._site}/{self._robot}/"

    @property
    def _views(self) -> list[str]:
        return [name for name in self._topics if name.startswith("video/")]

    def _path(self, path: Iterable[str]) -> str:
        return str(self._rr.new_entity_path([self._site, self._robot, *path]))

    def _log(self, path: Iterable[str], *what: Any) -> None:
        self._stream.log(self._path(path), *what, static=True, strict=True)

    def _legend(self, value: str) -> str:
        """Return a value's name in a plot, with its unit."""
        unit = self._unit(value)
        kind, *words = value.split("/")
        if kind == "joints" and words[-1] == "position":
            words.pop()
        return f"{' '.join(words)} [{unit}]" if unit else " ".join(words)


def _rgb(color: str) -> list[int]:
    """Return the bytes of "#rrggbb"."""
    return list(bytes.fromhex(color[1:]))
