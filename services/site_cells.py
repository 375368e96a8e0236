"""The cells of a site file, as collision checks take them."""

from collections.abc import Mapping
from pathlib import Path

from robots.cells import CellDescription, CellRobot, Fixture
from robots.poses import pose_matrix
from robots.schema import Units
from services import site_fixtures
from services.site import Robot, Site

_MILLIMETRE = 1e-3


def cells_of(site: Site) -> Mapping[str, CellDescription]:
    """The cell of every robot, by the robot's name; a robot without one is alone in its own."""
    together: dict[str, CellDescription] = {}
    for name in {robot.cell for robot in site.robot if robot.cell}:
        together[name] = CellDescription(
            robots=tuple(_robot(site, robot) for robot in site.robot if robot.cell == name),
            fixtures=tuple(_fixture(fixture) for fixture in site.fixture if fixture.cell == name),
        )
    return {
        robot.name: together[robot.cell] if robot.cell else CellDescription(robots=(_robot(site, robot),))
        for robot in site.robot
    }


def _robot(site: Site, robot: Robot) -> CellRobot:
    return CellRobot(
        name=robot.name,
        model=robot.model,
        base_to_site=pose_matrix(robot.pose, Units()),
        # What was defined on the page reads nothing outside its own folder.
        confined=Path(robot.model).absolute().is_relative_to(site.define.folder.absolute()),
        warning_m=robot.clearance.warning * _MILLIMETRE,
        stop_m=robot.clearance.stop * _MILLIMETRE,
    )


def _fixture(fixture: site_fixtures.Fixture) -> Fixture:
    shape = site_fixtures.fixture_shape(fixture)
    return Fixture(
        name=fixture.name,
        shapes=(shape,),
        fixture_to_site=site_fixtures.fixture_to_site(fixture),
        color=shape.color,
        exact=fixture.exact,
        ignore=fixture.ignore,
    )
