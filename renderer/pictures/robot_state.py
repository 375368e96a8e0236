"""The latest state of a robot, and the texts of its pictures."""

import math
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from numpy.typing import NDArray

from renderer.pictures.clearance_line import ClearanceLine, line_of, same_line
from renderer.pictures.overlay import Overlay, Row
from renderer.scene.appearance import Appearance, home_placements
from robomesh.contract.activity import activity_words
from robomesh.contract.enum_names import enum_word
from robomesh.contract.topics import stale_after_s
from robomesh.schemas.robomesh_pb2 import ControllerState, Description, KinematicState

FloatArray = NDArray[np.float64]

# Smaller movements are below a pixel (metres, or rotation matrix entries).
_NOTICEABLE = 3e-5

_TOOL = "tool"
# Duration of the trail, and its largest number of points.
_TRAIL_S, _TRAIL_POINTS = 6.0, 240


@dataclass
class RobotState:
    """The latest message of each topic of one robot.

    Attributes:
        appearance: None until the description and the shapes were received.
        link_placements: (4, 4) link to site by link; empty until frames were received.
        positions: By joint [rad] or [m]; empty until joint states were received.
        clearance_line: Line to the nearest body; None if there is none, or no clearance is published.
        touching: Links in contact.
        trail: Past positions of the tool with their times [ns], oldest first.
        source_time_ns: Source time of the placements.
        dated_by: Id of the publisher of that time.
        moved_at: Time at which placements arrived that differ from those before, on the monotonic clock [s].
        version: Incremented by each message that changes the picture.
    """

    site: str
    name: str
    appearance: Appearance | None = None
    link_placements: dict[str, FloatArray] = field(default_factory=dict)
    positions: dict[str, float] = field(default_factory=dict)
    controller: ControllerState | None = None
    clearance_line: ClearanceLine | None = None
    touching: frozenset[str] = frozenset()
    trail: deque[tuple[int, FloatArray]] = field(default_factory=lambda: deque(maxlen=_TRAIL_POINTS))
    source_time_ns: int = 0
    dated_by: int | None = None
    moved_at: float = -math.inf
    version: int = 0
    _noticed: dict[str, FloatArray] = field(default_factory=dict)

    @property
    def stale_after_s(self) -> float:
        """Age from which the robot's placements are stale and must not look live [s]."""
        description = None if self.appearance is None else self.appearance.description
        return stale_after_s("frames", description) or math.inf

    @property
    def cell(self) -> str:
        """The cell that it shares with other robots; empty if it is drawn alone, like every replay."""
        drawn_alone = self.appearance is None or self.appearance.description.HasField("replay")
        return "" if self.appearance is None or drawn_alone else self.appearance.description.cell

    def update_frames(self, message: FrameTransforms, source_time_ns: int, dated_by: int) -> None:
        """Store newer placements of the links; `dated_by` is the id of their publisher."""
        prefix = f"{self.site}/{self.name}/"
        placements = {
            transform.child_frame_id.removeprefix(prefix): _placement(transform)
            for transform in message.transforms
            if transform.child_frame_id.startswith(prefix)
        }
        if source_time_ns < self.source_time_ns:
            self.trail.clear()  # a replay jumped back
        self.link_placements, self.source_time_ns = placements, source_time_ns
        self.dated_by = dated_by
        if _TOOL in placements:
            self._extend_trail(placements[_TOOL][:3, 3], source_time_ns)
        # Compared with the placements of the last version, so that slow movement is noticed too.
        if not _same(placements, self._noticed):
            self._noticed = placements
            self.moved_at = time.monotonic()
            self.version += 1

    def _extend_trail(self, tool: FloatArray, now_ns: int) -> None:
        trail = self.trail
        while trail and now_ns - trail[0][0] > _TRAIL_S * 1e9:
            trail.popleft()
        if not trail or now_ns - trail[-1][0] >= _TRAIL_S * 1e9 / _TRAIL_POINTS:
            trail.append((now_ns, tool))

    def update_joints(self, message: JointStates) -> None:
        """Store newer joint positions; only the frames that belong to them change the picture."""
        self.positions = {joint.name: joint.position for joint in message.joints}

    def update_controller(self, message: ControllerState) -> None:
        """Store a newer controller state."""
        if _state_words(message) != _state_words(self.controller):
            self.version += 1
        self.controller = message

    def update_kinematics(self, message: KinematicState, robots: Mapping[str, "RobotState"]) -> None:
        """Store newer kinematics.

        Args:
            robots: The site's robots by name; their descriptions have the warning and stop distances.
        """
        clearance_line = None
        if message.HasField("clearance"):
            # <site>/<robot>/<link>, or a fixture's <site>/<fixture>.
            frames = (message.clearance.first, message.clearance.second)
            ends = {frame.partition("/")[2].partition("/")[0] for frame in frames}
            appearances = [robot.appearance for name, robot in robots.items() if name in ends]
            clearance_line = line_of(
                message.clearance,
                [appearance.description for appearance in appearances if appearance is not None],
            )
        touching = self._touching(message)
        # The other body may move while the arm does not.
        if not same_line(clearance_line, self.clearance_line) or touching != self.touching:
            self.version += 1
        self.clearance_line, self.touching = clearance_line, touching

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
    """Time since each topic's last new value was received [s]; None: none was received live."""

    frames: float | None
    joints: float | None
    controller: float | None
    kinematics: float | None = None


def age_s(state: RobotState, ages: Ages) -> float:
    """Return the age of the robot state that a picture shows [s]; infinite if unknown.

    The age reported by the gateway counts too: the gateway's last unit may be older than the message that
    reports it.
    """
    if ages.frames is None or ages.joints is None:
        reported = _reported_age(state, ages)
        return math.inf if reported is None else max(reported, state.stale_after_s * 1.001)
    return max(ages.frames, ages.joints, _reported_age(state, ages) or 0.0)


def _reported_age(state: RobotState, ages: Ages) -> float | None:
    controller = state.controller
    if controller is None or not controller.HasField("last_unit_age_s") or ages.controller is None:
        return None
    if controller.link == ControllerState.UP:
        # This message is up to a second old while units keep arriving: the age of the joints counts instead.
        return controller.last_unit_age_s
    return controller.last_unit_age_s + ages.controller


def current_clearance_line(state: RobotState, ages: Ages) -> ClearanceLine | None:
    """Return the line to the nearest body; None if the clearance is unknown or out of date."""
    return state.clearance_line if _clearance_is_current(state, ages) else None


def current_contacts(state: RobotState, ages: Ages) -> frozenset[str]:
    """Return the links in contact; empty if the clearance is out of date."""
    return state.touching if _clearance_is_current(state, ages) else frozenset()


def is_stale(state: RobotState, ages: Ages) -> bool:
    """Return whether the robot's placements are stale."""
    return age_s(state, ages) > state.stale_after_s


def _clearance_is_current(state: RobotState, ages: Ages) -> bool:
    known = ages.kinematics is not None and ages.kinematics <= state.stale_after_s
    return known and not is_stale(state, ages)


def _same(some: dict[str, FloatArray], others: dict[str, FloatArray]) -> bool:
    return some.keys() == others.keys() and all(
        np.abs(placement - others[name]).max() < _NOTICEABLE for name, placement in some.items()
    )


def current_placements(state: RobotState, appearance: Appearance) -> dict[str, FloatArray]:
    """Return (4, 4) link to site of every link; at home until frames are received."""
    return state.link_placements or home_placements(appearance)


def overlay_of(state: RobotState, appearance: Appearance, view: str, *, age: float) -> Overlay:
    """Return the texts over a picture of a robot.

    Args:
        age: Age of the state that it shows [s].
    """
    description = appearance.description
    return Overlay(
        title=state.name,
        view=view,
        time=_time(state.source_time_ns, dated=description.HasField("replay")),
        state=_state_words(state.controller),
        rows=tuple(
            _row(joint, state.positions[joint.name]) for joint in _joints_with_positions(description, state)
        ),
        marks=_marks(description),
        scale="" if appearance.floor is None else f"{appearance.square_m * 1e3:g} mm",
        stale=_stale_words(state, age),
    )


def warning_overlay(state: RobotState, *, age: float) -> Overlay:
    """Return the texts that even a small picture must show; no numbers, as it may be viewed much later."""
    stale = "STALE" if age > state.stale_after_s else ""
    if not state.link_placements:
        stale = "NO DATA"
    replay = state.appearance is not None and state.appearance.description.HasField("replay")
    marks = ("replay",) if replay else ()
    return Overlay(title="", view="", time="", state="", rows=(), marks=marks, stale=stale)


def _marks(description: Description) -> tuple[str, ...]:
    marks = {"replay": description.HasField("replay"), "simulated": description.simulated}
    return tuple(mark for mark, holds in marks.items() if holds)


def _joints_with_positions(description: Description, state: RobotState) -> list[Description.Joint]:
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
        link = enum_word(ControllerState.Link, controller.link)
        return f"controller {link}"
    words = [activity_words(controller), enum_word(ControllerState.Mode, controller.mode)]
    known = [word for word in words if not word.endswith(("unknown", "unspecified"))]
    if controller.HasField("stop"):
        known.insert(0, "stop request latched")
    return ", ".join(dict.fromkeys(known))


def _time(source_time_ns: int, *, dated: bool) -> str:
    if not source_time_ns:
        return ""
    local = datetime.fromtimestamp(source_time_ns * 1e-9, tz=UTC).astimezone()
    date, _, time = local.isoformat(" ", "milliseconds").partition(" ")
    return f"{f'{date} ' if dated else ''}{time[:10]}{time[12:]}"  # tenths


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
