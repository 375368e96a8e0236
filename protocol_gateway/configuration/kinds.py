"""The kinds of controllers by the site file's `protocol`: those of robomesh, and of installed packages.

Both are entry points of the group `robomesh.drivers` (docs/controllers/own-driver.md). Of packages, only
those are imported that a site file or `robomesh simulate` names; `robomesh probe` imports all.
"""

import logging
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache, lru_cache, partial
from importlib.metadata import EntryPoint, EntryPoints, PackageNotFoundError, distribution, entry_points
from inspect import signature
from typing import Any, Literal, TypeVar, cast

from protocol_gateway.seam import Capabilities, ControllerCommand, Driver, Effects
from protocol_gateway.seam.errors import GatewaySettingsError, ProtocolGatewayError
from protocol_gateway.seam.kind import DriverMaker, Kind, named
from protocol_gateway.seam.table import Table

logger = logging.getLogger(__name__)

ENTRY_POINTS = "robomesh.drivers"

_Part = TypeVar("_Part")


@cache
def own_kinds() -> Mapping[str, Kind]:
    """Return robomesh's own kinds by protocol; an installation may leave out the folder of one."""
    kinds = {}
    try:
        found = distribution("robomesh").entry_points.select(group=ENTRY_POINTS)
    except PackageNotFoundError:
        found = EntryPoints()
    # Installers order them differently; ours is first.
    for each in sorted(found, key=lambda each: (each.name != "unit", each.name)):
        try:
            kinds[each.name] = each.load()
        except ModuleNotFoundError as error:
            if error.name is None or not each.module.startswith(error.name):
                raise
    if not kinds:
        raise GatewaySettingsError(
            "robomesh's own kinds of controllers are not found: install robomesh again"
        )
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
    if (own := own_kinds().get(protocol)) is not None:
        return own
    kind, problem = _installed(protocol, tuple(sys.path))
    if kind is None:
        raise GatewaySettingsError(problem)
    return kind


def driver_maker(protocol: str) -> DriverMaker:
    """Return the factory of a protocol's drivers.

    Raises:
        GatewaySettingsError: As `kind_of`; or if the driver cannot be imported.
    """
    kind = kind_of(protocol)
    if protocol in own_kinds():
        return kind.driver_maker
    whose = f"protocol {protocol!r}: its driver, of the package {kind.distribution},"
    try:
        return partial(_created, kind.driver_maker, whose)
    except (Exception, SystemExit) as error:
        raise GatewaySettingsError(f"{whose} cannot be imported: {error}") from error


def part_of(protocol: str, part: Literal["probe", "simulated"], wanted: type[_Part]) -> _Part | None:
    """Return a part of the kind with a protocol; None: it has none.

    Args:
        wanted: The type of the part.

    Raises:
        GatewaySettingsError: As `kind_of`; or if a package's part cannot be imported, or has another type.
    """
    kind = kind_of(protocol)
    name: str = getattr(kind, part)
    if not name:
        return None
    try:
        found = named(name)
        if isinstance(found, wanted):
            return found
        problem = f"is of the type {type(found).__name__}"
    except (Exception, SystemExit) as error:
        if protocol in own_kinds():
            raise
        problem = f"cannot be imported: {error}"
    raise GatewaySettingsError(
        f"protocol {protocol!r}: {part} = {name!r}, of the package {kind.distribution}, {problem}; "
        f"it must be 'module:name' of a {wanted.__module__}.{wanted.__name__}"
    )


def kind_with(module: str) -> Kind | None:
    """Return the kind that needs a module, of robomesh or of an imported package; None: there is none."""
    used = [each.name for each in entry_points(group=ENTRY_POINTS) if each.module in sys.modules]
    kinds = [*own_kinds().values(), *(_installed(each, tuple(sys.path))[0] for each in used)]
    return next((kind for kind in kinds if kind is not None and module in kind.packages), None)


@lru_cache
def _installed(protocol: str, path: tuple[str, ...]) -> tuple[Kind | None, str]:
    """Return the kind of an installed package, or the problem with it, for one path of Python's modules."""
    packages = _packages(protocol)
    if not packages:
        return None, f"unknown protocol {protocol!r}; known: {', '.join(protocols())}"
    if len(packages) > 1:
        # Which of them is first depends on the file system, and may be another one tomorrow.
        both = ", ".join(packages)
        return None, f"protocol {protocol!r}: several packages have it: remove all but one of {both}"
    entry = next(each for each in entry_points(group=ENTRY_POINTS, name=protocol) if not _is_own(each))
    try:
        given = entry.load()
        kind = given if isinstance(given, Kind) else Kind(driver=given, datagrams=None)
        if kind.table and not issubclass(kind.table_model or object, Table):
            raise TypeError(f"{kind.table} is no Table")
    except (Exception, SystemExit) as error:
        whose = f"protocol {protocol!r}: its driver, of the package {packages[0]},"
        return None, f"{whose} cannot be imported: {error}"
    return replace(kind, key="driver", distribution=packages[0]), ""


def _packages(protocol: str) -> list[str]:
    """Return the packages that have a protocol."""
    found = [each for each in entry_points(group=ENTRY_POINTS, name=protocol) if not _is_own(each)]
    return sorted({_package(each) for each in found})


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


class _OldDriver:
    """A driver that was written before `prepare`, or before timers had names."""

    def __init__(self, driver: Any) -> None:
        self._driver = driver

    def __getattr__(self, name: str) -> Any:
        return getattr(self._driver, name)

    def prepare(self, *commands: ControllerCommand) -> Any:
        """Return what its `command` takes."""
        encode = getattr(self._driver, "encode", None) or self._driver.prepare
        return encode(*commands)

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Call its method, which knows one timer."""
        return cast("Effects", self._driver.timer_ended(now_s))


def _with_new_names(driver: Any, whose: str) -> Driver:
    """Return a driver, with a warning and new names of its methods if it has old ones."""
    if hasattr(driver, "prepare") and len(signature(driver.timer_ended).parameters) > 1:
        return cast("Driver", driver)
    logger.warning(
        "%s has old methods: encode is prepare now, and timer_ended gets names of timers: "
        "docs/controllers/own-driver.md",
        whose,
    )
    return cast("Driver", _OldDriver(driver))
