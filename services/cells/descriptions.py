"""The site file's cells as the collision checker takes them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from robots.descriptions.cells import CellDescription, CellRobot, Fixture, Floor
from robots.schema.poses import pose_matrix
from robots.schema.robot_toml import Units
from services.site_file.site import Site
from services.site_file.tables import fixtures
from services.site_file.tables.robot import Robot

_MILLIMETRE = 1e-3


def cells_of(site: Site) -> Mapping[str, CellDescription]:
    """Return the cell of every robot, by the robot's name; a robot without one is alone in its cell."""
    shared: dict[str, CellDescription] = {}
    for name in {robot.cell for robot in site.robot if robot.cell}:
        robots = [robot for robot in site.robot if robot.cell == name]
        shared[name] = CellDescription(
            robots=tuple(_robot(site, robot) for robot in robots),
            fixtures=tuple(_fixture(fixture) for fixture in site.fixture if fixture.cell == name),
            floor=_floor(robots),
        )
    return {
        robot.name: shared[robot.cell]
        if robot.cell
        else CellDescription(robots=(_robot(site, robot),), floor=_floor([robot]))
        for robot in site.robot
    }


def _floor(robots: Sequence[Robot]) -> Floor | None:
    """Return the floor of a cell: given for one of its robots, or the default."""
    given = [robot.floor for robot in robots if "floor" in robot.model_fields_set]
    floor = given[0] if given else robots[0].floor
    if floor is None:
        return None
    return Floor(
        height_m=None if floor.height is None else floor.height * _MILLIMETRE,
        warning_m=floor.warning * _MILLIMETRE,
        stop_m=floor.stop * _MILLIMETRE,
    )


def _robot(site: Site, robot: Robot) -> CellRobot:
    return CellRobot(
        name=robot.name,
        model=robot.described,
        base_to_site=pose_matrix(robot.pose, Units()),
        # A robot that was defined on the page may only read files in its folder.
        confined=Path(robot.model).absolute().is_relative_to(site.define.folder.absolute()),
        warning_m=robot.clearance.warning * _MILLIMETRE,
        stop_m=robot.clearance.stop * _MILLIMETRE,
    )


def _fixture(fixture: fixtures.Fixture) -> Fixture:
    shape = fixtures.fixture_shape(fixture)
    return Fixture(
        name=fixture.name,
        shapes=(shape,),
        fixture_to_site=fixtures.fixture_to_site(fixture),
        color=shape.color,
        exact=fixture.exact,
        ignore=fixture.ignore,
    )
