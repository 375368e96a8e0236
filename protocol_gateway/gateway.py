"""The gateway service: robots with legacy controllers, on the mesh. One process serves many."""

import asyncio
import logging
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path

from bus.keys import check_name
from bus.session import Session
from protocol_gateway.errors import GatewaySettingsError
from protocol_gateway.robot import Robot, RobotSettings

__all__ = ["RobotSettings", "Settings", "serve"]

log = logging.getLogger(__name__)

_KNOWN_UNKNOWNS = frozenset({"mode", "homed"})


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A gateway of one site.

    Attributes:
        audit_folder: Holds <site>/<robot>.jsonl, the audit logs.
    """

    site: str
    robots: tuple[RobotSettings, ...]
    audit_folder: Path


async def serve(session: Session, settings: Settings) -> None:
    """Put the robots on the mesh until cancelled; then stop what moves under a lease.

    Raises:
        GatewaySettingsError, DescriptionError, CodeTableError, AuditError, KeyNameError: If a robot
            cannot be run as it is set; the text names it.
    """
    check(settings)
    async with AsyncExitStack() as stack:
        robots = []
        for each in settings.robots:
            robot = Robot(session, settings.site, each, settings.audit_folder)
            stack.push_async_callback(robot.close)
            robots.append(robot)
            log.info("%s: controller at %s:%d", each.name, each.host, each.port)
        async with asyncio.TaskGroup() as tasks:
            for robot in robots:
                tasks.create_task(robot.run())


def check(settings: Settings) -> None:
    """Refuse settings that cannot be meant.

    Raises:
        GatewaySettingsError, KeyNameError: Naming what is wrong, and what would be right.
    """
    check_name(settings.site, "site")
    names: set[str] = set()
    for robot in settings.robots:
        check_name(robot.name, "robot")
        if robot.name in names:
            raise GatewaySettingsError(f"two robots are named {robot.name!r}: each needs a name of its own")
        names.add(robot.name)
        if unknown := sorted(robot.accept_unknown - _KNOWN_UNKNOWNS):
            raise GatewaySettingsError(
                f"robot {robot.name}: accept_unknown {unknown[0]!r}: it can hold 'mode' and 'homed'"
            )
        if not 0 < robot.stale_after_s < robot.reconnect_after_s:
            raise GatewaySettingsError(
                f"robot {robot.name}: stale after {robot.stale_after_s:g} s, connected anew after "
                f"{robot.reconnect_after_s:g} s: the first must be above 0, and below the second"
            )
