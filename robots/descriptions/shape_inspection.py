"""Inspection of a robot's shapes: opens and measures each file."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path, PureWindowsPath

import numpy as np

from robots.descriptions.glb import link_geometry
from robots.kinematics.joints import doubt_notes
from robots.kinematics.kinematic_tree import Shape, tree_of
from robots.schema.errors import ShapeError
from robots.schema.robot_toml import RobotDescription, UrdfDescription, similar
from robots.shapes.geometry import bounds

# A robot's folder has fewer; another one, such as a home, may have millions.
_MOST_FILES, _MOST_HINTS = 5_000, 20
# Plausible size of a part of an arm [m].
_LARGEST_M, _SMALLEST_M = 10.0, 1e-3


@dataclass(frozen=True)
class FileNote:
    """A problem or a warning, with its file."""

    file: str
    text: str


def inspect_shapes(description: RobotDescription) -> tuple[list[FileNote], list[FileNote]]:
    """Return the problems of a robot's shapes and the warnings."""
    problems, warnings = [], []
    if isinstance(description, UrdfDescription):
        source = str(description.source)
        hints = _nearest(description.robot.missing[:_MOST_HINTS], description.source.parent)
        problems += [
            FileNote(source, f"mesh {name!r}: no such file{hints.get(name, '')}")
            for name in description.robot.missing
        ]
        warnings += [FileNote(source, note) for note in (*description.robot.notes, *doubt_notes(description))]
    for link in tree_of(description).links:
        for shape in (*link.shapes, *link.collision):
            if not isinstance(shape.source, Path):
                continue
            file, subject = str(shape.source), f"link {link.name!r}"
            try:
                geometry = link_geometry([shape])
            except ShapeError as error:
                place = f"{error.place}: " if error.place else ""
                problems.append(FileNote(error.source, f"{place}{error.reason}"))
                continue
            warnings += [FileNote(file, warning) for warning in geometry.warnings]
            if geometry.triangle_count == 0:
                if not geometry.wires:
                    problems.append(FileNote(file, f"{subject}: has no triangles, so the link is invisible"))
                continue
            size = float(np.ptp(bounds(geometry), axis=0).max())
            if not _SMALLEST_M <= size <= _LARGEST_M:
                scale = _scale(shape)
                text = f"{subject}: is {size:.3g} m large at {scale:g} m per unit; check mesh_scale"
                warnings.append(FileNote(file, text))
    return problems, warnings


def _nearest(addresses: Sequence[str], folder: Path) -> dict[str, str]:
    """Return hints at files of similar names in the robot's folder, by address."""
    if not addresses:
        return {}
    files = islice((each for each in folder.rglob("*") if each.is_file()), _MOST_FILES)
    names = {each.name.casefold(): each.relative_to(folder).as_posix() for each in files}
    near = {each: similar(PureWindowsPath(each).name.casefold(), names) for each in addresses}
    return {each: f"; did you mean {names[name]!r}?" for each, name in near.items() if name}


def _scale(shape: Shape) -> float:
    return float(np.linalg.norm(shape.shape_to_link[:3, 0]))
