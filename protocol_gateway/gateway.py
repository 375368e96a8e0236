"""The gateway service: publishes and controls robots with legacy controllers. One process serves many."""

import asyncio
import gc
import logging
from collections.abc import Mapping
from contextlib import AsyncExitStack
from functools import partial

from protocol_gateway.cells.gateway_cells import GatewayCells
from protocol_gateway.checking.cell_occupancy import CellOccupancy
from protocol_gateway.checking.checker import make_checkers
from protocol_gateway.checking.policy import Policy
from protocol_gateway.configuration.settings import RobotSettings, Settings, check
from protocol_gateway.link.metrics import measure_links
from protocol_gateway.robot.parts import CellCheck
from protocol_gateway.robot.robot import Robot
from protocol_gateway.telemetry.signals import measure_signals
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import Event
from robomesh.service.loop_turns import turns_of
from robomesh.wire.session import Session

__all__ = ["RobotSettings", "Settings", "serve"]

log = logging.getLogger(__name__)


async def serve(session: Session, settings: Settings) -> None:
    """Serve the robots until cancelled; then stop motion under a lease.

    Raises:
        GatewaySettingsError, DescriptionError, CodeTableError, AuditError, KeyNameError: If a robot's
            settings cannot be used; the text names the robot.
    """
    check(settings)
    async with AsyncExitStack() as stack:
        robots = []
        surroundings = {robot.name: robot.surroundings for robot in settings.robots}
        # Separate processes, so that planning a long program delays no motion.
        checked = [robot.name for robot in settings.robots if robot.check != Policy.OFF]
        checkers = make_checkers(surroundings, start_now=checked)
        planners = make_checkers(surroundings)
        cells: dict[frozenset[str], CellOccupancy] = {}
        for each in settings.robots:
            path = settings.audit_folder / settings.site / f"{each.name}.jsonl"
            names = frozenset(robot.name for robot in each.surroundings.robots)
            robot = Robot(
                session,
                settings.site,
                each,
                audit_path=path,
                rotate_bytes=settings.audit_rotate_bytes,
                cell_check=CellCheck(
                    checker=checkers[each.name],
                    planner=planners[each.name],
                    occupancy=cells.setdefault(names, CellOccupancy()),
                ),
            )
            stack.push_async_callback(robot.close)
            robots.append(robot)
            log.info("%s: controller at %s:%d", each.name, each.host, each.port)
        by_name = {robot.name: each for robot, each in zip(settings.robots, robots, strict=True)}
        measure_links(session, {name: each.link for name, each in by_name.items()})
        measure_signals(session, {name: each.signals for name, each in by_name.items()})
        _measure_robots(session, by_name)
        content = GatewayCells(session, settings, by_name, cells, (checkers, planners))
        # A collection over all permanent objects would pause every robot for 20 ms.
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        await asyncio.sleep(0)  # the start itself is a long turn
        turns_of(asyncio.get_running_loop()).on_long = partial(_report_long_turn, by_name)
        async with asyncio.TaskGroup() as tasks:
            for checker in {*checkers.values(), *planners.values()}:
                tasks.create_task(checker.run())
            for robot in robots:
                tasks.create_task(robot.run())
            tasks.create_task(content.run())


def _report_long_turn(robots: Mapping[str, Robot], took_s: float, what: object) -> None:
    """Report a long turn at the robot with the controller that caused it, or at the first one."""
    robot = next((name for name, each in robots.items() if each.link is what), "")
    work = f"the controller of {robot}" if robot else what
    reason = codes.GATEWAY_OCCUPIED(work=work, seconds=took_s)
    at = robots[robot] if robot else next(iter(robots.values()))
    at.journal.report(Event.WARNING, reason.code, reason.text, why=reason, seconds=f"{took_s:.3f}")


def _measure_robots(session: Session, robots: Mapping[str, Robot]) -> None:
    """Register the metrics of each robot."""
    session.measure(
        "stopped",
        "Whether a stop is latched",
        lambda: {name: float(each.stopped) for name, each in robots.items()},
    )
    session.measure(
        "joints_stale",
        "Whether the joint positions are missing or stale",
        lambda: {name: float(not each.has_current_joints) for name, each in robots.items()},
    )
