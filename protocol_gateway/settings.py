"""What a gateway and its robots are set to, and what cannot be meant."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from protocol_gateway.audit.log import ROTATE_BYTES
from protocol_gateway.checking.policy import Policy
from protocol_gateway.drivers.registry import DRIVERS
from protocol_gateway.errors import GatewaySettingsError
from protocol_gateway.legacy.settings import LegacySettings
from robomesh.keys import check_name
from robots.cells import CellDescription, CellRobot

_KNOWN_UNKNOWNS = frozenset({"mode", "homed"})


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """One robot, as the site file gives it.

    Attributes:
        name: In keys.
        description: A library robot's name, or a path.
        host: Of the controller; `port` too.
        protocol: Of the controller, by its name in `protocol_gateway.drivers.registry`.
        codes: Type codes, where the controller sends numbers: {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}.
        accept_unknown: What the controller never tells and is done without: "mode", "homed".
        stop_proven: The stop unit was tried on this controller; without that the robot is read-only.
            How to try it: docs/safety.md.
        stale_after_s: Without a unit for this long, nothing is known of the robot any more; without positions
            for this long, it is not moved.
        reconnect_after_s: Without a unit for this long, the connection is made anew.
        legacy_clients: Where old client programs attach; None: none may.
        check: Whether motions are checked before they are made: "require", "warn", "off".
        cell: What stands around it; None: nothing does.
    """

    name: str
    description: str | Path
    host: str
    port: int
    protocol: str = "unit"
    codes: Mapping[int, str] = field(default_factory=dict)
    accept_unknown: frozenset[str] = frozenset()
    stop_proven: bool = False
    stale_after_s: float = 1.0
    reconnect_after_s: float = 4.0
    legacy_clients: LegacySettings | None = None
    check: str = "off"
    cell: CellDescription | None = None

    @property
    def surroundings(self) -> CellDescription:
        """What its motions are checked against: its cell, or the robot alone."""
        return self.cell or CellDescription(
            robots=(CellRobot(self.name, self.description, base_to_site=np.eye(4)),)
        )


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A gateway of one site.

    Attributes:
        audit_folder: Holds <site>/<robot>.jsonl, the audit logs.
        audit_rotate_bytes: A log's file that has grown to this becomes an older part.
    """

    site: str
    robots: tuple[RobotSettings, ...]
    audit_folder: Path
    audit_rotate_bytes: int = ROTATE_BYTES


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
        if robot.protocol not in DRIVERS:
            raise GatewaySettingsError(
                f"robot {robot.name}: no protocol {robot.protocol!r}; there are {', '.join(DRIVERS)}"
            )
        if robot.check not in list(Policy):
            known = ", ".join(repr(str(each)) for each in Policy)
            raise GatewaySettingsError(f"robot {robot.name}: check = {robot.check!r}: should be {known}")
        if robot.name not in {each.name for each in robot.surroundings.robots}:
            raise GatewaySettingsError(f"robot {robot.name}: its cell does not hold it")
        if robot.legacy_clients is not None and robot.protocol != "unit":
            raise GatewaySettingsError(
                f"robot {robot.name}: legacy_clients speak the protocol 'unit', and its controller "
                f"speaks {robot.protocol!r}"
            )
        if unknown := sorted(robot.accept_unknown - _KNOWN_UNKNOWNS):
            raise GatewaySettingsError(
                f"robot {robot.name}: accept_unknown {unknown[0]!r}: it can hold 'mode' and 'homed'"
            )
        if not 0 < robot.stale_after_s < robot.reconnect_after_s:
            raise GatewaySettingsError(
                f"robot {robot.name}: stale after {robot.stale_after_s:g} s, connected anew after "
                f"{robot.reconnect_after_s:g} s: the first must be above 0, and below the second"
            )
