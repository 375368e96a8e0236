"""A robot's `description` message: everything that renderer, page and monitors need to show it."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.cells import CellDescription, CellRobot, Fixture
from robots.descriptions.description import RobotDescription
from robots.descriptions.glb import shapes_glb
from robots.kinematics.joints import FloatArray, JointType, joints_of
from robots.kinematics.kinematic_tree import color_text, named_frames, tree_of
from robots.kinematics.views import views_of
from robots.schema.robot_toml import DhDescription, TitledJoint, UrdfDescription

_TYPES = {
    JointType.ROTARY: schema.Description.Joint.ROTARY,
    JointType.PRISMATIC: schema.Description.Joint.PRISMATIC,
}


@dataclass(frozen=True, eq=False)
class FixtureShape:
    """A fixture with its shape as GLB."""

    fixture: Fixture
    glb: bytes

    @property
    def name(self) -> str:
        """Name of its `mesh/<name>`; the prefix avoids a clash with a link of the same name."""
        return f"fixture.{self.fixture.name}"


def fixture_shapes(cell: CellDescription) -> tuple[FixtureShape, ...]:
    """Return a cell's fixtures with their shapes.

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    return tuple(FixtureShape(fixture, shapes_glb(fixture.shapes)) for fixture in cell.fixtures)


def describe(
    description: RobotDescription,
    *,
    urdf: str,
    shapes: Mapping[str, bytes],
    base_to_site: FloatArray,
    cell: str,
    simulated: bool,
) -> schema.Description:
    """Return the `description` message of a robot.

    Args:
        shapes: GLB bytes by link name; links without a shape are absent.
        base_to_site: (4, 4) placement of the base in the site's frame.
    """
    message = schema.Description(
        name=description.name,
        title=description.title or description.name,
        title_zh=description.title_zh,
        provenance=description.provenance,
        provenance_zh=description.provenance_zh,
        robot_toml=description.text,
        urdf=urdf,
        base_to_site=base_to_site.ravel().tolist(),
        cell=cell,
        simulated=simulated,
    )
    _add_joints(message, description)
    _add_links(message, description, shapes)
    _add_frames(message, description)
    _add_views(message, description)
    return message


def add_surroundings(
    message: schema.Description,
    robot: CellRobot,
    cell: CellDescription,
    fixtures: Sequence[FixtureShape],
    version: str = "",
) -> None:
    """Add the fixtures, the floor and the clearance distances of a robot's cell.

    Args:
        version: The gateway's version of them.
    """
    message.cell_version = version
    for each in fixtures:
        color = each.fixture.color
        message.fixtures.add(
            name=each.fixture.name,
            mesh=each.name,
            mesh_sha256=hashlib.sha256(each.glb).hexdigest(),
            fixture_to_site=each.fixture.fixture_to_site.ravel().tolist(),
            color=color_text(color) if color is not None else "",
        )
    message.floor.SetInParent()
    height_m = cell.floor_m
    if cell.floor is not None and height_m is not None:
        message.floor.height = height_m
        message.floor.warning_distance = cell.floor.warning_m
        message.floor.stop_distance = cell.floor.stop_m
    if len(cell.robots) > 1 or fixtures:
        message.warning_distance, message.stop_distance = robot.warning_m, robot.stop_m


def _add_joints(message: schema.Description, description: RobotDescription) -> None:
    """Add the joints and the constraints between them."""
    joints = joints_of(description)
    assert isinstance(description, DhDescription | UrdfDescription)
    titled: dict[str, TitledJoint] = {row.name: row for row in description.joints}
    for index, name in enumerate(joints.names):
        message.joints.add(
            name=name,
            type=_TYPES[joints.types[index]],
            lower=joints.lower[index],
            upper=joints.upper[index],
            max_speed=joints.max_speed[index],
            home=joints.home[index],
            max_acceleration=joints.max_acceleration[index],
            max_jerk=joints.max_jerk[index],
            title=titled[name].title if name in titled else "",
            title_zh=titled[name].title_zh if name in titled else "",
        )
    for constraint in joints.constraints:
        message.constraints.add(
            joints=constraint.names,
            coefficients=[constraint.coefficients[joints.names.index(name)] for name in constraint.names],
            lower=constraint.lower,
            upper=constraint.upper,
        )


def _add_links(
    message: schema.Description, description: RobotDescription, shapes: Mapping[str, bytes]
) -> None:
    for link in tree_of(description).links:
        glb = shapes.get(link.name)
        colors = {shape.color for shape in link.shapes if shape.color is not None}
        message.links.add(
            name=link.name,
            mesh=link.name if glb is not None else "",
            mesh_sha256=hashlib.sha256(glb).hexdigest() if glb is not None else "",
            color=color_text(colors.pop()) if len(colors) == 1 else "",
        )


def _add_views(message: schema.Description, description: RobotDescription) -> None:
    for view in views_of(description):
        projection = schema.View.ORTHOGRAPHIC if view.orthographic else schema.View.PERSPECTIVE
        message.views.add(
            name=view.name,
            eye=_vector(view.eye),
            target=_vector(view.target),
            up=_vector(view.up),
            projection=projection,
        )


def _add_frames(message: schema.Description, description: RobotDescription) -> None:
    for name, (link, frame_to_link) in named_frames(description).items():
        message.frames.add(name=name, link=link, frame_to_link=frame_to_link.ravel().tolist())


def _vector(values: FloatArray) -> schema.Vector3:
    x, y, z = values.tolist()
    return schema.Vector3(x=x, y=y, z=z)
