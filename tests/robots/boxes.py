"""Cells of boxes with known distances: a post, and two bars that rotate in the plane above it."""

from pathlib import Path

import numpy as np

from robots.descriptions.cells import CellDescription, CellRobot, Fixture
from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import Shape
from robots.schema.poses import rpy_rotation
from robots.shapes.geometry import Geometry, Material, Part
from robots.shapes.solids import Solid, ball, box, moved

# Stretched along x, the bars reach from 0.02 to 0.38 and from 0.42 to 0.78 m, 0.02 m to each side of y = 0,
# from z = 0 to 0.02; the post reaches 0.1 m to each side, and up to 0.125.
_POST = "Shape { geometry Box { size 0.2 0.2 0.25 } }"
_BAR = "Transform { translation -0.2 0 0.01 children Shape { geometry Box { size 0.36 0.04 0.02 } } }"
_JOINT = """
[[joint]]
name = "{name}"
a = 400.0
alpha = 0.0
d = 0.0
limits = [-180.0, 180.0]
max_speed = 90.0
max_acceleration = 360.0
max_jerk = 3600.0
"""
_LOOK = 'link = {{ mesh = "{file}", mesh_scale = 1.0 }}\n'


def bar_arm(folder: Path, more: str = "", *, bare: tuple[str, ...] = ()) -> Path:
    """Write the arm's description file: links base, shoulder and elbow.

    Args:
        bare: Links without a shape.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "post.wrl").write_text(f"#VRML V2.0 utf8\n{_POST}\n")
    (folder / "bar.wrl").write_text(f"#VRML V2.0 utf8\n{_BAR}\n")
    text = 'name = "bars"\n'
    if "base" not in bare:
        text += '[base]\nmesh = "post.wrl"\nmesh_scale = 1.0\n'
    for name in ("shoulder", "elbow"):
        text += _JOINT.format(name=name) + ("" if name in bare else _LOOK.format(file="bar.wrl"))
    path = folder / "robot.toml"
    path.write_text(text + more)
    return path


def one_joint_arm(folder: Path, limit: str, kind: str = "revolute") -> Path:
    """Write the URDF of an arm whose only joint, j1, has a <limit> with these attributes."""
    box = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "arm.urdf"
    path.write_text(
        f'<robot name="arm"><link name="base">{box}</link><link name="tip">{box}</link>'
        f'<joint name="j1" type="{kind}"><parent link="base"/><child link="tip"/><origin xyz="0 0 1"/>'
        f'<axis xyz="0 0 1"/><limit {limit} effort="1"/></joint></robot>'
    )
    return path


def placed(x: float, y: float = 0.0, z: float = 0.0, *, yaw: float = 0.0) -> FloatArray:
    """Return a (4, 4) placement from [m], [rad]."""
    placement = np.eye(4)
    placement[:3, :3] = rpy_rotation(0.0, 0.0, yaw)
    placement[:3, 3] = x, y, z
    return placement


def shape(*solids: Solid) -> Shape:
    """Join solids to one shape, in metres."""
    parts = tuple(Part("", Material(), points, np.zeros_like(points), faces) for points, faces in solids)
    return Shape(Geometry(parts=parts), np.eye(4))


def block(name: str, size: tuple[float, float, float], at: FloatArray, **more: object) -> Fixture:
    """Return a box with its centre at a placement."""
    half = np.array(size) / 2
    return Fixture(name, (shape(box(-half, half)),), at, **more)  # type: ignore[arg-type]


def globe(name: str, radius: float, at: FloatArray) -> Fixture:
    """Return a sphere."""
    return Fixture(name, (shape(ball(radius, 64)),), at)


def bracket(name: str, at: FloatArray, *, exact: bool) -> Fixture:
    """Return a connected U that is open to -x: two cheeks 0.2 m apart, and a back at x = 0."""
    outline = np.array([[-0.5, -0.12], [0.02, -0.12], [0.02, 0.12], [-0.5, 0.12], [-0.5, 0.1], [0.0, 0.1],
                        [0.0, -0.1], [-0.5, -0.1]])  # fmt: skip
    low, high = (np.column_stack([outline, np.full(8, z)]) for z in (-0.1, 0.1))
    walls = [(i, (i + 1) % 8, (i + 1) % 8 + 8, i + 8) for i in range(8)]
    caps = [(0, 1, 6, 7), (1, 2, 5, 6), (2, 3, 4, 5)]
    quads = [*walls, *(tuple(reversed(cap)) for cap in caps), *(tuple(i + 8 for i in cap) for cap in caps)]
    faces = np.array([three for a, b, c, d in quads for three in ((a, b, c), (a, c, d))])
    return Fixture(name, (shape((np.concatenate([low, high]), faces)),), at, exact=exact)


def two_cheeks(name: str, at: FloatArray) -> Fixture:
    """Return two plates 0.2 m apart, in one shape."""
    plate = box(np.array([-0.5, -0.01, -0.1]), np.array([0.0, 0.01, 0.1]))
    return Fixture(name, (shape(moved(plate, placed(0, 0.11)), moved(plate, placed(0, -0.11))),), at)


def cell_of(
    models: dict[str, tuple[Path | str, FloatArray]], fixtures: tuple[Fixture, ...] = ()
) -> CellDescription:
    """Return a cell of robots: name, model and placement of the base."""
    return CellDescription(tuple(CellRobot(name, *how) for name, how in models.items()), fixtures)
