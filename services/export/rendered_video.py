"""Video of a recording, rendered from its joints: any view, size and rate."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from renderer.drawing.studio import Studio
from renderer.encoding.encoder import open_encoder
from renderer.encoding.mp4 import FragmentedMp4
from renderer.pictures.clearance_line import draw_clearance_line
from renderer.pictures.composition import RobotSnapshot, compose
from renderer.pictures.overlay import write_over
from renderer.pictures.requested_views import ViewSpec
from renderer.pictures.robot_state import Ages, RobotState
from renderer.scene.appearance import appearance_of, placements_at, shape_name
from renderer.shapes.cache import cache_folder
from robomesh.recordings.reading import RecordedMessage, RecordingFile
from robomesh.recordings.series.publisher_time import PublisherTimes
from robomesh.schemas import robomesh_pb2 as schema
from services.export.errors import ExportError
from services.export.shapes import recorded_shape
from services.export.span import Span, decoded, description_of, needed, topics_of

_KEY_FRAME_EACH_S = 2.0
_LARGEST_PX, _SMALLEST_PX = 4096, 64


@dataclass(frozen=True, kw_only=True)
class Rendering:
    """View, size and rate of the video.

    Attributes:
        samples: Anti-aliasing samples; 0: none.
    """

    view: str
    size: tuple[int, int]
    fps: float
    samples: int


def write_rendered(
    file: RecordingFile,
    span: Span,
    target: Path,
    rendering: Rendering,
    *,
    on_progress: Callable[[float], None],
) -> tuple[int, float]:
    """Render and write the video; return pictures and seconds.

    Args:
        on_progress: Called with the rendered share, from 0 to 1.

    Raises:
        ExportError: If the recording has no description, or a mesh is missing.
        RendererError: If the view does not exist, or this machine cannot render or encode.
    """
    _check(rendering)
    state = _robot(file)
    assert state.appearance is not None
    spec = ViewSpec(name=rendering.view, of=rendering.view, size=rendering.size, fps=rendering.fps)
    studio = Studio(
        rendering.size, samples=rendering.samples, shading="full", device=None, folder=cache_folder()
    )
    mp4, key_each = FragmentedMp4(), max(round(_KEY_FRAME_EACH_S * rendering.fps), 1)
    try:
        _take_shapes(file, state.appearance.description, studio)
        encoder = open_encoder(rendering.size, rendering.fps)
        with target.open("wb") as stream:
            for number, (time_ns, ages) in enumerate(_pictures(file, span, state, rendering.fps)):
                composition = compose(spec, state.appearance, RobotSnapshot(state, ages), ())
                drawn = studio.draw(
                    composition.scene,
                    composition.camera,
                    size=rendering.size,
                    close_up_of=rendering.view if composition.follow else None,
                )
                if composition.clearance_line is not None:
                    draw_clearance_line(
                        drawn.picture, drawn.camera, composition.clearance_line, labelled=True
                    )
                write_over(drawn.picture, composition.overlay)
                packet = encoder.encode(drawn.picture, key_frame=number % key_each == 0)
                stream.write(mp4.add(packet.data, time_ns, usual_s=1 / rendering.fps))
                on_progress(span.share(time_ns))
    finally:
        studio.close()
    return mp4.pictures, mp4.duration_s


def _check(rendering: Rendering) -> None:
    width, height = rendering.size
    if not all(_SMALLEST_PX <= side <= _LARGEST_PX and side % 2 == 0 for side in (width, height)):
        raise ExportError(f"--size {width}x{height}: even, and from {_SMALLEST_PX} to {_LARGEST_PX} a side")
    if not 1.0 <= rendering.fps <= 120.0:
        raise ExportError(f"--fps {rendering.fps:g}: must be 1 to 120")
    if rendering.samples not in (0, 2, 4, 8):
        raise ExportError(f"--samples {rendering.samples}: must be 0, 2, 4 or 8")


def _robot(file: RecordingFile) -> RobotState:
    description = description_of(file)
    if description is None or not description.urdf:
        raise ExportError(f"{file.path.name}: it holds no description of the robot")
    _, site, robot, _ = needed(file, "joints").split("/", 3)
    # Mark the pictures as a replay, not as live.
    description.replay.SetInParent()
    return RobotState(site, robot, appearance=appearance_of(description))


def _take_shapes(file: RecordingFile, description: schema.Description, studio: Studio) -> None:
    bodies: list[schema.Description.Link | schema.Description.Fixture] = [
        *description.links,
        *description.fixtures,
    ]
    for body in bodies:
        if body.mesh:
            studio.add_shape(shape_name(body), recorded_shape(file, body), body.color)


def _pictures(file: RecordingFile, span: Span, state: RobotState, fps: float) -> Iterator[tuple[int, Ages]]:
    """Yield the time of each picture with the ages of its values, after updating the robot's state to it."""
    topics = topics_of(file)
    needed(file, "joints")
    names = {topics[name]: name for name in ("joints", "controller", "kinematics") if name in topics}
    times, updated_ns = PublisherTimes(), dict[str, int]()

    def take(at_ns: int, message: RecordedMessage) -> None:
        name = names[message.topic]
        if name == "joints":
            if (joints := decoded(JointStates, message.data)) is None:
                return
            state.update_joints(joints)
            assert state.appearance is not None
            state.link_placements = placements_at(state.appearance, state.positions)
            state.source_time_ns = message.source_ns
        elif name == "controller":
            if (controller := decoded(schema.ControllerState, message.data)) is None:
                return
            state.update_controller(controller)
        else:
            if (kinematics := decoded(schema.KinematicState, message.data)) is None:
                return
            state.update_kinematics(kinematics, {state.name: state})
        updated_ns[name] = at_ns

    for message in file.state_at([*names], span.start_ns).values():
        take(times.of(message), message)
    following = file.messages([*names], start_ns=span.start_ns + 1, end_ns=span.end_ns + 1)
    arriving = ((times.of(message), message) for message in following)
    pending = next(arriving, None)
    count = max(math.floor((span.end_ns - span.start_ns) * 1e-9 * fps) + 1, 1)
    for number in range(count):
        time_ns = span.start_ns + round(number / fps * 1e9)
        while pending is not None and pending[0] <= time_ns:
            take(*pending)
            pending = next(arriving, None)
        age = {
            name: (time_ns - updated_ns[name]) * 1e-9 if name in updated_ns else None
            for name in names.values()
        }
        yield (
            time_ns,
            Ages(
                frames=age.get("joints"),
                joints=age.get("joints"),
                controller=age.get("controller"),
                kinematics=age.get("kinematics"),
            ),
        )
