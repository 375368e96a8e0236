"""Makers of the parts of a robot that take several of its settings, and the check of these settings."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

from protocol_gateway.audit.log import AuditLog
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.authority.robot_authority import RobotAuthority
from protocol_gateway.checking.cell_occupancy import CellOccupancy
from protocol_gateway.checking.checker import Checker
from protocol_gateway.checking.policy import Policy
from protocol_gateway.configuration.controller_proofs import ControllerProofs
from protocol_gateway.configuration.kinds import driver_maker
from protocol_gateway.configuration.settings import RobotSettings
from protocol_gateway.execution.motion_checks import MotionChecks
from protocol_gateway.link.link import LinkSettings
from protocol_gateway.seam import Driver
from protocol_gateway.seam.errors import GatewaySettingsError
from robots.descriptions.description import RobotDescription
from robots.kinematics.joints import Joints

# Share of the stale time after which the link is silent: monitors must hear of it within the whole time.
_SHOWN_WITHIN = 0.95


@dataclass(frozen=True, kw_only=True)
class CellCheck:
    """What a robot shares with the others of its cell.

    Attributes:
        checker: Worker process for motions.
        planner: Worker process for programs.
        occupancy: Where the robots of the cell are, and whether it is closed.
    """

    checker: Checker
    planner: Checker
    occupancy: CellOccupancy


def make_driver(
    settings: RobotSettings, joints: Joints, relay: Callable[[bytes, bool, Hashable], None]
) -> Driver:
    """Return the driver of the robot's controller.

    Args:
        relay: Callback with units for old client programs, if the settings have them.

    Raises:
        GatewaySettingsError: If the driver refuses its settings, or lacks a port or a recovery that they
            name.
    """
    try:
        driver = driver_maker(settings.protocol)(
            joints.types,
            settings.codes,
            relay=None if settings.legacy_clients is None else relay,
            options=settings.options,
        )
    except GatewaySettingsError as error:
        raise GatewaySettingsError(f"robot {settings.name}: {error}") from None
    if unknown := sorted(settings.ports.keys() - driver.ports):
        raise GatewaySettingsError(
            f"robot {settings.name}: ports {unknown[0]!r}: protocol {settings.protocol!r} has "
            f"{', '.join(map(repr, sorted(driver.ports))) or 'no further ports'}"
        )
    if missing := sorted(each.value for each in settings.recover - driver.capabilities.recoveries):
        has = sorted(each.value for each in driver.capabilities.recoveries)
        raise GatewaySettingsError(
            f"robot {settings.name}: recover {missing[0]!r}: this robot has "
            f"{', '.join(map(repr, has)) or 'no recoveries'}"
        )
    return driver


def make_proofs(
    site: str, settings: RobotSettings, description: RobotDescription, driver: Driver
) -> ControllerProofs:
    """Return what is proven of the robot's controller."""
    return ControllerProofs(
        f"{site}/{settings.name}",
        description,
        driver.capabilities,
        protocol=settings.protocol,
        simulated=settings.simulated,
        verified=settings.verified,
        stop=settings.stop_proven,
        experimental=settings.experimental,
    )


def link_settings(settings: RobotSettings) -> LinkSettings:
    """Return the address of the controller, and the link's timeouts."""
    return LinkSettings(
        host=settings.host,
        port=settings.port,
        ports=settings.ports,
        stale_after_s=_SHOWN_WITHIN * settings.stale_after_s,
        reconnect_after_s=settings.reconnect_after_s,
    )


def make_authority(audit: AuditLog, joints: Joints, driver: Driver, *, read_only: bool) -> RobotAuthority:
    """Return the robot's authority as the audit log has it.

    Without the stop if the robot is read-only, because no operator could reset it.
    """
    authority = audit.state.authority
    if read_only:
        authority = replace(authority, stop=None)
    return RobotAuthority(authority, joints, driver.prepare, orphan=audit.state.mover)


def make_checks(
    settings: RobotSettings,
    cell_check: CellCheck,
    joints: Joints,
    robot_authority: RobotAuthority,
    controller: Callable[[], ControllerState],
) -> MotionChecks:
    """Return the check of the robot's motions before they start."""
    return MotionChecks(
        settings.name,
        Policy(settings.check),
        cell=[robot.name for robot in settings.surroundings.robots],
        checker=cell_check.checker,
        planner=cell_check.planner,
        cell_occupancy=cell_check.occupancy,
        joints=joints,
        robot_authority=robot_authority,
        controller=controller,
        within_s=settings.check_within_s,
    )
