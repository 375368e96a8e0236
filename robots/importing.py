"""Robots from elsewhere as a robot.toml and its files: what `robot import` writes."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from robots.bounded_toml import parse_toml
from robots.description import ROBOT_FILES, described, load, robot_name
from robots.errors import DescriptionError
from robots.glb import collision_meshes, glb_of, link_mesh, link_meshes
from robots.kinematic_tree import tree_of
from robots.meshes.read import read_mesh
from robots.schema import DhDescription, RobotDescription, UrdfDescription
from robots.urdf.write import collision_beside, glb_beside, tree_urdf
from robots.urdf_to_dh import dh_form


@dataclass(frozen=True, eq=False)
class Imported:
    """A robot ready to be saved.

    Attributes:
        values: Of its robot.toml.
        files: Content by path beside the robot.toml.
        notes: What was odd or changed on the way, a sentence each.
        missing: Mesh files that were not found, as the source names them.
    """

    values: dict[str, Any]
    files: dict[str, bytes]
    notes: tuple[str, ...]
    missing: tuple[str, ...]


def imported(source: str, *, packages: Sequence[Path] = (), as_dh: bool = False) -> Imported:
    """A robot from a URDF, an OpenHRP VRML file, a robot.toml, or by its library name.

    Args:
        packages: Folders in which a URDF's `package://` is looked for.
        as_dh: The chain to the tool as D-H rows, whatever it is described by.

    Raises:
        DescriptionError: If the robot cannot be used as it is.
        MeshError: If one of its meshes cannot be read.
    """
    path = Path(source)
    if path.suffix.lower() in ROBOT_FILES:
        values = {"name": robot_name(path.stem), "urdf": path.name}
        folders = [str(folder.absolute()) for folder in packages]
        description = described(values | {"packages": folders}, path)
    else:
        description = load(source)
    if isinstance(description, UrdfDescription):
        return as_rows(description) if as_dh else _urdf(description)
    assert isinstance(description, DhDescription)
    return _copied(description)


def _urdf(description: UrdfDescription) -> Imported:
    """The tree as URDF anew, its meshes as GLB; what a URDF cannot say stays in the robot.toml."""
    meshes = link_meshes(description)
    values = description.model_dump(mode="json", by_alias=True, exclude_unset=True)
    values |= {"urdf": f"{description.name}.urdf", "provenance": _provenance(description)}
    for gone in ("packages", "link"):  # found, and painted into the GLB
        values.pop(gone, None)
    if description.robot.ignored:
        pairs = [*description.collision.ignore, *(pair for pair, _ in description.robot.ignored)]
        values["collision"] = {"ignore": [list(pair) for pair in dict.fromkeys(pairs)]}
    text = tree_urdf(description.name, tree_of(description))
    files = {values["urdf"]: text.encode()} | {glb_beside(link): glb for link, glb in meshes.items()}
    files |= {collision_beside(link): glb for link, glb in collision_meshes(description).items()}
    robot = description.robot
    return Imported(values, files, tuple(robot.notes), tuple(robot.missing))


def as_rows(description: UrdfDescription) -> Imported:
    """A robot's chain to its tool as D-H rows, each link's shapes as one GLB.

    Raises:
        DescriptionError: If rows cannot say it.
        MeshError: If one of its meshes cannot be read.
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
                files[body[key]] = glb_of(link_mesh(shapes))
    robot = description.robot
    return Imported(values, files, (*robot.notes, *form.notes), tuple(robot.missing))


def _provenance(description: RobotDescription) -> str:
    return description.provenance or f"imported from {description.source.name}"


def _copied(description: DhDescription) -> Imported:
    """A description by D-H rows with its mesh files, and those that they name, all below its folder."""
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
                places[path] = _inside(str(table[key]), set(files))
                files[places[path]] = _bytes(path)
                folder = description.folder_around(path)
                mesh = read_mesh(path, within=folder)
                notes += [_not_read(path, places[path], name, folder) for name in mesh.missing]
                notes += _copied_beside(path, places[path], mesh.files, files)
            table[key] = places[path]
    return Imported(values, files, tuple(notes), ())


def _not_read(path: Path, place: str, address: str, folder: Path) -> str:
    if Path(os.path.normpath(path.resolve().parent / address)).is_relative_to(folder.resolve()):
        return f"{place} names {address!r}, which is not there"
    return f"{place} names {address!r}, which is outside of the robot's folder; it is not copied"


def _copied_beside(path: Path, place: str, others: Sequence[Path], files: dict[str, bytes]) -> Iterator[str]:
    """Add the files that a mesh file names, as far from its copy as they are from it; notes on others."""
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
            yield f"{place} names {address!r}, as another mesh names another file; one is copied"


def _inside(mesh: str, taken: set[str]) -> str:
    """A mesh's path below the robot's folder: its own where it is one."""
    path = PurePosixPath(mesh)
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
