"""Joint states to `frames`, `kinematics` and `events/kinematics`, as they come; nothing when none come."""

import asyncio
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
from services.kinematics.cell_state import Near, Place
from services.kinematics.conditions import (
    limit_conditions,
    missing_conditions,
    outside_conditions,
    own_conditions,
    singularity_conditions,
)
from services.kinematics.floor import floor_event
from services.kinematics.states import (
    add_near,
    frames_message,
    kinematic_state,
    positions_by_name,
    velocities_by_name,
)

log = logging.getLogger(__name__)

# Older than this, the last state tells nothing of the speed.
_LONGEST_DIFFERENCE_S = 0.5
# What does not move is told so often beside what does.
_FIXTURES_HZ = 1.0

_LEVELS = {
    schema.Event.INFO: logging.INFO,
    schema.Event.WARNING: logging.WARNING,
    schema.Event.ERROR: logging.ERROR,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Followed:
    """An arm that is followed.

    Attributes:
        reach: As `robots.singularity.reach_of` has it [m].
        base_to_site: (4, 4).
        fixtures: (4, 4) in the site's frame of what stands in its cell, by name.
    """

    site: str
    name: str
    model: RobotModel
    reach: float
    base_to_site: FloatArray
    fixtures: dict[str, FloatArray]

    @property
    def path(self) -> str:
        """<site>/<robot>."""
        return f"{self.site}/{self.name}"


async def follow(session: Session, arm: Followed, place: Place, built: asyncio.Task[Cell]) -> None:
    """Tell where an arm is and how near to things, until cancelled.

    Args:
        place: Of its cell; told of every state that is looked at.
        built: The cell's hulls, some time: until then nothing is told of clearance.
    """
    frames = session.declare_publisher(arm.site, arm.name, "frames")
    kinematics = session.declare_publisher(arm.site, arm.name, "kinematics")
    events = session.declare_publisher(arm.site, arm.name, "events/kinematics")
    frames_pace, kinematics_pace = _Pace(frames.topic.rate_hz), _Pace(kinematics.topic.rate_hz)
    fixtures_pace = _Pace(_FIXTURES_HZ)
    alarms = Alarms()
    before: tuple[int, FloatArray] | None = None
    misfit = _Misfit(arm)
    floor_told = False
    async for sample in session.subscribe(robot_key(arm.site, arm.name, "joints")):
        time_ns, dated_by = sample.header.source_time_ns, sample.header.publisher
        frames_due, kinematics_due = frames_pace.due(time_ns), kinematics_pace.due(time_ns)
        if not (frames_due or kinematics_due):
            continue
        try:
            message = sample.message()
        except MessageError:
            continue
        assert isinstance(message, JointStates)
        positions = positions_by_name(arm.model.joints, message)
        misfit.say_once(None if positions is not None else message)
        if positions is None:
            continue
        if sample.live:
            place.take(arm.name, positions)
        if frames_due:
            transforms = frames_message(
                arm.model,
                positions,
                prefix=arm.path,
                base_to_site=arm.base_to_site,
                timestamp=message.timestamp,
                fixtures=arm.fixtures if fixtures_pace.due(time_ns) else {},
            )
            if not sample.live:
                # Where the arm was last; published, it would look as if it came from the arm now.
                frames.remember(transforms, source_time_ns=time_ns)
                continue
            frames.put(transforms, source_time_ns=time_ns, dated_by=dated_by)
        if not (sample.live and kinematics_due):
            continue
        velocities = velocities_by_name(arm.model.joints, message)
        if velocities is None:
            velocities = _difference(before, time_ns, positions)
        before = time_ns, positions
        state, near = _state(arm, place, built, positions, velocities, message.timestamp)
        kinematics.put(state, source_time_ns=time_ns, dated_by=dated_by)
        found = alarms.judge(_conditions(arm, built, positions, state, near), sample.received)
        if built.done() and not floor_told:
            floor_told = True
            poses = {"at home": arm.model.joints.home, "where it is now": positions}
            if (listed := floor_event(built.result(), arm.name, poses)) is not None:
                found.append(listed)
        for event in found:
            event.timestamp.CopyFrom(message.timestamp)
            events.put(event, source_time_ns=time_ns, dated_by=dated_by)
            log.log(_LEVELS[event.severity], "%s: %s", arm.path, event.text)


def _state(
    arm: Followed,
    place: Place,
    built: asyncio.Task[Cell],
    positions: FloatArray,
    velocities: FloatArray | None,
    timestamp: Timestamp,
) -> tuple[schema.KinematicState, Near | None]:
    """What `kinematics` tells, and what of it is near; None: hulls are still being built."""
    state = kinematic_state(arm.model, positions, velocities, reach=arm.reach, timestamp=timestamp)
    if not built.done():
        return state, None
    near = place.near(built.result(), arm.name, positions)
    add_near(state, near, site=arm.site)
    return state, near


def _conditions(
    arm: Followed,
    built: asyncio.Task[Cell],
    positions: FloatArray,
    state: schema.KinematicState,
    near: Near | None,
) -> Iterator[Condition]:
    """What of a state is worth an event."""
    yield from limit_conditions(arm.model.joints, positions)
    yield from singularity_conditions(state.singularity_margin)
    if near is not None:
        yield from own_conditions(near.own)
        yield from outside_conditions(near.close, partial(distances, built.result()))
        yield from missing_conditions(near.not_counted)


class _Misfit:
    """Says once that joint states do not fit an arm, until they do."""

    def __init__(self, arm: Followed) -> None:
        self._arm = arm
        self._said = False

    def say_once(self, message: JointStates | None) -> None:
        if message is not None and not self._said:
            log.warning(
                "%s: joint states that do not fit its description (%s): no frames until they do",
                self._arm.path,
                ", ".join(joint.name for joint in message.joints),
            )
        self._said = message is not None


def _difference(
    before: tuple[int, FloatArray] | None, time_ns: int, positions: FloatArray
) -> FloatArray | None:
    """Joint velocities from two states (n,); None: there is no state, or none young enough."""
    if before is None:
        return None
    seconds = (time_ns - before[0]) * 1e-9
    if not 0 < seconds <= _LONGEST_DIFFERENCE_S:
        return None
    difference: FloatArray = (positions - before[1]) / seconds
    return difference


class _Pace:
    """Lets pass what keeps a topic within its rate, by source time."""

    def __init__(self, rate_hz: float | None) -> None:
        # A state a hair early is as good: without the tenth, 100 Hz would thin to 33 instead of 50.
        self._interval_ns = int(0.9e9 / rate_hz) if rate_hz else 0
        self._last_ns = -self._interval_ns

    def due(self, time_ns: int) -> bool:
        if 0 <= time_ns - self._last_ns < self._interval_ns:
            return False
        self._last_ns = time_ns
        return True
