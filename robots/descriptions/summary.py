"""Summaries of descriptions and shapes for users and programs, in SI."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from robots.descriptions.urdf_to_dh import dh_form
from robots.kinematics.joints import joints_of
from robots.kinematics.kinematic_tree import Shape, named_frames, tree_of
from robots.kinematics.views import reach, views_of
from robots.schema.errors import DescriptionError
from robots.schema.robot_toml import DhDescription, RobotDescription, UrdfDescription
from robots.schema.units import angle_factor, length_factor
from robots.shapes.geometry import Geometry, bounds


def description_summary(description: RobotDescription) -> dict[str, Any]:
    """Return names, limits, links, views and reach; JSON types only, rad and m."""
    joints = joints_of(description)
    return {
        "name": description.name,
        "title": description.title,
        "provenance": description.provenance,
        "source": str(description.source),
        "reach_m": reach(description),
        "joints": [
            {
                "name": name,
                "type": str(joints.types[index]),
                "lower": float(joints.lower[index]),
                "upper": float(joints.upper[index]),
                "max_speed": float(joints.max_speed[index]),
                "max_acceleration": float(joints.max_acceleration[index]),
                "max_jerk": float(joints.max_jerk[index]),
                "home": float(joints.home[index]),
            }
            for index, name in enumerate(joints.names)
        ],
        "constraints": [
            {
                "joints": list(constraint.names),
                "coefficients": [
                    float(constraint.coefficients[joints.names.index(name)]) for name in constraint.names
                ],
                "lower": constraint.lower,
                "upper": constraint.upper,
            }
            for constraint in joints.constraints
        ],
        "links": [
            {"name": link.name, "meshes": [_shape_name(shape) for shape in link.shapes]}
            for link in tree_of(description).links
        ],
        "dh": dh_summary(description),
        "frames": [
            {"name": name, "link": link, "frame_to_link": placement.tolist()}
            for name, (link, placement) in named_frames(description).items()
        ],
        "views": [view.name for view in views_of(description)],
    }


def dh_summary(description: RobotDescription) -> dict[str, Any] | None:
    """Return the D-H rows in m and rad; of a URDF, of its chain to the tool.

    Returns:
        `rows` with joint, type, a, alpha, d, theta and link; `start`, the pose of the frame in which
        the first row begins, in the base frame; and `notes` on the conversion. None if D-H rows cannot
        describe the robot.
    """
    notes: tuple[str, ...] = ()
    if isinstance(description, UrdfDescription):
        try:
            form = dh_form(description)
        except DescriptionError:
            return None
        notes = form.notes
        description = DhDescription.model_validate(form.values)
    assert isinstance(description, DhDescription)
    length, angle = length_factor(description.units), angle_factor(description.units)
    rows = [
        {
            "joint": row.name,
            "type": str(row.type),
            "a": row.a * length,
            "alpha": row.alpha * angle,
            "d": row.d * length,
            "theta": row.theta * angle,
            "link": row.link_name,
        }
        for row in description.joints
    ]
    pose = description.base.pose
    start = {"xyz": [value * length for value in pose.xyz], "rpy": [value * angle for value in pose.rpy]}
    return {"rows": rows, "start": start, "notes": list(notes)}


def _shape_name(shape: Shape) -> str:
    return shape.source.name if isinstance(shape.source, Path) else "made by the URDF"


def geometry_summary(geometry: Geometry) -> dict[str, Any]:
    """Return triangles, bounds, materials, colours and warnings of a shape file, in its units and axes.

    Colours are sRGB as #rrggbb, or #rrggbbaa if not opaque; vertex colours are counted.
    """
    low, high = bounds(geometry)
    return {
        "triangles": geometry.triangle_count,
        "min": low.tolist(),
        "max": high.tolist(),
        "materials": sorted({part.material.name for part in geometry.parts}),
        "colors": _colors(geometry),
        "warnings": list(geometry.warnings),
    }


def _colors(geometry: Geometry) -> list[str]:
    """Return every colour of the parts, the one with the most triangles first."""
    triangles: Counter[str] = Counter()
    for part in geometry.parts:
        if part.colors is None:
            named = _color(*part.material.diffuse, 1.0 - part.material.transparency)
        else:
            named = f"{len(np.unique(part.colors, axis=0))} by vertex"
        triangles[named] += len(part.triangles)
    return [named for named, _ in triangles.most_common()]


def _color(*rgba: float) -> str:
    text = "".join(f"{round(255 * value):02x}" for value in rgba)
    return f"#{text.removesuffix('ff') if len(text) == 8 else text}"
