"""Kinematics service of a site: starts the cells' and robots' tasks."""

import asyncio
import gc
import logging
import time
from collections.abc import Sequence

from robomesh.quotas import Quota
from robomesh.session import Session
from robomesh.worker import Worker
from robots.cells import CellDescription
from robots.collision import Cell, build_cell
from robots.description import load
from robots.glb import link_meshes, main_colors
from robots.model import build_model
from robots.singularity import reach_of
from robots.urdf.write import to_urdf
from services.kinematics.answers import Workers, answer_robot_requests
from services.kinematics.cell_state import CellState
from services.kinematics.descriptions import FixtureMesh, add_surroundings, describe, fixture_meshes
from services.kinematics.publisher import FollowedArm, follow
from services.kinematics.settings import RobotSettings, Settings

log = logging.getLogger(__name__)

_WORKER = "services.kinematics.worker"
# Live states have priority over requests on a busy machine.
_NICE = 5


async def serve(session: Session, settings: Settings) -> None:
    """Publish descriptions, frames and kinematic states, and answer requests, until cancelled.

    Raises:
        RobotError: If a description or a mesh is invalid.
    """
    cells = tuple({id(robot.cell_description): robot.cell_description for robot in settings.robots}.values())
    workers = Workers(Worker(_WORKER, cells, nice=_NICE), Worker(_WORKER, cells, nice=_NICE))
    quotas = settings.quotas
    checks = Quota("checks", at_once=quotas.checks, a_minute=quotas.checks_a_minute)
    try:
        async with asyncio.TaskGroup() as group:
            for cell in cells:
                robots = [robot for robot in settings.robots if robot.cell_description is cell]
                group.create_task(_serve_cell(session, settings.site, cell, robots, workers, checks))
    finally:
        gc.unfreeze()
        await workers.close()


async def _serve_cell(
    session: Session,
    site: str,
    cell: CellDescription,
    robots: Sequence[RobotSettings],
    workers: Workers,
    checks: Quota,
) -> None:
    cell_state = CellState({robot.name: robot.stale_after_s for robot in robots}, time.monotonic)
    fixtures = await asyncio.to_thread(fixture_meshes, cell)
    async with asyncio.TaskGroup() as group:
        # Building hulls takes seconds; descriptions and frames do not wait for it.
        built = group.create_task(asyncio.to_thread(build_cell, cell))
        for robot in robots:
            group.create_task(
                _serve_robot(session, site, robot, cell_state, built, fixtures, workers, checks)
            )
        await built
        # Hulls live as long as the service; without this each full garbage collection would take 0.2 s.
        gc.freeze()


async def _serve_robot(
    session: Session,
    site: str,
    settings: RobotSettings,
    cell_state: CellState,
    built: asyncio.Task[Cell],
    fixtures: Sequence[FixtureMesh],
    workers: Workers,
    checks: Quota,
) -> None:
    (robot,) = (each for each in settings.cell_description.robots if each.name == settings.name)
    description = load(robot.model, confined=robot.confined)
    model = build_model(description)
    meshes = await asyncio.to_thread(link_meshes, description)
    answer_robot_requests(
        session,
        site,
        robot.name,
        model=model,
        meshes=meshes | {each.name: each.glb for each in fixtures},
        cell_state=cell_state,
        workers=workers,
        checks=checks,
    )
    message = describe(
        description,
        urdf=to_urdf(description, colors=main_colors(meshes)),
        meshes=meshes,
        base_to_site=robot.base_to_site,
        cell=settings.cell,
        simulated=settings.simulated,
    )
    add_surroundings(message, robot, settings.cell_description, fixtures)
    message.stale_after_s = settings.stale_after_s
    session.declare_publisher(site, robot.name, "description").put(message)
    log.info("%s/%s: %s, %d joints", site, robot.name, description.title, len(model.joints))
    arm = FollowedArm(
        site=site,
        name=robot.name,
        model=model,
        reach=reach_of(description),
        base_to_site=robot.base_to_site,
        fixtures={each.fixture.name: each.fixture.fixture_to_site for each in fixtures},
    )
    await follow(session, arm, cell_state, built)
