"""What is known of a robot now, and what a picture says of it."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from numpy.typing import NDArray

from renderer.appearance import Look, home_placements
from renderer.clearance_line import Span, same_span, span_of
from renderer.overlay import Overlay, Row
from robomesh.schemas.robomesh_pb2 import ControllerState, Description, KinematicState
from robomesh.topics import topic

FloatArray = NDArray[np.float64]

# Metres, or the rotation's entries: less is below a pixel.
_NOTICEABLE = 3e-5

_STALE_AFTER_S = topic("frames").stale_after_s or 1.0
_TOOL = "tool"
# Of the trail: how long ago, and how many points of it are kept.
_TRAIL_S, _TRAIL_POINTS = 6.0, 240


@dataclass
class RobotState:
    """The newest of each topic of one robot.

    Attributes:
        look: None until its description and meshes came.
        link_placements: (4, 4) link to site by link; empty until frames came.
        positions: By joint [rad] or [m]; empty until joint states came.
        span: Between it and what is nearest; None: nothing is, or nobody tells.
        touching: Links that touch something.
        trail: Where the tool was, and when [ns]; oldest first.
        source_time_ns: Of what the placements show.
        dated_by: The publisher of that time.
        version: Counts what came and would change a picture.
    """

    site: str
    name: str
    look: Look | None = None
    link_placements: dict[str, FloatArray] = field(default_factory=dict)
    positions: dict[str, float] = field(default_factory=dict)
    controller: ControllerState | None = None
    span: Span | None = None
    touching: frozenset[str] = frozenset()
    trail: deque[tuple[int, FloatArray]] = field(default_factory=lambda: deque(maxlen=_TRAIL_POINTS))
    source_time_ns: int = 0
    dated_by: int | None = None
    version: int = 0
    _noticed: dict[str, FloatArray] = field(default_factory=dict)

    @property
    def stale_after_s(self) -> float:
        """Older than this, what is known of where it is must not look live [s]."""
        told = self.look is not None and self.look.description.HasField("stale_after_s")
        return self.look.description.stale_after_s if self.look is not None and told else _STALE_AFTER_S

    @property
    def cell(self) -> str:
        """That it shares with other robots; empty: it is drawn alone, as all that is played back."""
        alone = self.look is None or self.look.description.HasField("replay")
        return "" if self.look is None or alone else self.look.description.cell

    def take_frames(self, message: FrameTransforms, source_time_ns: int, dated_by: int) -> None:
        """Take newer placements of the links; `dated_by`: the publisher who dates them."""
        prefix = f"{self.site}/{self.name}/"
        placements = {
            transform.child_frame_id.removeprefix(prefix): _placement(transform)
            for transform in message.transforms
            if transform.child_frame_id.startswith(prefix)
        }
        if source_time_ns < self.source_time_ns:
            self.trail.clear()  # a replay that was turned back
        self.link_placements, self.source_time_ns = placements, source_time_ns
        self.dated_by = dated_by
        if _TOOL in placements:
            self._leave_trail(placements[_TOOL][:3, 3], source_time_ns)
        # Frames come all the time; a picture is only worth drawing when they differ, by creeping too.
        if not _same(placements, self._noticed):
            self._noticed = placements
            self.version += 1

    def _leave_trail(self, tool: FloatArray, now_ns: int) -> None:
        trail = self.trail
        while trail and now_ns - trail[0][0] > _TRAIL_S * 1e9:
            trail.popleft()
        if not trail or now_ns - trail[-1][0] >= _TRAIL_S * 1e9 / _TRAIL_POINTS:
            trail.append((now_ns, tool))

    def take_joints(self, message: JointStates) -> None:
        """Take newer joint positions; a picture waits for the frames that belong to them."""
        self.positions = {joint.name: joint.position for joint in message.joints}

    def take_controller(self, message: ControllerState) -> None:
        """Take a newer state of the controller."""
        if _state_words(message) != _state_words(self.controller):
            self.version += 1
        self.controller = message

    def take_kinematics(self, message: KinematicState, robots: Mapping[str, "RobotState"]) -> None:
        """Take newer kinematics.

        Args:
            robots: Of the site, by name: how near this one may come to them they tell.
        """
        span = None
        if message.HasField("clearance"):
            # <site>/<robot>/<link>, or a fixture's <site>/<fixture>.
            frames = (message.clearance.first, message.clearance.second)
            ends = {frame.partition("/")[2].partition("/")[0] for frame in frames}
            looks = [robot.look for name, robot in robots.items() if name in ends]
            span = span_of(message.clearance, [look.description for look in looks if look is not None])
        touching = self._touching(message)
        # The arm may stand, and the other come.
        if not same_span(span, self.span) or touching != self.touching:
            self.version += 1
        self.span, self.touching = span, touching

    def _touching(self, message: KinematicState) -> frozenset[str]:
        prefix = f"{self.site}/{self.name}/"
        frames = [
            frame
            for name in ("clearance", "own_clearance")
            if message.HasField(name) and not (near := getattr(message, name)).distance
            for frame in (near.first, near.second)
        ]
        return frozenset(frame.removeprefix(prefix) for frame in frames if frame.startswith(prefix))


@dataclass(frozen=True, kw_only=True)
class Ages:
    """Time since each topic's last new value came [s]; None: none came while we listened."""

    frames: float | None
    joints: float | None
    controller: float | None
    kinematics: float | None = None


def age_s(state: RobotState, ages: Ages) -> float:
    """How old what a picture shows is [s]; infinite where nobody knows.

    The gateway's own word counts too: what it received last may be older than the message that
    tells of it.
    """
    if ages.frames is None or ages.joints is None:
        told = _told_age(state, ages)
        return math.inf if told is None else max(told, state.stale_after_s * 1.001)
    return max(ages.frames, ages.joints, _told_age(state, ages) or 0.0)


def _told_age(state: RobotState, ages: Ages) -> float | None:
    controller = state.controller
    if controller is None or not controller.HasField("last_unit_age_s") or ages.controller is None:
        return None
    if controller.link == ControllerState.UP:
        # Its next word is up to a second away, and units come meanwhile: joints tell their age.
        return controller.last_unit_age_s
    return controller.last_unit_age_s + ages.controller


def span_now(state: RobotState, ages: Ages) -> Span | None:
    """What is drawn between the arm and what is nearest; None: nobody tells what it is now."""
    return state.span if _near_known(state, ages) else None


def touching_now(state: RobotState, ages: Ages) -> frozenset[str]:
    """Links that touch something; none where nobody tells it now."""
    return state.touching if _near_known(state, ages) else frozenset()


def is_stale(state: RobotState, ages: Ages) -> bool:
    """Whether nobody knows where it is now."""
    return age_s(state, ages) > state.stale_after_s


def _near_known(state: RobotState, ages: Ages) -> bool:
    known = ages.kinematics is not None and ages.kinematics <= state.stale_after_s
    return known and not is_stale(state, ages)


def _same(some: dict[str, FloatArray], others: dict[str, FloatArray]) -> bool:
    return some.keys() == others.keys() and all(
        np.abs(placement - others[name]).max() < _NOTICEABLE for name, placement in some.items()
    )


def placements_now(state: RobotState, look: Look) -> dict[str, FloatArray]:
    """(4, 4) link to site of every link; at home as long as nobody told."""
    return state.link_placements or home_placements(look)


def overlay_of(state: RobotState, look: Look, view: str, *, age: float) -> Overlay:
    """What is written over a picture of a robot.

    Args:
        age: Of what it shows [s].
    """
    description = look.description
    return Overlay(
        title=state.name,
        view=view,
        time=_time(state.source_time_ns, dated=description.HasField("replay")),
        state=_state_words(state.controller),
        rows=tuple(_row(joint, state.positions[joint.name]) for joint in _told(description, state)),
        marks=_marks(description),
        scale="" if look.floor is None else f"{look.square_m * 1e3:g} mm",
        stale=_stale_words(state, age),
    )


def warning_of(state: RobotState, *, age: float) -> Overlay:
    """What even a small picture must say; no number, for it is looked at long after it was drawn."""
    stale = "STALE" if age > state.stale_after_s else ""
    if not state.link_placements:
        stale = "NO DATA"
    replay = state.look is not None and state.look.description.HasField("replay")
    marks = ("replay",) if replay else ()
    return Overlay(title="", view="", time="", state="", rows=(), marks=marks, stale=stale)


def _marks(description: Description) -> tuple[str, ...]:
    marks = {"replay": description.HasField("replay"), "simulated": description.simulated}
    return tuple(mark for mark, holds in marks.items() if holds)


def _told(description: Description, state: RobotState) -> list[Description.Joint]:
    return [joint for joint in description.joints if joint.name in state.positions]


def _stale_words(state: RobotState, age: float) -> str:
    if not state.link_placements:
        return "NO DATA, drawn at home"
    if age <= state.stale_after_s:
        return ""
    if math.isinf(age):
        return "STALE"
    return f"STALE {age:.0f} s" if age < 120 else f"STALE {age / 60:.0f} min"


def _state_words(controller: ControllerState | None) -> str:
    if controller is None:
        return ""
    if controller.link != ControllerState.UP:
        link = ControllerState.Link.Name(controller.link)
        return f"controller {link.lower()}"
    words = [ControllerState.Activity.Name(controller.activity), ControllerState.Mode.Name(controller.mode)]
    known = [word.lower() for word in words if not word.endswith(("UNKNOWN", "UNSPECIFIED"))]
    if controller.HasField("stop"):
        known.insert(0, "stop request latched")
    return ", ".join(dict.fromkeys(known))


def _time(source_time_ns: int, *, dated: bool) -> str:
    if not source_time_ns:
        return ""
    local = datetime.fromtimestamp(source_time_ns * 1e-9, tz=UTC).astimezone()
    return (
        f"{local:%Y-%m-%d} " if dated else ""
    ) + f"{local:%H:%M:%S}.{local.microsecond // 100_000} {local:%Z}"


def _row(joint: Description.Joint, position: float) -> Row:
    rotary = joint.type == Description.Joint.ROTARY
    shown = f"{math.degrees(position):.2f}" if rotary else f"{position * 1e3:.1f}"
    width = joint.upper - joint.lower
    return Row(
        name=joint.name,
        value=shown.replace("-", "−"),
        unit="°" if rotary else "mm",
        share=(position - joint.lower) / width if width > 0 else 0.5,
    )


def _placement(transform: FrameTransform) -> FloatArray:
    q, t = transform.rotation, transform.translation
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), t.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), t.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), t.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
