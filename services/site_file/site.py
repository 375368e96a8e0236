"""The site file: everything that runs at a site. Each service gets its settings from here.

Units are degrees and millimetres in the file, SI in the services' settings.
"""

import re
import tomllib
from collections.abc import Mapping
from itertools import combinations, product
from pathlib import Path
from typing import Annotated

from pydantic import (
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from protocol_gateway.seam.table import Table
from renderer.settings import ALWAYS_RENDERED, Renderer
from robomesh.errors import ListenError
from robomesh.listen_address import (
    cannot_both_listen,
    check_page_reach,
    check_reach,
    same_address,
    split_address,
)
from robots.descriptions import description
from robots.kinematics.kinematic_tree import BASE, bare_links, tree_of
from robots.schema.bounded_toml import read_toml
from robots.schema.errors import DescriptionError, VerificationRecordError
from robots.schema.robot_toml import Pose, UrdfDescription
from robots.schema.toml_table import TomlTable
from services.errors import SiteFileError
from services.recorder.settings import Recorder
from services.site_file.tables.console import Console
from services.site_file.tables.console import resolve_paths as resolve_console_paths
from services.site_file.tables.fixtures import Fixture, fixture_problem, name_problem
from services.site_file.tables.quotas import Quotas
from services.site_file.tables.robot import Robot
from services.site_file.tables.router import RoutedSite, resolve_paths
from services.site_file.validation_errors import sentence
from services.store.settings import Programs
from services.watch.settings import Watch

# Maximum number of problems that an error lists.
_MAX_PROBLEMS = 100


class Define(TomlTable):
    """Robots that are defined on the page.

    Attributes:
        folder: Folder of these robots.
    """

    folder: Path = Path("robots")


class Audit(TomlTable):
    """The gateway's audit logs, one for each robot.

    Attributes:
        folder: Folder of the logs.
        rotate_mib: Size at which a log file becomes an older part, and a new file begins [MiB].
    """

    folder: Path = Path("audit")
    rotate_mib: Annotated[float, Field(ge=0.01, le=1024)] = 16


class Site(RoutedSite):
    """A whole site.

    Attributes:
        robot: The robots.
        fixture: Static objects in the robots' cells.
        recorder: Recordings.
        renderer: Rendered views.
        console: The page.
        define: Robots that are defined on the page.
        audit: Audit logs.
        watch: Alarms.
        programs: Stored programs.
        quotas: Limits for each client's name.
    """

    robot: tuple[Robot, ...] = ()
    fixture: tuple[Fixture, ...] = ()
    recorder: Recorder = Recorder()
    renderer: Renderer = Renderer()
    console: Console = Console()
    define: Define = Define()
    audit: Audit = Audit()
    watch: Watch = Watch()
    programs: Programs = Programs()
    quotas: Quotas = Quotas()

    @field_validator("robot")
    @classmethod
    def _robots(cls, robots: tuple[Robot, ...]) -> tuple[Robot, ...]:
        names = [robot.name for robot in robots]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two robots are named {name!r}: every robot needs a different name")
        return robots

    @model_validator(mode="after")
    def _cells(self) -> "Site":
        if problem := name_problem(self.fixture, {robot.name: robot.cell for robot in self.robot}):
            raise ValueError(problem)
        for robot, other in combinations(self.robot, 2):
            both = all("floor" in each.model_fields_set for each in (robot, other))
            if both and robot.cell and robot.cell == other.cell and robot.floor != other.floor:
                raise ValueError(
                    f"robots {robot.name} and {other.name} give different floors, and their cell "
                    f"{robot.cell!r} has one: give it once"
                )
        return self

    @model_validator(mode="after")
    def _views(self) -> "Site":
        rendered = (*self.renderer.views, *ALWAYS_RENDERED)
        for view in self.recorder.views or ():
            if view not in rendered:
                raise ValueError(
                    f"recorder views = {view!r}: the renderer has no such view; it has {', '.join(rendered)}"
                )
        return self

    @model_validator(mode="after")
    def _addresses(self) -> "Site":
        """Reject an address that is given twice; each listener and each controller needs its own."""
        here = [("the router", address) for address in map(_tcp_address, self.router.listen) if address]
        here.append(("the console", self.console.listen))
        linked = (_tcp_address(each.rpartition("=")[2]) for each in self.router.connect)
        there = [("another router", address) for address in linked if address]
        # A controller with several control groups is several robots.
        groups: dict[str, list[tuple[str, str]]] = {}
        for robot in self.robot:
            if not robot.simulated:
                controller = (f"robot {robot.name}'s controller", robot.address)
                (groups.setdefault(robot.group, []) if robot.group else there).append(controller)
            if robot.legacy_clients is not None:
                here.append((f"robot {robot.name}'s legacy_clients", robot.legacy_clients.listen))
        tests = [
            *((cannot_both_listen, *pair) for pair in combinations(here, 2)),
            *((same_address, *pair) for pair in (*combinations(there, 2), *product(here, there))),
            *((same_address, *pair) for robots in groups.values() for pair in combinations(robots, 2)),
        ]
        for in_conflict, (what, address), (other, another) in tests:
            try:
                conflict = in_conflict(address, another)
            except ListenError as error:
                raise ValueError(str(error)) from None
            if conflict:
                raise ValueError(f"{another} is given twice, to {what} and to {other}: each needs its own")
        return self

    @property
    def recorded_views(self) -> tuple[str, ...]:
        """Views that are recorded by default."""
        if self.recorder.views is not None:
            return self.recorder.views
        return ("free",) if "free" in self.renderer.views else self.renderer.views[:1]


def load(path: Path | None) -> Site:
    """Load a site file; without a path, return the built-in site `demo`.

    Paths in the file are relative to the file's folder.

    Raises:
        SiteFileError: One line per problem: file, key, value and what would be right.
    """
    if path is None:
        return DEMO
    try:
        values = read_toml(path)
        site = Site.model_validate(values)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SiteFileError(f"{path}: cannot be read: {reason}") from None
    except tomllib.TOMLDecodeError as error:
        raise SiteFileError(f"{path}: not TOML: {error}") from None
    except ValidationError as error:
        found = error.errors(include_url=False)
        sentences = [sentence(path, problem, values, Site) for problem in found[:_MAX_PROBLEMS]]
        if len(found) > _MAX_PROBLEMS:
            sentences.append(f"{path}: and {len(found) - _MAX_PROBLEMS} more problems")
        raise SiteFileError("\n".join(sentences)) from None
    site = resolve_site(site, path.parent)
    # Report before the start what no service could run with.
    try:
        _check_reach(site)
    except ListenError as error:
        raise SiteFileError(f"{path}: {error}") from None
    links: dict[str, dict[str, bool]] = {}
    unseen: dict[str, str] = {}
    for robot in site.robot:
        try:
            described = description.load(robot.described)
            tree = tree_of(described)
        except DescriptionError as error:
            raise SiteFileError(f"{path}: robot {robot.name}: model = {robot.model!r}: {error}") from None
        try:
            _ = robot.comparison
        except VerificationRecordError as error:
            raise SiteFileError(f"{path}: robot {robot.name}: verified: {error}") from None
        links[robot.name] = {link.name: bool(link.checked) for link in tree.links}
        missing = described.robot.unchecked if isinstance(described, UrdfDescription) else ()
        shaped = [number for number, link in enumerate(tree.links) if link.checked]
        moving = [tree.links[number] for number in bare_links(tree, shaped)]
        moving = [link for link in moving if link.joint != BASE]
        if not shaped:
            unseen[robot.name] = f"{robot.model} has no shapes that could be checked"
        elif missing:
            unseen[robot.name] = f"{robot.model}: no such mesh file: {', '.join(missing)}"
        elif moving:
            names = ", ".join(link.name for link in moving)
            unseen[robot.name] = f"{robot.model}: {names} moves and has no shape that could be checked"
    if problem := _unseen_problem(site.robot, unseen) or fixture_problem(site.fixture, links):
        raise SiteFileError(f"{path}: {problem}")
    return site


def _check_reach(site: Site) -> None:
    """Check that addresses which other machines can reach are secured.

    Raises:
        ListenError: If one is not secured and the file does not accept that.
    """
    for endpoint in site.listened:
        protocol, _, address = endpoint.partition("/")
        host, _ = split_address(re.split("[?#]", address)[0])
        secured = protocol in ("tls", "quic")
        check_reach(f"the router ({endpoint})", host, secured=secured, insecure=site.router.insecure)
    console = site.console
    host, _ = split_address(console.listen)
    check_page_reach(
        host, accounts=console.accounts is not None, tls=console.tls is not None, insecure=console.insecure
    )


def _unseen_problem(robots: tuple[Robot, ...], unseen: Mapping[str, str]) -> str | None:
    """Return why a robot that requires checks cannot be checked; None if it can.

    Args:
        unseen: By robot, the reason why checks do not cover all of it.
    """
    for robot in robots:
        if robot.check != "require":
            continue
        for other in robots:
            same_cell = other is robot or (robot.cell and other.cell == robot.cell)
            if same_cell and other.name in unseen:
                prefix = "" if other is robot else f"robot {other.name} of its cell: "
                return (
                    f'robot {robot.name}: check = "require": {prefix}{unseen[other.name]}; '
                    '"warn" and "off" are possible'
                )
    return None


def resolve_site(site: Site, folder: Path) -> Site:
    """Return the site with paths relative to a folder."""
    robots = tuple(_resolve_robot(robot, folder) for robot in site.robot)
    fixtures = tuple(
        fixture.model_copy(update={"mesh": folder / fixture.mesh}) if fixture.mesh is not None else fixture
        for fixture in site.fixture
    )
    return site.model_copy(
        update={
            "robot": robots,
            "fixture": fixtures,
            "recorder": site.recorder.model_copy(update={"folder": folder / site.recorder.folder}),
            "define": site.define.model_copy(update={"folder": folder / site.define.folder}),
            "audit": site.audit.model_copy(update={"folder": folder / site.audit.folder}),
            "watch": site.watch.model_copy(update={"folder": folder / site.watch.folder}),
            "programs": site.programs.model_copy(update={"folder": folder / site.programs.folder}),
            "console": resolve_console_paths(site.console, folder),
            **resolve_paths(site.router, site.keys, folder),
        }
    )


def _resolve_robot(robot: Robot, folder: Path) -> Robot:
    paths: dict[str, object] = {}
    if robot.model.endswith((".toml", ".urdf")):
        paths["model"] = str(folder / robot.model)
    if robot.verified is not None:
        paths["verified"] = folder / robot.verified
    for key, value in robot:
        if isinstance(value, Table):
            paths[key] = value.in_folder(folder)
    return robot.model_copy(update=paths)


def _tcp_address(endpoint: str) -> str:
    """Return the HOST:PORT of a router endpoint; empty if it is not TCP."""
    protocol, _, rest = endpoint.partition("/")
    return re.split("[?#]", rest)[0] if protocol in ("tcp", "tls") else ""


# The site without a file: an arm at a workbench. In a checkout the folder robots/ is the program's own, hence
# my-robots/.
DEMO = Site(
    site="demo",
    robot=(Robot(name="pt600", model="pt600", demo=True, cell="demo", check="require"),),
    fixture=(
        Fixture(
            cell="demo",
            name="workbench",  # low enough for the demo's tour: tests/services/test_simulated_motion.py
            box=(400.0, 1200.0, 100.0),
            pose=Pose(xyz=(600.0, 0.0, 50.0)),
            color="#8a8f94",
        ),
    ),
    define=Define(folder=Path("my-robots")),
)
