"""Publishers of `frames`, `kinematics` and `events/kinematics`, driven by incoming joint states only."""

import asyncio
import contextlib
import logging
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh.contract.keys import ROOT, robot_key
from robomesh.errors import MessageError
from robomesh.publications.subscription import Sample
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from robots.collision import Cell, distances
from robots.kinematics.joints import FloatArray
from robots.kinematics.model import RobotModel
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
    StateMessage,
    add_proximity,
    positions_by_name,
    velocities_by_name,
)

log = logging.getLogger(__name__)

# Smaller changes of a joint [rad] or [m] are the noise of its encoder, below the repeatability of an arm: the
# last computed positions stay, so an arm at rest is computed once.
_NOISE = 4e-5
# Velocities are not computed from an older previous state.
_LONGEST_DIFFERENCE_S = 0.5
# Rate at which `frames` repeats the fixtures, which do not move.
_FIXTURES_HZ = 1.0
# States that arrive within this time are processed together, because each wake costs as much as a
# state. The states of one arm are farther apart.
_TOGETHER_S = 0.0015
# Samples of each arm that may wait while others are processed.
_NEWEST_EACH = 8

_LEVELS = {
    schema.Event.INFO: logging.INFO,
    schema.Event.WARNING: logging.WARNING,
    schema.Event.ERROR: logging.ERROR,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class FollowedArm:
    """An arm and the constants needed to publish its state.

    Attributes:
        reach: Result of `robots.kinematics.singularity.arm_length` [m].
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


class ArmPublisher:
    """Publisher of an arm's frames, kinematic state and events.

    Args:
        cell_state: State of its cell; receives each state that is processed.
        shown: Content of its cell; until its hulls are built no clearance is published.
    """

    def __init__(self, session: Session, arm: FollowedArm, cell_state: CellState, shown: ShownCell) -> None:
        self._arm, self._cell_state, self._shown = arm, cell_state, shown
        self._frames = session.declare_publisher(arm.site, arm.name, "frames", together=True)
        self._kinematics = session.declare_publisher(arm.site, arm.name, "kinematics", together=True)
        self._events = session.declare_publisher(arm.site, arm.name, "events/kinematics")
        self._frames_limit = _RateLimit(self._frames.topic.rate_hz)
        self._kinematics_limit = _RateLimit(self._kinematics.topic.rate_hz)
        self._fixtures_limit = _RateLimit(_FIXTURES_HZ)
        self._frames_message = FramesMessage(arm.model, prefix=arm.path, base_to_site=arm.base_to_site)
        self._state_message = StateMessage(arm.model, reach=arm.reach)
        self._placed_at: FloatArray | None = None
        self._alarms = Alarms()
        self._before: tuple[int, FloatArray] | None = None
        self._due: tuple[Sample, FloatArray, FloatArray, JointStates] | None = None
        self._mismatch_log = _MismatchLog(arm)
        self._floor_reported: Cell | None = None
        self._placed: object = None

    def take(self, sample: Sample) -> None:
        """Take a sample of the arm's `joints`, and publish due frames, or one of its `controller`."""
        with contextlib.suppress(MessageError):
            if sample.parsed.topic == "controller":
                message = sample.message()
                assert isinstance(message, schema.ControllerState)
                # Unproven joints may not be those of the model.
                self._cell_state.update_proof(self._arm.name, unproven=message.joints_unproven)
            else:
                self._take_joints(sample)

    def _take_joints(self, sample: Sample) -> None:
        time_ns = sample.header.source_time_ns
        frames_due, kinematics_due = self._frames_limit.due(time_ns), self._kinematics_limit.due(time_ns)
        if not (frames_due or kinematics_due):
            return
        message = sample.message()
        assert isinstance(message, JointStates)
        reported = positions_by_name(self._arm.model.joints, message)
        self._mismatch_log.update(None if reported is not None else message)
        if reported is None:
            return
        positions = self._placed_at
        if positions is None or np.abs(reported - positions).max() > _NOISE:
            positions = self._placed_at = reported
        if sample.live:
            self._cell_state.update(self._arm.name, positions)
        if frames_due:
            self._publish_frames(sample, positions, message.timestamp)
        if sample.live and kinematics_due:
            self._due = sample, reported, positions, message

    def publish_state(self) -> None:
        """Publish the state of the last sample that was taken, if it is due."""
        if self._due is not None:
            due, self._due = self._due, None
            self._publish_state(*due)

    def _publish_frames(self, sample: Sample, positions: FloatArray, timestamp: Timestamp) -> None:
        now, time_ns = self._shown.now, sample.header.source_time_ns
        with_fixtures = self._fixtures_limit.due(time_ns) or self._placed is not now.fixtures
        transforms = self._frames_message.filled(
            positions, timestamp, now.placements if with_fixtures else {}
        )
        self._placed = now.fixtures
        if sample.live:
            self._frames.put(transforms, source_time_ns=time_ns, dated_by=sample.header.publisher)
        else:
            # A last value: answer late joiners with it. Published, it would look live.
            self._frames.remember(transforms, source_time_ns=time_ns)

    def _publish_state(
        self, sample: Sample, reported: FloatArray, positions: FloatArray, message: JointStates
    ) -> None:
        arm, built = self._arm, self._shown.now.built
        time_ns, dated_by = sample.header.source_time_ns, sample.header.publisher
        velocities = velocities_by_name(arm.model.joints, message)
        if velocities is None:
            velocities = _difference(self._before, time_ns, reported)
        self._before = time_ns, reported
        state = self._state_message.filled(positions, velocities, message.timestamp)
        proximity = self._add_cell(state, built, positions)
        self._kinematics.put(state, source_time_ns=time_ns, dated_by=dated_by)
        # Unproven joints may be elsewhere: alarms about them would be invented.
        conditions = () if state.joints_unproven else _conditions(arm, built, positions, state, proximity)
        found = self._alarms.judge(conditions, sample.received)
        if built is not None and self._floor_reported is not built:
            self._floor_reported = built
            poses = {"at home": arm.model.joints.home, "where it is now": positions}
            if (below_floor := floor_event(built, arm.name, poses)) is not None:
                found.append(below_floor)
        for event in found:
            event.timestamp.CopyFrom(message.timestamp)
            self._events.put(event, source_time_ns=time_ns, dated_by=dated_by)
            log.log(_LEVELS[event.severity], "%s: %s", arm.path, event.text)

    def _add_cell(
        self, state: schema.KinematicState, built: Cell | None, positions: FloatArray
    ) -> Proximity | None:
        """Add to a state whether its joints are unproven, and the clearances, and return these.

        They are None until the hulls are built, and for an arm whose joints are unproven.
        """
        name = self._arm.name
        state.joints_unproven = self._cell_state.is_unproven(name)
        if built is None or state.joints_unproven:
            return None
        proximity = self._cell_state.proximity(built, name, positions)
        add_proximity(state, proximity, site=self._arm.site)
        return proximity


class ArmPublishers:
    """The publishers of a site's arms, which start one after the other.

    One subscription for all arms wakes the event loop less often; of a backlog the newest states are taken.

    Args:
        arms: Names of the arms.
    """

    def __init__(self, site: str, arms: Collection[str]) -> None:
        self._site, self._names = site, frozenset(arms)
        self._publishers: dict[str, ArmPublisher] = {}
        # Of arms that have not started: the newest sample of each key.
        self._early: dict[str, Sample] = {}

    def add(self, name: str, publisher: ArmPublisher) -> None:
        """Start an arm with what has arrived."""
        self._publishers[name] = publisher
        for key in (robot_key(self._site, name, "controller"), robot_key(self._site, name, "joints")):
            if (sample := self._early.pop(key, None)) is not None:
                publisher.take(sample)
                publisher.publish_state()

    async def follow(self, session: Session, topic: str) -> None:
        """Deliver `joints` or `controller` of all arms until cancelled."""
        newest = _NEWEST_EACH * max(1, len(self._names))
        expression = f"{ROOT}/{self._site}/*/{topic}"
        subscription = session.subscribe(expression, newest=newest)
        while samples := await subscription.next_batch(pause_s=_TOGETHER_S):
            taken = []
            for key, sample in {sample.key: sample for sample in samples}.items():
                robot = sample.parsed.robot
                if (publisher := self._publishers.get(robot)) is not None:
                    publisher.take(sample)
                    taken.append(publisher)
                elif robot in self._names:
                    self._early[key] = sample
            # The frames of all arms leave before the states, which take longer.
            await asyncio.sleep(0)
            for publisher in taken:
                publisher.publish_state()


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
