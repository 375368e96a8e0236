"""A description for people and programs: what it says and what follows from it, in SI."""

from typing import Any

from robots.joints import joints_of
from robots.meshes.mesh import Mesh, bounds
from robots.schema import RobotDescription
from robots.views import reach, views_of


def description_summary(description: RobotDescription) -> dict[str, Any]:
    """Names, limits, links, views and reach; JSON types only, rad and m."""
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
            {"name": name, "mesh": body.mesh, "color": body.color}
            for name, body in description.bodies.items()
        ],
        "frames": [frame.name for frame in description.frames],
        "views": [view.name for view in views_of(description)],
    }


def mesh_summary(mesh: Mesh) -> dict[str, Any]:
    """Triangles, bounds, materials and warnings of a mesh file, in its own units and axes."""
    low, high = bounds(mesh)
    return {
        "triangles": mesh.triangle_count,
        "min": low.tolist(),
        "max": high.tolist(),
        "materials": sorted({part.material.name for part in mesh.parts}),
        "warnings": list(mesh.warnings),
    }
