"""The site file's part on cells: fixtures, and the clearance of an arm.

Degrees and millimetres in the file, SI in the shapes that come of it.
"""

import math
import re
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, StrictBool, field_validator, model_validator

from robomesh.contract import keys
from robomesh.errors import KeyNameError
from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import Shape, rgb
from robots.schema.errors import ShapeError
from robots.schema.poses import pose_matrix
from robots.schema.robot_toml import Pose, Positive, Units, nearest
from robots.schema.toml_table import TomlTable
from robots.shapes.geometry import Geometry, Material, Part
from robots.shapes.normals import creased
from robots.shapes.solids import ball, box, turned

_ROUND = 48
_MILLIMETRE = 1e-3
_SHAPES = ("box", "cylinder", "sphere", "mesh")
Distance = Annotated[float, Field(strict=True, ge=0, le=10_000)]


class Clearance(TomlTable):
    """Distances between an arm and its surroundings.

    Attributes:
        warning: Below this distance a check warns [mm].
        stop: Below this distance a check fails, and `check = "require"` refuses the motion [mm].
    """

    warning: Distance = 50.0
    stop: Distance = 10.0

    @model_validator(mode="after")
    def _order(self) -> "Clearance":
        if self.stop > self.warning:
            raise ValueError(
                f"stop = {self.stop:g} is more than warning = {self.warning:g}: a warning comes first"
            )
        return self


class Floor(TomlTable):
    """The floor below a cell.

    Attributes:
        height: Height in the site's frame [mm]; absent: that of the lowest base in the cell.
        warning: Below this distance of an arm from it a check warns [mm]. With 0 only contact counts.
        stop: Below this distance a check fails [mm].
    """

    height: Annotated[float, Field(strict=True, ge=-100_000, le=100_000)] | None = None
    warning: Distance = 0.0
    stop: Distance = 0.0

    @model_validator(mode="after")
    def _order(self) -> "Floor":
        if self.stop > self.warning:
            raise ValueError(
                f"stop = {self.stop:g} is more than warning = {self.warning:g}: a warning comes first"
            )
        return self


class Fixture(TomlTable):
    """A static object in a cell: exactly one shape, `box`, `cylinder`, `sphere` or `mesh`.

    Attributes:
        cell: Name of its cell.
        name: Name, unique at the site: its frame is `<site>/<fixture>`.
        box: Lengths along its x, y and z [mm].
        cylinder: Radius, and height along its z [mm].
        sphere: Radius [mm].
        mesh: A mesh file.
        mesh_scale: The mesh file's unit [m].
        pose: Pose of its centre (of a mesh: of its origin) in the site's frame.
        color: Colour, as in `"#8a8f94"`; absent: the mesh's own colours.
        exact: Checked as the mesh itself, not as its convex hull: slower, but an arm may reach into it.
        ignore: Links that may touch it, as `"<robot>/<link>"`.
    """

    cell: str
    name: str
    box: tuple[Positive, Positive, Positive] | None = None
    cylinder: tuple[Positive, Positive] | None = None
    sphere: Positive | None = None
    mesh: Path | None = None
    mesh_scale: Positive = 0.001
    pose: Pose = Pose()
    color: str | None = None
    exact: StrictBool = False
    ignore: tuple[str, ...] = ()

    @field_validator("color")
    @classmethod
    def _color(cls, color: str | None) -> str | None:
        if color is not None and not re.fullmatch("#[0-9a-fA-F]{6}", color):
            raise ValueError('should be as in "#8a8f94"')
        return color

    @field_validator("name")
    @classmethod
    def _name(cls, name: str) -> str:
        try:
            return keys.check_name(name, "fixture")
        except KeyNameError as error:
            raise ValueError(str(error)) from None

    @model_validator(mode="after")
    def _one_shape(self) -> "Fixture":
        given = [name for name in _SHAPES if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"{' and '.join(given) or 'no shape'} given: must be exactly one of {', '.join(_SHAPES)}"
            )
        return self


def fixture_shape(fixture: Fixture) -> Shape:
    """Return a fixture's shape in its own frame [m].

    Round shapes are slightly too large, not too small: their flat faces touch the true surface.
    """
    color = None if fixture.color is None else rgb(fixture.color)
    if fixture.mesh is not None:
        scale = fixture.mesh_scale
        # Files that the mesh refers to are read from its own folder only, as for every external mesh.
        folder = fixture.mesh.absolute().parent
        return Shape(fixture.mesh, np.diag([scale, scale, scale, 1.0]), color, within=folder)
    rounder = 1.0 / math.cos(math.pi / _ROUND)
    if fixture.box is not None:
        half = np.array(fixture.box) * _MILLIMETRE / 2
        solid = box(-half, half)
    elif fixture.cylinder is not None:
        radius, height = np.array(fixture.cylinder) * _MILLIMETRE
        around, half_height = float(radius) * rounder, float(height) / 2
        profile = [(0.0, -half_height), (around, -half_height), (around, half_height), (0.0, half_height)]
        solid = turned(profile, _ROUND)
    else:
        assert fixture.sphere is not None
        solid = ball(fixture.sphere * _MILLIMETRE * rounder**2, _ROUND)
    vertices, normals, triangles = creased(*solid, math.pi / 6)
    return Shape(Geometry(parts=(Part("", Material(), vertices, normals, triangles),)), np.eye(4), color)


def fixture_to_site(fixture: Fixture) -> FloatArray:
    """Return a fixture's pose as a (4, 4) transform [m]."""
    return pose_matrix(fixture.pose, Units())


def name_problem(fixtures: tuple[Fixture, ...], cells: dict[str, str]) -> str | None:
    """Return the first error in the names and cells of fixtures, or None.

    Args:
        cells: The cell of each robot, by the robot's name; empty for a robot without one.
    """
    taken = {name: f"robot {name}" for name in cells}
    for fixture in fixtures:
        # Unique in the whole site, because a fixture's frame is <site>/<fixture>.
        if other := taken.get(fixture.name):
            return f"{other} and fixture {fixture.cell}/{fixture.name} have one name: each needs its own"
        taken[fixture.name] = f"fixture {fixture.cell}/{fixture.name}"
        if fixture.cell not in cells.values() or not fixture.cell:
            there = ", ".join(sorted({cell for cell in cells.values() if cell}))
            return (
                f"fixture {fixture.name}: no robot has cell = {fixture.cell!r}: "
                f"{f'there are {there}' if there else 'no robot of this site has a cell'}"
            )
        inside = [robot for robot, cell in cells.items() if cell == fixture.cell]
        for pair in fixture.ignore:
            robot, _, link = pair.partition("/")
            if robot not in inside or not link:
                return (
                    f"fixture {fixture.name}: ignore {pair!r}: should be <robot>/<link> "
                    f"with a robot of its cell, {', '.join(inside)}"
                )
    return None


def fixture_problem(fixtures: tuple[Fixture, ...], links: dict[str, dict[str, bool]]) -> str | None:
    """Return the first error in the meshes and ignored links of fixtures, or None.

    Each mesh is read, and its GLB is cached for the service that publishes it.

    Args:
        links: Links of each robot, by the robot's name.
    """
    from robots.descriptions.glb import shapes_glb

    for fixture in fixtures:
        for robot, _, link in (pair.partition("/") for pair in fixture.ignore):
            if link not in links[robot]:
                hint = nearest(link, links[robot])
                return f"fixture {fixture.name}: ignore: {robot} has no link {link!r}{hint}"
        if fixture.mesh is not None:
            shape = fixture_shape(fixture)
            try:
                shapes_glb((shape,))
                missing = _missing_part(fixture.mesh, shape.within)
            except ShapeError as error:
                return f"fixture {fixture.name}: mesh = {str(fixture.mesh)!r}: {error}"
            if missing:
                return (
                    f"fixture {fixture.name}: mesh = {str(fixture.mesh)!r} refers to {missing!r}, "
                    "which is not in its folder: a check would not see that part"
                )
    return None


def _missing_part(mesh: Path, within: Path | None) -> str:
    """Return a shape file that this one refers to and that cannot be read; empty if there is none.

    Only the VRML reader goes on without such a file; the others refuse the mesh.
    """
    from robots.shapes.files.read import READERS, read_geometry

    if READERS.get(mesh.suffix.lower()) is not READERS[".wrl"]:
        return ""
    missing = read_geometry(mesh, within=within).missing
    return next((each for each in missing if Path(each).suffix.lower() in READERS), "")
