"""Inspection of a robot's meshes: opens and measures each file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robots.errors import MeshError
from robots.glb import link_mesh
from robots.kinematic_tree import Shape, tree_of
from robots.meshes.mesh import bounds
from robots.schema import RobotDescription, UrdfDescription

# Plausible size of a part of an arm [m].
_LARGEST_M, _SMALLEST_M = 10.0, 1e-3


@dataclass(frozen=True)
class Finding:
    """A problem or a warning, with its file."""

    file: str
    text: str


def mesh_findings(description: RobotDescription) -> tuple[list[Finding], list[Finding]]:
    """Return the problems of a robot's meshes and the warnings."""
    problems, warnings = [], []
    if isinstance(description, UrdfDescription):
        source = str(description.source)
        problems += [Finding(source, f"mesh {name!r}: no such file") for name in description.robot.missing]
        warnings += [Finding(source, note) for note in description.robot.notes]
    for link in tree_of(description).links:
        for shape in (*link.shapes, *link.collision):
            if not isinstance(shape.mesh, Path):
                continue
            file, subject = str(shape.mesh), f"link {link.name!r}"
            try:
                mesh = link_mesh([shape])
            except MeshError as error:
                place = f"{error.place}: " if error.place else ""
                problems.append(Finding(error.source, f"{place}{error.reason}"))
                continue
            warnings += [Finding(file, warning) for warning in mesh.warnings]
            if mesh.triangle_count == 0:
                if not mesh.wires:
                    problems.append(Finding(file, f"{subject}: has no triangles, so the link is invisible"))
                continue
            size = float(np.ptp(bounds(mesh), axis=0).max())
            if not _SMALLEST_M <= size <= _LARGEST_M:
                scale = _scale(shape)
                text = f"{subject}: is {size:.3g} m large at {scale:g} m per unit; check mesh_scale"
                warnings.append(Finding(file, text))
    return problems, warnings


def _scale(shape: Shape) -> float:
    return float(np.linalg.norm(shape.shape_to_link[:3, 0]))
