"""Registry of protocols: those of robomesh, and those of installed packages.

A driver of robomesh is one line here. A package installs others by the entry points `robomesh.drivers`
(docs/controllers/own-driver.md). Only the drivers that a site uses are imported.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Protocol, cast

from protocol_gateway.drivers.driver import Capabilities, Driver
from protocol_gateway.errors import GatewaySettingsError, ProtocolGatewayError
from robots.joints import JointType

ENTRY_POINTS = "robomesh.drivers"

OWN: Mapping[str, str] = {
    "unit": "protocol_gateway.drivers.unit:UnitDriver",
    "rtde": "protocol_gateway.drivers.universal_robots.motion_driver:rtde_driver",
    "hses": "protocol_gateway.drivers.yaskawa.motion_driver:hses_driver",
    "snpx": "protocol_gateway.drivers.fanuc.motion_driver:fanuc_driver",
    "fanuc-ftp": "protocol_gateway.drivers.fanuc.ftp_driver:fanuc_ftp_driver",
    "opcua": "protocol_gateway.drivers.opcua.driver:OpcUaDriver",
}
"""Drivers of robomesh by the site file's `protocol`: module and class."""


class DriverMaker(Protocol):
    """Factory of a robot's driver, usually the driver's class."""

    def __call__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None,
        options: object,
    ) -> Driver:
        """Create a driver.

        Args:
            joint_types: Types of the joints, in the order of the controller's values.
            codes: The site file's table of type codes; empty if there is none.
            relay: Callback with units for old client programs, see `UnitDriver`; None: there are none.
            options: What the site file declares for this kind of controller; None: nothing.

        Raises:
            ProtocolGatewayError: If the arguments are invalid.
        """
        ...


def protocols() -> tuple[str, ...]:
    """Return the names of all protocols, those of robomesh first."""
    installed = {each.name for each in entry_points(group=ENTRY_POINTS)}
    return (*OWN, *sorted(installed - OWN.keys()))


def is_known(protocol: str) -> bool:
    """Return whether there is a driver of this name."""
    return protocol in OWN or protocol in protocols()


def driver_maker(protocol: str) -> DriverMaker:
    """Return the factory of a protocol's drivers.

    Raises:
        GatewaySettingsError: If no package, or more than one, has it, or its driver cannot be imported.
    """
    if protocol in OWN:
        module, _, name = OWN[protocol].partition(":")
        return cast("DriverMaker", getattr(import_module(module), name))
    found = {(_package(each), each.value): each for each in entry_points(group=ENTRY_POINTS, name=protocol)}
    if len(found) > 1:
        # Which of them is first depends on the file system, and may be another one tomorrow.
        packages = ", ".join(sorted(package for package, _ in found))
        raise GatewaySettingsError(
            f"protocol {protocol!r}: several packages have it: remove all but one of {packages}"
        )
    for (package, _), each in found.items():
        try:
            return partial(
                _created, each.load(), f"protocol {protocol!r}: its driver, of the package {package},"
            )
        except (Exception, SystemExit) as error:
            raise GatewaySettingsError(
                f"protocol {protocol!r}: its driver, of the package {package}, cannot be imported: {error}"
            ) from error
    raise GatewaySettingsError(f"unknown protocol {protocol!r}; known: {', '.join(protocols())}")


def _package(driver: EntryPoint) -> str:
    return driver.dist.name if driver.dist is not None else driver.value


def _created(maker: DriverMaker, whose: str, *given: Any, **named: Any) -> Driver:
    """Return a new driver of an installed package.

    Raises:
        GatewaySettingsError: If the call fails, or returns no driver.
    """
    try:
        driver = maker(*given, **named)
        if isinstance(driver.capabilities, Capabilities):
            return driver
        raise TypeError("its capabilities have another type than Capabilities")
    except ProtocolGatewayError:
        raise
    except (Exception, SystemExit) as error:
        raise GatewaySettingsError(f"{whose} cannot be created: {error}") from error
