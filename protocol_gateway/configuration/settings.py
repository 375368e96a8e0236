"""Settings of a gateway and its robots, and their validation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from protocol_gateway.audit.log import ROTATE_BYTES
from protocol_gateway.checking.policy import Policy
from protocol_gateway.configuration.controller_proofs import StopProof
from protocol_gateway.configuration.kinds import is_known, protocols
from protocol_gateway.legacy.settings import LegacySettings
from protocol_gateway.seam import Recovery
from protocol_gateway.seam.errors import GatewaySettingsError
from robomesh.contract.keys import check_name
from robomesh.contract.quotas import DEFAULT_QUOTAS, Quotas
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.cells import CellDescription, CellRobot
from robots.kinematics.verification_record import VerificationRecord
from robots.programs.jog_steps import MOST_M_S
from robots.schema.robot_toml import Model

_KNOWN_UNKNOWNS = frozenset({"mode", "homed"})


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """One robot, as the site file gives it.

    Attributes:
        name: The robot's name in keys.
        description: A library robot's name, or a path.
        host: Host of the controller, with `port`.
        ports: Ports of the controller's other interfaces, where they are not the usual ones:
            {"primary": 30011}.
        protocol: Protocol of the controller, by its name in `protocol_gateway.configuration.kinds`.
        options: Settings of the protocol's driver; None: it has none.
        codes: Type codes, where the controller sends numbers: {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}.
        accept_unknown: States that the controller never reports and that are not required: "mode", "homed".
        simulated: The controller is a simulator of robomesh.
        stop_proven: The trial of the stop on this controller, or True; False: the robot is read-only. How to
            try it: docs/safety.md.
        verified: Comparison of its joints with the pose that its controller computes; None: there is none.
        experimental: Commands may be sent that were never tried on a real controller.
        recover: Recoveries that an operator may send.
        stale_after_s: Without a unit for this long, the robot's state is unknown. Without positions for this
            long, motion is refused.
        reconnect_after_s: Without a unit for this long, the gateway reconnects.
        thin_at_rest: Publish some of the joint states of the arm at rest, not all.
        legacy_clients: Where old client programs attach; None: they cannot.
        jog_speed: Greatest speed of the tool while an operator jogs [m/s]; 0: no jogs.
        check: Policy of the collision check before a motion: "require", "warn", "off".
        check_within_s: Longest check of a motion; None: by what the last ones took.
        cell: Fixtures and other robots around the robot; None: there are none.
    """

    name: str
    description: Model
    host: str
    port: int
    ports: Mapping[str, int] = field(default_factory=dict)
    protocol: str = "unit"
    options: object = None
    codes: Mapping[int, str] = field(default_factory=dict)
    accept_unknown: frozenset[str] = frozenset()
    simulated: bool = False
    stop_proven: StopProof | bool = False
    verified: VerificationRecord | None = None
    experimental: bool = False
    recover: frozenset[Recovery] = frozenset()
    stale_after_s: float = 1.0
    reconnect_after_s: float = 4.0
    thin_at_rest: bool = True
    legacy_clients: LegacySettings | None = None
    jog_speed: float = MOST_M_S
    check: str = "off"
    check_within_s: float | None = None
    cell: CellDescription | None = None

    @property
    def surroundings(self) -> CellDescription:
        """The cell that the robot's motions are checked against: its own, or one with only the robot."""
        return self.cell or CellDescription(
            robots=(CellRobot(self.name, self.description, base_to_site=np.eye(4)),)
        )


class CellFile(Protocol):
    """The place where the content of cells is kept. Its methods may block.

    `CellFile` in `services/cells/file.py` describes each.
    """

    @property
    def name(self) -> str:
        """Name of the file, or an empty text."""

    def cell(self, robot: str) -> str:
        """Return the name of a robot's cell."""

    def members(self, robot: str) -> list[schema.CellMember]:
        """Return the settings of the robots of a robot's cell."""

    def meshes(self) -> list[str]:
        """Return the mesh files that fixtures may use."""

    def content(self, robot: str) -> schema.CellContent:
        """Return the content of a robot's cell."""

    def previous(self, robot: str) -> schema.CellContent | None:
        """Return the content before the last change."""

    def problem(self, robot: str) -> Reason | None:
        """Return why the content cannot be changed."""

    def normal(self, robot: str, content: schema.CellContent) -> schema.CellContent:
        """Return a content with the values that would be saved; raise RefusedError."""

    def changes(self, before: schema.CellContent, after: schema.CellContent) -> list[schema.CellChange]:
        """Return what differs between two contents."""

    def summary(self, changes: Sequence[schema.CellChange]) -> str:
        """Return changes as one text."""

    def describe(self, robot: str, content: schema.CellContent) -> tuple[str, CellDescription]:
        """Return a content's version, and what motions are checked against; raise RefusedError."""

    def save(self, robot: str, content: schema.CellContent) -> None:
        """Save the content of a robot's cell, atomically; raise RefusedError."""

    def restore(self) -> None:
        """Undo the last `save`; raise RefusedError."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A gateway of one site.

    Attributes:
        audit_folder: Holds <site>/<robot>.jsonl, the audit logs.
        audit_rotate_bytes: Size at which a log's live file becomes an older part.
        cell_file: Keeps the content of the robots' cells; None: it cannot be shown and changed.
        quotas: Limits for each client.
    """

    site: str
    robots: tuple[RobotSettings, ...]
    audit_folder: Path
    audit_rotate_bytes: int = ROTATE_BYTES
    cell_file: CellFile | None = None
    quotas: Quotas = DEFAULT_QUOTAS


def check(settings: Settings) -> None:
    """Validate the settings.

    Raises:
        GatewaySettingsError, KeyNameError: If a setting is invalid; the text names it and the allowed values.
    """
    check_name(settings.site, "site")
    names: set[str] = set()
    for robot in settings.robots:
        check_name(robot.name, "robot")
        if robot.name in names:
            raise GatewaySettingsError(f"two robots are named {robot.name!r}: names must be unique")
        names.add(robot.name)
        if not is_known(robot.protocol):
            raise GatewaySettingsError(
                f"robot {robot.name}: unknown protocol {robot.protocol!r}; known: {', '.join(protocols())}"
            )
        if robot.check not in list(Policy):
            known = ", ".join(repr(str(each)) for each in Policy)
            raise GatewaySettingsError(f"robot {robot.name}: check = {robot.check!r}: should be {known}")
        if robot.name not in {each.name for each in robot.surroundings.robots}:
            raise GatewaySettingsError(f"robot {robot.name}: its cell does not contain it")
        if robot.legacy_clients is not None and robot.protocol != "unit":
            raise GatewaySettingsError(
                f"robot {robot.name}: legacy_clients need the protocol 'unit', but its controller "
                f"uses {robot.protocol!r}"
            )
        if unknown := sorted(robot.accept_unknown - _KNOWN_UNKNOWNS):
            raise GatewaySettingsError(
                f"robot {robot.name}: accept_unknown {unknown[0]!r}: allowed are 'mode' and 'homed'"
            )
        if not 0 < robot.stale_after_s < robot.reconnect_after_s:
            raise GatewaySettingsError(
                f"robot {robot.name}: stale_after_s = {robot.stale_after_s:g}, reconnect_after_s = "
                f"{robot.reconnect_after_s:g}: the first must be above 0, and below the second"
            )
