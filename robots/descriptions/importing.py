"""Import of a robot from another format as a robot.toml and its files, for `robot import`."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from robots.descriptions.description import ROBOT_FILES, describe_urdf, load, robot_name
from robots.descriptions.glb import collision_glbs, glb_of, link_geometry, link_glbs
from robots.descriptions.urdf.write import collision_beside, glb_beside, tree_urdf
from robots.descriptions.urdf_to_dh import dh_form
from robots.kinematics.joints import doubt_notes
from robots.kinematics.kinematic_tree import tree_of
from robots.schema.bounded_toml import parse_toml
from robots.schema.errors import DescriptionError
from robots.schema.robot_toml import DhDescription, RobotDescription, UrdfDescription
from robots.shapes.files.read import read_geometry


@dataclass(frozen=True, eq=False)
class ImportedRobot:
    """An imported robot, ready to be saved.

    Attributes:
        values: The values of its robot.toml.
        files: Content by path relative to the robot.toml.
        notes: Oddities and changes, a sentence each.
        missing: Shape files that were not found, as the source names them.
    """

    values: dict[str, Any]
    files: dict[str, bytes]
    notes: tuple[str, ...]
    missing: tuple[str, ...]


def import_robot(source: str, *, packages: Sequence[Path] = (), as_dh: bool = False) -> ImportedRobot:
    """Import a robot from a URDF, an OpenHRP VRML file, a robot.toml, or by its library name.

    Args:
        packages: Folders to search for a URDF's `package://` addresses.
        as_dh: Convert the chain to the tool to D-H rows.

    Raises:
        DescriptionError: If the robot has a problem.
        ShapeError: If one of its shapes cannot be read.
    """
    path = Path(source)
    if path.suffix.lower() in ROBOT_FILES:
        values = {"name": robot_name(path.stem), "urdf": path.name}
        folders = [str(folder.absolute()) for folder in packages]
        description = describe_urdf(values | {"packages": folders}, path)
    else:
        description = load(source)
    if isinstance(description, UrdfDescription):
        return import_as_dh(description) if as_dh else _import_urdf(description)
    assert isinstance(description, DhDescription)
    return _copy_description(description)


def _import_urdf(description: UrdfDescription) -> ImportedRobot:
    """Write the tree as a new URDF with GLB shapes; values that URDF cannot hold stay in the robot.toml."""
    shapes = link_glbs(description)
    values = description.model_dump(mode="json", by_alias=True, exclude_unset=True)
    values |= {"urdf": f"{description.name}.urdf", "provenance": _provenance(description)}
    for key in ("packages", "link"):  # package addresses are resolved, link colours are in the GLB
        values.pop(key, None)
    if description.robot.ignored:
        pairs = [*description.collision.ignore, *(pair for pair, _ in description.robot.ignored)]
        values["collision"] = {"ignore": [list(pair) for pair in dict.fromkeys(pairs)]}
    text = tree_urdf(description.name, tree_of(description))
    files = {values["urdf"]: text.encode()} | {glb_beside(link): glb for link, glb in shapes.items()}
    files |= {collision_beside(link): glb for link, glb in collision_glbs(description).items()}
    robot = description.robot
    return ImportedRobot(values, files, (*robot.notes, *doubt_notes(description)), tuple(robot.missing))


def import_as_dh(description: UrdfDescription) -> ImportedRobot:
    """Convert a robot's chain to its tool to D-H rows, and each link's shapes to one GLB.

    Raises:
        DescriptionError: If D-H rows cannot describe the chain.
        ShapeError: If one of its shapes cannot be read.
    """
    form = dh_form(description)
    values, files = dict(form.values), {}
    values["provenance"] = _provenance(description)
    bodies = [values.setdefault("base", {}), *(row["link"] for row in values["joint"])]
    for key, of_links, address in (
        ("mesh", form.shapes, glb_beside),
        ("collision_mesh", form.collision, collision_beside),
    ):
        for (link, shapes), body in zip(of_links.items(), bodies, strict=True):
            if shapes:
                body |= {key: address(link), "mesh_scale": 1.0}
                files[body[key]] = glb_of(link_geometry(shapes))
    robot = description.robot
    notes = (*robot.notes, *doubt_notes(description), *form.notes)
    return ImportedRobot(values, files, notes, tuple(robot.missing))


def _provenance(description: RobotDescription) -> str:
    return description.provenance or f"imported from {description.source.name}"


def _copy_description(description: DhDescription) -> ImportedRobot:
    """Copy a D-H description, its shape files and the files that these name, all below the robot's folder."""
    values = parse_toml(description.text)
    files: dict[str, bytes] = {}
    places: dict[Path, str] = {}
    notes: list[str] = []
    tables = [values.get("base", {}), *(row.get("link", {}) for row in values["joint"])]
    for table, body in zip(tables, description.bodies.values(), strict=True):
        paths = {"mesh": description.mesh_path(body), "collision_mesh": description.collision_path(body)}
        for key, path in paths.items():
            if path is None:
                continue
            if path not in places:
                places[path] = _path_in_robot(str(table[key]), set(files))
                files[places[path]] = _bytes(path)
                folder = description.folder_around(path)
                geometry = read_geometry(path, within=folder)
                notes += [_missing_file_note(path, places[path], name, folder) for name in geometry.missing]
                notes += _copy_references(path, places[path], geometry.files, files)
            table[key] = places[path]
    return ImportedRobot(values, files, tuple(notes), ())


def _missing_file_note(path: Path, place: str, address: str, folder: Path) -> str:
    if Path(os.path.normpath(path.resolve().parent / address)).is_relative_to(folder.resolve()):
        return f"{place} names {address!r}, which does not exist"
    return f"{place} names {address!r}, which is outside of the robot's folder; it is not copied"


def _copy_references(
    path: Path, place: str, others: Sequence[Path], files: dict[str, bytes]
) -> Iterator[str]:
    """Add the files that a shape file names, with the same path relative to its copy.

    Yields:
        A note on each file that cannot be copied.
    """
    for other in dict.fromkeys(others):
        if not other.is_file():
            continue
        address = os.path.relpath(other, path.resolve().parent)
        there = PurePosixPath(os.path.normpath(PurePosixPath(place).parent / Path(address).as_posix()))
        if there.parts[0] == "..":
            yield f"{place} names {address!r}, which is outside of the robot's folder; it is not copied"
            continue
        content = _bytes(other)
        if files.setdefault(str(there), content) != content:
            yield f"{place} names {address!r}, and so does another mesh for another file; one is copied"


def _path_in_robot(file: str, taken: set[str]) -> str:
    """Return an unused path for a shape below the robot's folder; unchanged if possible."""
    path = PurePosixPath(file)
    if path.is_absolute() or ".." in path.parts:
        path = PurePosixPath("meshes", path.name)
    wanted, number = path, 2
    while str(path) in taken:
        path = wanted.with_stem(f"{wanted.stem}-{number}")
        number += 1
    return str(path)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise DescriptionError(path, [f"cannot be read: {error.strerror}"]) from error
