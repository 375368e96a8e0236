"""Kinematics service of a site: starts the cells' and robots' tasks."""

import asyncio
import gc
import logging
import time
from collections.abc import Sequence

from robomesh.contract.quotas import Quota
from robomesh.files.worker import Worker
from robomesh.wire.session import Session
from robots.descriptions.cells import CellDescription
from robots.descriptions.description import load
from robots.descriptions.glb import link_glbs, main_colors
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.model import build_model
from robots.kinematics.singularity import arm_length
from services.kinematics.answers import Workers, answer_robot_requests
from services.kinematics.cell_state import CellState
from services.kinematics.descriptions import add_surroundings, describe
from services.kinematics.publisher import ArmPublisher, ArmPublishers, FollowedArm
from services.kinematics.settings import RobotSettings, Settings
from services.kinematics.shown_cell import ShownCell, first_content, follow_gateway

log = logging.getLogger(__name__)

_WORKER = "services.kinematics.worker.worker"
# Live states have priority over requests on a busy machine.
_NICE = 5


async def serve(session: Session, settings: Settings) -> None:
    """Publish descriptions, frames and kinematic states, and answer requests, until cancelled.

    Raises:
        RobotError: If a description or a mesh is invalid.
    """
    cells = tuple({id(robot.cell_description): robot.cell_description for robot in settings.robots}.values())
    of_robots = {robot.name: cell for cell in cells for robot in cell.robots}
    workers = Workers(
        Worker(_WORKER, of_robots, nice=_NICE), Worker(_WORKER, of_robots, nice=_NICE), of_robots
    )
    shown: dict[str, ShownCell] = {}
    quotas = settings.quotas
    checks = Quota("checks", at_once=quotas.checks, a_minute=quotas.checks_a_minute)
    arms = ArmPublishers(settings.site, [robot.name for robot in settings.robots])
    try:
        async with asyncio.TaskGroup() as group:
            for cell in cells:
                robots = [robot for robot in settings.robots if robot.cell_description is cell]
                group.create_task(_serve_cell(session, settings, cell, robots, workers, checks, shown, arms))
            for topic in ("joints", "controller"):
                group.create_task(arms.follow(session, topic))
            if settings.cell_content is not None:
                group.create_task(follow_gateway(session, settings.site, shown))
    finally:
        gc.unfreeze()
        await workers.close()


async def _serve_cell(
    session: Session,
    settings: Settings,
    cell: CellDescription,
    robots: Sequence[RobotSettings],
    workers: Workers,
    checks: Quota,
    shown: dict[str, ShownCell],
    arms: ArmPublishers,
) -> None:
    cell_state = CellState(
        {robot.name: robot.stale_after_s for robot in robots},
        time.monotonic,
        real={robot.name for robot in robots if not robot.simulated},
    )
    first = await asyncio.to_thread(first_content, cell, settings.cell_content)
    shown_cell = ShownCell(first, settings.cell_content, workers)
    async with asyncio.TaskGroup() as group:
        group.create_task(shown_cell.build())
        for robot in robots:
            group.create_task(
                _serve_robot(session, settings.site, robot, cell_state, shown_cell, workers, checks, arms)
            )
            shown[robot.name] = shown_cell


async def _serve_robot(
    session: Session,
    site: str,
    settings: RobotSettings,
    cell_state: CellState,
    shown: ShownCell,
    workers: Workers,
    checks: Quota,
    arms: ArmPublishers,
) -> None:
    (robot,) = (each for each in settings.cell_description.robots if each.name == settings.name)
    description = load(robot.model, confined=robot.confined)
    model = build_model(description)
    shapes = await asyncio.to_thread(link_glbs, description)
    answer_robot_requests(
        session,
        site,
        robot.name,
        model=model,
        shapes=lambda: shapes | shown.now.shapes,
        cell_state=cell_state,
        workers=workers,
        checks=checks,
    )
    urdf = to_urdf(description, colors=main_colors(shapes))
    publisher = session.declare_publisher(site, robot.name, "description")

    def publish_description() -> None:
        message = describe(
            description,
            urdf=urdf,
            shapes=shapes,
            base_to_site=robot.base_to_site,
            cell=settings.cell,
            simulated=settings.simulated,
        )
        add_surroundings(message, robot, shown.now.description, shown.now.fixtures, shown.now.version)
        message.stale_after_s = settings.stale_after_s
        publisher.put(message)

    shown.serve(session, site, robot.name, publish_description)
    log.info("%s/%s: %s, %d joints", site, robot.name, description.title, len(model.joints))
    arm = FollowedArm(
        site=site,
        name=robot.name,
        model=model,
        reach=arm_length(description),
        base_to_site=robot.base_to_site,
    )
    arms.add(robot.name, ArmPublisher(session, arm, cell_state, shown))
