"""The kinematics service: `description`, `mesh/*`, `frames`, `kinematics`, `kinematics/forward`."""

import asyncio
import logging
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from bus.errors import MessageError, RefusedError
from bus.keys import robot_key
from bus.requests import Request
from bus.schemas import robomesh_pb2 as schema
from bus.session import Session
from robots.description import load
from robots.glb import link_meshes
from robots.joints import FloatArray
from robots.model import RobotModel, build_model
from robots.urdf import to_urdf
from services.kinematics.describe import describe
from services.kinematics.states import (
    forward_answer,
    frames_message,
    kinematic_state,
    positions_by_name,
    velocities_by_name,
)

log = logging.getLogger(__name__)

# Older than this, the last state tells nothing of the speed.
_LONGEST_DIFFERENCE_S = 0.5


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """A robot of the site.

    Attributes:
        model: A library robot, or the path of a description.
        base_to_site: (4, 4).
    """

    name: str
    model: str | Path
    base_to_site: FloatArray = field(default_factory=lambda: np.eye(4))
    cell: str = ""
    simulated: bool = False


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The robots of a site."""

    site: str
    robots: tuple[RobotSettings, ...]


async def serve(session: Session, settings: Settings) -> None:
    """Tell what the robots are and where their parts are, until cancelled.

    Raises:
        RobotError: If a description or a mesh is wrong.
    """
    async with asyncio.TaskGroup() as group:
        for robot in settings.robots:
            group.create_task(_serve_robot(session, settings.site, robot))


async def _serve_robot(session: Session, site: str, settings: RobotSettings) -> None:
    description = load(settings.model)
    model = build_model(description)
    meshes = await asyncio.to_thread(link_meshes, description)

    async def answer_mesh(request: Request) -> bytes:
        if request.chunk not in meshes:
            raise RefusedError(
                f"no mesh {request.chunk!r}; {settings.name} has {', '.join(meshes) or 'none'}"
            )
        return meshes[request.chunk]

    async def answer_forward(request: Request) -> schema.ForwardAnswer:
        asked = request.message
        assert isinstance(asked, schema.ForwardRequest)
        if len(asked.joint_positions) != len(model.joints):
            raise RefusedError(
                f"joint_positions: {len(asked.joint_positions)} given, {settings.name} has "
                f"{len(model.joints)} joints ({', '.join(model.joints.names)})"
            )
        return forward_answer(model, np.array(asked.joint_positions))

    session.answer(site, settings.name, "mesh/*", answer_mesh)
    session.answer(site, settings.name, "kinematics/forward", answer_forward)
    session.declare_publisher(site, settings.name, "description").put(
        describe(
            description,
            model,
            urdf=to_urdf(description),
            meshes=meshes,
            base_to_site=settings.base_to_site,
            cell=settings.cell,
            simulated=settings.simulated,
        )
    )
    log.info("%s/%s: %s, %d joints", site, settings.name, description.title, len(model.joints))
    await _follow(session, site, settings, model)


async def _follow(session: Session, site: str, settings: RobotSettings, model: RobotModel) -> None:
    """Publish frames and kinematics from the newest joint states; nothing when none come."""
    frames = session.declare_publisher(site, settings.name, "frames")
    kinematics = session.declare_publisher(site, settings.name, "kinematics")
    states = session.subscribe(robot_key(site, settings.name, "joints"))
    frames_pace, kinematics_pace = _Pace(frames.topic.rate_hz), _Pace(kinematics.topic.rate_hz)
    before: tuple[int, FloatArray] | None = None
    told = False
    async for sample in states:
        try:
            message = sample.message()
        except MessageError:
            continue
        assert isinstance(message, JointStates)
        positions = positions_by_name(model.joints, message)
        if positions is None:
            if not told:
                log.warning(
                    "%s/%s: joint states that do not fit its description (%s): no frames until they do",
                    site,
                    settings.name,
                    ", ".join(joint.name for joint in message.joints),
                )
                told = True
            continue
        told = False
        time_ns = sample.header.source_time_ns
        if frames_pace.due(time_ns):
            transforms = frames_message(
                model,
                positions,
                prefix=f"{site}/{settings.name}",
                base_to_site=settings.base_to_site,
                timestamp=message.timestamp,
            )
            if not sample.live:
                # Where the arm was last; published, it would look as if it came from the arm now.
                frames.remember(transforms, source_time_ns=time_ns)
                continue
            frames.put(transforms, source_time_ns=time_ns)
        if sample.live and kinematics_pace.due(time_ns):
            velocities = velocities_by_name(model.joints, message)
            if velocities is None:
                velocities = _difference(before, time_ns, positions)
            kinematics.put(
                kinematic_state(model, positions, velocities, timestamp=message.timestamp),
                source_time_ns=time_ns,
            )
            before = time_ns, positions


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
