"""The addresses of a site's controllers and of its old client programs."""

import logging
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

from protocol_gateway.legacy.settings import LegacySettings
from robomesh.listen_address import same_address, split_address
from services.errors import ServiceError
from services.site_file.site import Site
from services.site_file.tables.robot import Robot

logger = logging.getLogger(__name__)


class ControllerError(ServiceError):
    """A controller's option or address is missing or invalid."""


class ControllerAddress(NamedTuple):
    """Host and port of a controller, and the ports of its other interfaces by their names."""

    host: str
    port: int
    ports: dict[str, int]


def controller_addresses(site: Site, options: Sequence[str]) -> dict[str, ControllerAddress]:
    """Return the address of every robot's controller, from an option or the site file.

    Args:
        options: ROBOT=tcp://HOST:PORT each, or ROBOT=tcp://HOST:PORT,NAME=PORT with other interfaces.

    Raises:
        ControllerError: If an address is missing, names no robot of the site, or is used twice.
        ListenError: If an address is invalid.
    """
    given: dict[str, str] = {}
    for text in options:
        name, _, address = text.partition("=")
        if name not in [robot.name for robot in site.robot]:
            raise ControllerError(
                f"--controller {text}: the site has no robot {name!r}; "
                f"it has {', '.join(robot.name for robot in site.robot) or 'none'}"
            )
        given[name] = address
    addresses: dict[str, str] = {}
    ports: dict[str, dict[str, int]] = {}
    for robot in site.robot:
        address, *others = given.get(robot.name, robot.controller).split(",")
        ports[robot.name] = robot.ports | dict(_other_port(robot.name, other) for other in others)
        if address == "simulated":
            raise ControllerError(
                f"robot {robot.name}: its controller is simulated, at an unknown address: give "
                f"--controller {robot.name}=tcp://HOST:PORT (robomesh up starts a simulator itself)"
            )
        addresses[robot.name] = address.removeprefix("tcp://").removeprefix("udp://")
    # The site file's addresses were compared when it was read; those of options were not.
    taken = [(f"robot {robot.name}'s controller", addresses[robot.name], robot.group) for robot in site.robot]
    taken += [
        (f"robot {robot.name}'s legacy_clients", robot.legacy_clients.listen, "")
        for robot in site.robot
        if robot.legacy_clients is not None
    ]
    for (what, address, group), (other, another, group_2) in combinations(taken, 2):
        # A controller with several control groups is several robots.
        if same_address(address, another) and (group == group_2 or not (group and group_2)):
            raise ControllerError(f"{another} is given twice, to {what} and to {other}: each needs its own")
    return {
        name: ControllerAddress(*split_address(address), ports[name]) for name, address in addresses.items()
    }


def _other_port(robot: str, text: str) -> tuple[str, int]:
    name, _, port = text.partition("=")
    if not name or not port.isascii() or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ControllerError(f"--controller {robot}: {text!r}: must be NAME=PORT, as in primary=30011")
    return name, int(port)


def legacy_settings(robot: Robot) -> LegacySettings | None:
    """Return where old client programs attach to a robot; None: they cannot. Warn if others can reach it."""
    clients = robot.legacy_clients
    if clients is None:
        return None
    if warning := clients.warning(f"robot {robot.name}: legacy_clients"):
        logger.warning("%s", warning)
    return clients.settings
