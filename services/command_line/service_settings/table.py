"""The table of a site's services, which the commands, `robomesh up` and `robomesh doctor` use.

A row imports its service when it runs, so that the table costs no time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from services.cells.file import CellFile
    from services.site_file.site import Site


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command line, besides the site file's values.

    Attributes:
        site_file: The site file; None: the built-in site.
        controllers: ROBOT=tcp://HOST:PORT of robots whose address differs from the site file's.
        started: Run for this robot only, which was started from the page; empty: for the site's robots.
        supervised: `robomesh up` runs every service of the site, and the robots that the page starts.
    """

    site_file: Path | None = None
    controllers: Sequence[str] = ()
    started: str = ""
    supervised: bool = False


@dataclass(frozen=True, kw_only=True)
class Service:
    """A service that runs from a site file.

    Attributes:
        module: Has the service's `serve`.
        settings: Makes the Settings; None: `site/router.py` does, which reads a part of the site file.
        of_robots: It declares presence for each robot, and a site without robots does not run it.
        required: `robomesh up` ends if it cannot start as it is configured.
        standby: `robomesh up` keeps a second process loaded.
        last: `robomesh up` ends it after the others, which need it until their end.
        finishes: Work at its end that no kill may cut, for a line of log; empty: none.
        packages: Packages of its extra that `robomesh doctor` looks for.
    """

    module: str
    settings: "Callable[[Site, Options], Any] | None"
    of_robots: bool = False
    required: bool = True
    standby: bool = False
    last: bool = False
    finishes: str = ""
    packages: tuple[str, ...] = ()


def _gateway(site: "Site", options: Options) -> Any:
    from protocol_gateway.configuration.settings import RobotSettings
    from protocol_gateway.gateway import Settings
    from services.cells.descriptions import cells_of
    from services.command_line.service_settings.controllers import controller_addresses, legacy_settings

    addresses, cells = controller_addresses(site, options.controllers), cells_of(site)
    robots = tuple(
        RobotSettings(
            name=robot.name,
            description=robot.described,
            **addresses[robot.name]._asdict(),
            protocol=robot.protocol,
            options=robot.driver_options,
            codes=robot.codes,
            accept_unknown=frozenset(robot.accept_unknown),
            simulated=robot.simulated,
            stop_proven=robot.proof_of_stop,
            verified=robot.comparison,
            experimental=robot.experimental,
            recover=frozenset(robot.recover),
            jog_speed=robot.jog_speed / 1000,
            stale_after_s=robot.stale_time_s,
            reconnect_after_s=max(4.0, 2.0 * robot.stale_time_s),
            thin_at_rest=robot.thin_at_rest,
            legacy_clients=legacy_settings(robot),
            check=robot.check,
            check_within_s=robot.check_within_s,
            cell=cells[robot.name],
        )
        for robot in site.robot
    )
    return Settings(
        site=site.site,
        robots=robots,
        audit_folder=site.audit.folder,
        audit_rotate_bytes=round(site.audit.rotate_mib * 2**20),
        cell_file=_cell_file(site, options),
        quotas=site.quotas.settings,
    )


def _cell_file(site: "Site", options: Options) -> "CellFile":
    """Return the cells of the site file; a robot that was started from the page is not in it."""
    from services.cells.file import CellFile

    return CellFile(None if options.started else options.site_file, site)


def _kinematics(site: "Site", options: Options) -> Any:
    from services.cells.descriptions import cells_of
    from services.kinematics import RobotSettings, Settings

    cells = cells_of(site)
    robots = tuple(
        RobotSettings(
            name=robot.name,
            cell_description=cells[robot.name],
            cell=robot.cell,
            simulated=robot.simulated,
            stale_after_s=robot.stale_time_s,
        )
        for robot in site.robot
    )
    return Settings(
        site=site.site,
        robots=robots,
        quotas=site.quotas.settings,
        cell_content=_cell_file(site, options),
    )


def _console(site: "Site", options: Options) -> Any:
    from services.console.app import Settings
    from services.console.define.settings import DefineSettings

    define = DefineSettings(site=site, can_start=options.supervised)
    return Settings(**dict(site.console), site=site.site, define=define)


def _recorder(site: "Site", options: Options) -> Any:
    from services.recorder.attachments import without_secrets
    from services.recorder.settings import Settings

    file = options.site_file
    return Settings(
        **dict(site.recorder) | {"views": site.recorded_views},
        site=site.site,
        robots=tuple(robot.name for robot in site.robot),
        quotas=site.quotas.settings,
        site_file="" if file is None else without_secrets(file.read_text(encoding="utf-8")),
    )


def _player(site: "Site", _: Options) -> Any:
    from services.player import Settings

    return Settings(site=site.site, folder=site.recorder.folder)


def _watch(site: "Site", options: Options) -> Any:
    from services.watch.settings import Settings

    robots = [robot.name for robot in site.robot]
    expected = [
        (name, each) for name, row in SERVICES.items() for each in (robots if row.of_robots else ["-"])
    ]
    return Settings(
        **dict(site.watch), site=site.site, expected=tuple(expected) if options.supervised else ()
    )


def _store(site: "Site", _: Options) -> Any:
    from services.store.settings import Settings

    robots = tuple(robot.name for robot in site.robot)
    return Settings(**dict(site.programs), site=site.site, robots=robots, quotas=site.quotas.settings)


def _renderer(site: "Site", _: Options) -> Any:
    from renderer.service import Settings

    return Settings(**dict(site.renderer), site=site.site, quotas=site.quotas.settings)


# In the order in which `robomesh up` starts them, and of the ports of their metrics: append a new service.
SERVICES = {
    "router": Service(module="services.router", settings=None, standby=True, last=True),
    "gateway": Service(
        module="protocol_gateway.gateway",
        settings=_gateway,
        of_robots=True,
        finishes="stopping its robots and completing the audit log",
        packages=("zenoh", "pydantic", "numpy"),
    ),
    "kinematics": Service(
        module="services.kinematics",
        settings=_kinematics,
        of_robots=True,
        packages=("pinocchio", "coal", "trimesh"),
    ),
    "console": Service(
        module="services.console.app",
        settings=_console,
        packages=("starlette", "uvicorn", "websockets"),
    ),
    "recorder": Service(
        module="services.recorder.recorder",
        settings=_recorder,
        required=False,
        finishes="closing its recordings",
        packages=("mcap", "mcap_protobuf"),
    ),
    "player": Service(
        module="services.player",
        settings=_player,
        required=False,
        packages=("mcap", "mcap_protobuf"),
    ),
    "watch": Service(module="services.watch.watch", settings=_watch, required=False),
    # Without OpenGL everything else runs.
    "renderer": Service(
        module="renderer.service",
        settings=_renderer,
        required=False,
        packages=("moderngl", "av", "cv2"),
    ),
    "store": Service(
        module="services.store.service",
        settings=_store,
        required=False,
        finishes="writing a program",
    ),
}
