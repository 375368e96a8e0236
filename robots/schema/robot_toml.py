"""Schema of a robot.toml: its tables and keys, in the file's units.

The default units are degrees and millimetres, as on data sheets. `joints`, `model` and `views` of
`robots.kinematics` convert to SI.

Source: Chen, Zhang, Xue 2001, section 3.3 (the description file of the model definition program).
"""

import difflib
import os
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    PrivateAttr,
    StringConstraints,
    model_validator,
)
from pydantic_core import PydanticCustomError

from robots.schema.toml_table import TomlTable

BASE_LINK = "base"
TOOL_FRAME = "tool"

ROBOT_NAME = r"^[a-z0-9][a-z0-9_-]*$"
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
# Strict: "90" and true are not numbers.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
Triple = tuple[Number, Number, Number]
Range = tuple[Number, Number]
Color = Annotated[str, StringConstraints(pattern=r"^#[0-9a-fA-F]{6}$")]


class JointType(StrEnum):
    """The D-H parameter that varies: theta (rotary) or d (prismatic)."""

    ROTARY = "rotary"
    PRISMATIC = "prismatic"


class _Table(TomlTable):
    """A table of the file; an error of an unknown key names the nearest known one."""

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, values: Any) -> Any:
        keys = [field.alias or name for name, field in cls.model_fields.items()]
        unknown = [key for key in values if key not in keys] if isinstance(values, dict) else []
        if unknown:
            raise PydanticCustomError(
                "unknown_key",
                "{text}",
                {"key": unknown[0], "text": f"unknown key{nearest(unknown[0], keys)}"},
            )
        return values


class Units(_Table):
    """The file's units of length and angle; speeds are these per second."""

    length: Literal["mm", "m"] = "mm"
    angle: Literal["deg", "rad"] = "deg"


class Pose(_Table):
    """A placement: translation, then roll, pitch and yaw about the fixed x, y and z axes.

    Attributes:
        xyz: Translation along x, y and z, in the file's unit of length.
        rpy: Roll, pitch and yaw, in the file's unit of angle.
    """

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)


class Body(_Table):
    """A link's shape file and colour.

    Attributes:
        mesh: File, relative to the description's folder; None: the link is not drawn.
        collision_mesh: File that collision checks use in place of `mesh`.
        mesh_scale: Metres per unit of both files.
        mesh_pose: Pose of both shapes in the link's frame.
        color: Colour of the materials named "paint", or of all materials if none has this name; None keeps
            the shape's colours.
    """

    mesh: str | None = None
    collision_mesh: str | None = None
    mesh_scale: Positive = 0.001
    mesh_pose: Pose = Pose()
    color: Color | None = None


class Base(Body):
    """The base link and the frame in which the D-H rows begin.

    Attributes:
        pose: Pose of that frame in the base link's frame; its z is the first joint's axis.
    """

    pose: Pose = Pose()


class Link(Body):
    """The link that a joint moves; by default it has the joint's name."""

    name: Name | None = None


class TitledJoint(_Table):
    """A joint's identifier, and its titles for people.

    Attributes:
        title: Title in English; empty: the name.
        title_zh: Title in Chinese; empty: `title`.
    """

    name: Name
    title: str = ""
    title_zh: str = ""


class Joint(TitledJoint):
    """A joint, its standard D-H row and the link that it moves.

    `link to previous link = Rot(z, theta) Trans(0, 0, d) Trans(a, 0, 0) Rot(x, alpha)`. The joint's position
    is added to theta of a rotary joint and to d of a prismatic one.
    """

    type: JointType = JointType.ROTARY
    a: Number
    alpha: Number
    d: Number
    theta: Number = 0.0
    limits: Range
    max_speed: Positive
    max_acceleration: Positive
    max_jerk: Positive
    home: Number = 0.0
    link: Link = Link()

    @property
    def link_name(self) -> str:
        """Name of the link that the joint moves."""
        return self.link.name or self.name


class Frame(Pose):
    """A named frame on a link, for example of a sensor or a mounting face."""

    name: Name
    link: Name


class Constraint(_Table):
    """A limit on a sum: lower <= sum of coefficient x joint position <= upper."""

    joints: dict[str, Number]
    limits: Range


class View(_Table):
    """A camera, in the base frame; parallel or perspective."""

    eye: Triple
    target: Triple
    up: Triple = (0.0, 0.0, 1.0)
    projection: Literal["orthographic", "perspective"] = "perspective"


class Collision(_Table):
    """Pairs of links that are never checked against each other."""

    ignore: tuple[tuple[str, str], ...] = ()


class JointSettings(TitledJoint):
    """Values of a URDF's joint that URDF does not have, and limits tighter than the URDF's."""

    limits: Range | None = None
    max_speed: Positive | None = None
    max_acceleration: Positive | None = None
    max_jerk: Positive | None = None
    home: Number | None = None


class StatedModel(_Table):
    """A robot whose site file states limits of its joints.

    Attributes:
        model: Source for `robots.descriptions.description.load`.
        joints: Limits and speeds in degrees and millimetres; they replace those of the description.
    """

    model: str
    joints: tuple[JointSettings, ...]


# Source of a robot's description.
Model = str | Path | StatedModel


class LinkColor(_Table):
    """The colour of a link of a URDF."""

    name: Name
    color: Color


class UrdfTool(Pose):
    """The tool's frame on a link of a URDF, by default its end link."""

    link: Name | None = None


class RobotDescription(_Table):
    """A robot's description file, in the file's units: the values that both forms have.

    Attributes:
        title_zh, provenance_zh: In Chinese; empty: `title` and `provenance`.
    """

    name: Annotated[str, StringConstraints(pattern=ROBOT_NAME)]
    title: str = ""
    title_zh: str = ""
    provenance: str = ""
    provenance_zh: str = ""
    units: Units = Units()
    tool: Pose = Pose()
    frames: tuple[Frame, ...] = Field((), alias="frame")
    constraints: tuple[Constraint, ...] = Field((), alias="constraint")
    views: dict[Name, View] = Field(default_factory=dict, alias="view")
    collision: Collision = Collision()

    _source: Path = PrivateAttr(Path())
    _text: str = PrivateAttr("")
    _within: Path | None = PrivateAttr(None)

    @property
    def source(self) -> Path:
        """The file that the description was read from."""
        return self._source

    @property
    def text(self) -> str:
        """The file's text."""
        return self._text

    @property
    def within(self) -> Path | None:
        """The only folder whose files may be read for the description; None: any folder."""
        return self._within

    def folder_around(self, file: Path) -> Path:
        """Return the only folder whose files may be read when a file of the description names them.

        It is the smallest folder that holds both the file and the description, or its ROS package.
        """
        if self._within is not None:
            return self._within
        home, file_folder = self._source.resolve().parent, file.resolve().parent
        package = next((each for each in (home, *home.parents) if (each / "package.xml").is_file()), home)
        around = Path(os.path.commonpath([package, file_folder]))
        # A shape of a package installed elsewhere shares only the root folder with the description.
        return file_folder if around == Path(around.anchor) else around

    def confined_to(self, folder: Path) -> Self:
        """Return a copy for which only files below a folder are read."""
        copy = self.model_copy()
        copy._within = folder
        return copy

    def read_from(self, source: Path, text: str) -> Self:
        """Return a copy with its source file and text."""
        copy = self.model_copy()
        copy._source = source
        copy._text = text
        return copy


class DhDescription(RobotDescription):
    """A serial arm, described by D-H rows."""

    base: Base = Base()
    joints: tuple[Joint, ...] = Field(alias="joint")

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links, base first."""
        return (BASE_LINK, *(joint.link_name for joint in self.joints))

    @property
    def bodies(self) -> dict[str, Body]:
        """Each link's body by link name, base first."""
        return {BASE_LINK: self.base} | {joint.link_name: joint.link for joint in self.joints}

    def mesh_path(self, body: Body) -> Path | None:
        """Return the path of a body's shape file; None without one."""
        return self._in_folder(body.mesh)

    def collision_path(self, body: Body) -> Path | None:
        """Return the path of a body's separate collision shape; None without one."""
        return self._in_folder(body.collision_mesh)

    def _in_folder(self, name: str | None) -> Path | None:
        return None if name is None else self._source.parent / name


class UrdfDescription(RobotDescription):
    """A robot, described by a URDF and the values that URDF does not have.

    Attributes:
        urdf: The file, relative to the description's folder.
        packages: Folders to search for `package://` addresses, relative to the description's folder.
    """

    urdf: str
    packages: tuple[str, ...] = ()
    joints: tuple[JointSettings, ...] = Field((), alias="joint")
    links: tuple[LinkColor, ...] = Field((), alias="link")
    tool: UrdfTool = UrdfTool()

    _robot: Any = PrivateAttr(None)

    def with_robot(self, robot: Any) -> Self:
        """Return a copy with its URDF's content (a `robots.descriptions.urdf.read.UrdfRobot`)."""
        copy = self.model_copy()
        copy._robot = robot
        return copy

    @property
    def robot(self) -> Any:
        """The URDF's content: a `robots.descriptions.urdf.read.UrdfRobot`."""
        return self._robot


def nearest(name: str, names: Iterable[str]) -> str:
    """Return a hint for the end of an error text: the most similar known name, or all of them."""
    names = tuple(names)
    near = similar(name, names)
    return f"; did you mean {near!r}?" if near else f"; there are {', '.join(names)}"


def similar(name: str, names: Iterable[str]) -> str:
    """Return the most similar known name; empty if none is similar."""
    return next(iter(difflib.get_close_matches(name, tuple(names), n=1)), "")
