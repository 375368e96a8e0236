"""Publishers of `frames`, `kinematics` and `events/kinematics`, driven by incoming joint states only."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh.errors import MessageError
from robomesh.keys import robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from robots.collision import Cell, distances
from robots.joints import FloatArray
from robots.model import RobotModel
from services.kinematics.alarms import Alarms, Condition
from services.kinematics.cell_state import CellState, Proximity
from services.kinematics.conditions import (
    limit_conditions,
    missing_conditions,
    outside_conditions,
    own_conditions,
    singularity_conditions,
)
from services.kinematics.floor import floor_event
from services.kinematics.shown_cell import ShownCell
from services.kinematics.states import (
    FramesMessage,
    add_proximity,
    kinematic_state,
    positions_by_name,
    velocities_by_name,
)

log = logging.getLogger(__name__)

# Velocities are not computed from an older previous state.
_LONGEST_DIFFERENCE_S = 0.5
# Rate at which `frames` repeats the fixtures, which do not move.
_FIXTURES_HZ = 1.0

_LEVELS = {
    schema.Event.INFO: logging.INFO,
    schema.Event.WARNING: logging.WARNING,
    schema.Event.ERROR: logging.ERROR,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class FollowedArm:
    """An arm and the constants needed to publish its state.

    Attributes:
        reach: Result of `robots.singularity.reach_of` [m].
        base_to_site: (4, 4) placement of the base in the site's frame.
    """

    site: str
    name: str
    model: RobotModel
    reach: float
    base_to_site: FloatArray

    @property
    def path(self) -> str:
        """<site>/<robot>."""
        return f"{self.site}/{self.name}"


async def follow(session: Session, arm: FollowedArm, cell_state: CellState, shown: ShownCell) -> None:
    """Publish an arm's frames, kinematic state and events, until cancelled.

    Args:
        cell_state: State of its cell; receives each state that is processed.
        shown: Content of its cell; until its hulls are built no clearance is published.
    """
    frames = session.declare_publisher(arm.site, arm.name, "frames")
    kinematics = session.declare_publisher(arm.site, arm.name, "kinematics")
    events = session.declare_publisher(arm.site, arm.name, "events/kinematics")
    frames_limit, kinematics_limit = _RateLimit(frames.topic.rate_hz), _RateLimit(kinematics.topic.rate_hz)
    fixtures_limit = _RateLimit(_FIXTURES_HZ)
    frames_message = FramesMessage(arm.model, prefix=arm.path, base_to_site=arm.base_to_site)
    alarms = Alarms()
    before: tuple[int, FloatArray] | None = None
    mismatch_log = _MismatchLog(arm)
    floor_reported: Cell | None = None
    placed: object = None
    async for sample in session.subscribe(robot_key(arm.site, arm.name, "joints")):
        time_ns, dated_by = sample.header.source_time_ns, sample.header.publisher
        frames_due, kinematics_due = frames_limit.due(time_ns), kinematics_limit.due(time_ns)
        now = shown.now
        if not (frames_due or kinematics_due):
            continue
        try:
            message = sample.message()
        except MessageError:
            continue
        assert isinstance(message, JointStates)
        positions = positions_by_name(arm.model.joints, message)
        mismatch_log.update(None if positions is not None else message)
        if positions is None:
            continue
        if sample.live:
            cell_state.update(arm.name, positions)
        if frames_due:
            with_fixtures = fixtures_limit.due(time_ns) or placed is not now.fixtures
            fixtures = now.placements if with_fixtures else {}
            transforms = frames_message.filled(positions, message.timestamp, fixtures)
            placed = now.fixtures
            if not sample.live:
                # A last value: answer late joiners with it. Published, it would look live.
                frames.remember(transforms, source_time_ns=time_ns)
                continue
            frames.put(transforms, source_time_ns=time_ns, dated_by=dated_by)
        if not (sample.live and kinematics_due):
            continue
        velocities = velocities_by_name(arm.model.joints, message)
        if velocities is None:
            velocities = _difference(before, time_ns, positions)
        before = time_ns, positions
        state, proximity = _state(arm, cell_state, now.built, positions, velocities, message.timestamp)
        kinematics.put(state, source_time_ns=time_ns, dated_by=dated_by)
        # Unproven joints may be elsewhere: alarms about them would be invented.
        conditions = () if state.joints_unproven else _conditions(arm, now.built, positions, state, proximity)
        found = alarms.judge(conditions, sample.received)
        if now.built is not None and floor_reported is not now.built:
            floor_reported = now.built
            poses = {"at home": arm.model.joints.home, "where it is now": positions}
            if (below_floor := floor_event(now.built, arm.name, poses)) is not None:
                found.append(below_floor)
        for event in found:
            event.timestamp.CopyFrom(message.timestamp)
            events.put(event, source_time_ns=time_ns, dated_by=dated_by)
            log.log(_LEVELS[event.severity], "%s: %s", arm.path, event.text)


async def follow_proof(session: Session, arm: FollowedArm, cell_state: CellState) -> None:
    """Keep in a cell's state whether an arm's joints are unproven, until cancelled."""
    async for sample in session.subscribe(robot_key(arm.site, arm.name, "controller")):
        try:
            message = sample.message()
        except MessageError:
            continue
        assert isinstance(message, schema.ControllerState)
        cell_state.update_proof(arm.name, unproven=message.joints_unproven)


def _state(
    arm: FollowedArm,
    cell_state: CellState,
    built: Cell | None,
    positions: FloatArray,
    velocities: FloatArray | None,
    timestamp: Timestamp,
) -> tuple[schema.KinematicState, Proximity | None]:
    """Return the `kinematics` message and the clearances.

    The latter are None until the hulls are built, and for an arm whose joints are unproven.
    """
    state = kinematic_state(arm.model, positions, velocities, reach=arm.reach, timestamp=timestamp)
    state.joints_unproven = cell_state.is_unproven(arm.name)
    if built is None or state.joints_unproven:
        return state, None
    proximity = cell_state.proximity(built, arm.name, positions)
    add_proximity(state, proximity, site=arm.site)
    return state, proximity


def _conditions(
    arm: FollowedArm,
    built: Cell | None,
    positions: FloatArray,
    state: schema.KinematicState,
    proximity: Proximity | None,
) -> Iterator[Condition]:
    """Yield the alarm conditions of a state."""
    yield from limit_conditions(arm.model.joints, positions)
    yield from singularity_conditions(state.singularity_margin)
    if proximity is not None and built is not None:
        yield from own_conditions(proximity.own)
        yield from outside_conditions(proximity.close, partial(distances, built))
        yield from missing_conditions(proximity.not_counted)


class _MismatchLog:
    """Warning about joint states that do not match an arm, logged once until they match again."""

    def __init__(self, arm: FollowedArm) -> None:
        self._arm = arm
        self._logged = False

    def update(self, message: JointStates | None) -> None:
        if message is not None and not self._logged:
            log.warning(
                "%s: joint states do not match its description (%s); frames are not published until they do",
                self._arm.path,
                ", ".join(joint.name for joint in message.joints),
            )
        self._logged = message is not None


def _difference(
    before: tuple[int, FloatArray] | None, time_ns: int, positions: FloatArray
) -> FloatArray | None:
    """Return joint velocities (n,) from two states, or None without a recent previous state."""
    if before is None:
        return None
    seconds = (time_ns - before[0]) * 1e-9
    if not 0 < seconds <= _LONGEST_DIFFERENCE_S:
        return None
    difference: FloatArray = (positions - before[1]) / seconds
    return difference


class _RateLimit:
    """Rate limit of a topic, by source time."""

    def __init__(self, rate_hz: float | None) -> None:
        # A tenth of tolerance for jitter: without it, 100 Hz would be thinned to 33 Hz instead of 50 Hz.
        self._interval_ns = int(0.9e9 / rate_hz) if rate_hz else 0
        self._last_ns = -self._interval_ns

    def due(self, time_ns: int) -> bool:
        if 0 <= time_ns - self._last_ns < self._interval_ns:
            return False
        self._last_ns = time_ns
        return True
