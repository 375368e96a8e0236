"""The kinds of controllers by the site file's `protocol`: those of robomesh, and of installed packages.

Both are entry points of the group `robomesh.drivers` (docs/controllers/own-driver.md). Only the drivers that
a site uses are imported.
"""

import logging
import sys
from collections.abc import Mapping
from functools import cache, lru_cache, partial
from importlib.metadata import EntryPoint, distribution, entry_points
from typing import Any, cast

from protocol_gateway.errors import GatewaySettingsError, ProtocolGatewayError
from protocol_gateway.seam import Capabilities, Driver
from protocol_gateway.seam.kind import DriverMaker, Kind

logger = logging.getLogger(__name__)

ENTRY_POINTS = "robomesh.drivers"


@cache
def own_kinds() -> Mapping[str, Kind]:
    """Return robomesh's own kinds by protocol; an installation may leave out the folder of one."""
    kinds = {}
    found = distribution("robomesh").entry_points.select(group=ENTRY_POINTS)
    # Installers order them differently; ours is first.
    for each in sorted(found, key=lambda each: (each.name != "unit", each.name)):
        try:
            kinds[each.name] = each.load()
        except ModuleNotFoundError as error:
            if error.name is None or not each.module.startswith(error.name):
                raise
    return kinds


def protocols() -> tuple[str, ...]:
    """Return the names of all protocols, those of robomesh first."""
    own = own_kinds()
    installed = {each.name for each in entry_points(group=ENTRY_POINTS) if not _is_own(each)}
    return (*own, *sorted(installed - own.keys()))


def is_known(protocol: str) -> bool:
    """Return whether there is a kind with this protocol."""
    return protocol in own_kinds() or protocol in protocols()


def kind_of(protocol: str) -> Kind:
    """Return the kind with a protocol.

    Raises:
        GatewaySettingsError: If no package, or more than one, has it, or it cannot be imported.
    """
    return own_kinds().get(protocol) or _installed(protocol, tuple(sys.path))


def driver_maker(protocol: str) -> DriverMaker:
    """Return the factory of a protocol's drivers.

    Raises:
        GatewaySettingsError: As `kind_of`.
    """
    return kind_of(protocol).driver_maker


@lru_cache
def _installed(protocol: str, path: tuple[str, ...]) -> Kind:
    """Return the kind of an installed package; the cache is for one path of Python's modules."""
    found = {
        (_package(each), each.value): each
        for each in entry_points(group=ENTRY_POINTS, name=protocol)
        if not _is_own(each)
    }
    if len(found) > 1:
        # Which of them is first depends on the file system, and may be another one tomorrow.
        packages = ", ".join(sorted(package for package, _ in found))
        raise GatewaySettingsError(
            f"protocol {protocol!r}: several packages have it: remove all but one of {packages}"
        )
    for (package, _), each in found.items():
        try:
            given = each.load()
            kind = given if isinstance(given, Kind) else Kind(driver=given)
            maker, _ = kind.driver_maker, kind.table_model
        except (Exception, SystemExit) as error:
            raise GatewaySettingsError(
                f"protocol {protocol!r}: its driver, of the package {package}, cannot be imported: {error}"
            ) from error
        whose = f"protocol {protocol!r}: its driver, of the package {package},"
        return Kind(**{**vars(kind), "driver": partial(_created, maker, whose)})
    raise GatewaySettingsError(f"unknown protocol {protocol!r}; known: {', '.join(protocols())}")


def _is_own(each: EntryPoint) -> bool:
    return each.dist is not None and each.dist.name == "robomesh"


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
            return _with_new_names(driver, whose)
        raise TypeError("its capabilities have another type than Capabilities")
    except ProtocolGatewayError:
        raise
    except (Exception, SystemExit) as error:
        raise GatewaySettingsError(f"{whose} cannot be created: {error}") from error


def _with_new_names(driver: Any, whose: str) -> Driver:
    """Return a driver, with a warning and new names of its methods if it has old ones."""
    if not hasattr(driver, "prepare"):
        logger.warning(
            "%s has encode, which is prepare now, and no names of timers: docs/controllers/own-driver.md",
            whose,
        )
        driver.prepare, old = driver.encode, driver.timer_ended
        driver.timer_ended = lambda ended, now_s: old(now_s)
    return cast("Driver", driver)
