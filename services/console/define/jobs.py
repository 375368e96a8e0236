"""The worker's jobs: each takes a draft's folder and a request, and returns JSON values.

`robots` has the logic of robots and meshes; this module converts its results for the page.
"""

import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from robomesh import reason_codes as codes
from robots.bodies.link_pairs import plan_of
from robots.descriptions.description import (
    DESCRIPTION_FILE,
    Problem,
    RobotDescription,
    from_values,
    robot_name,
)
from robots.descriptions.description_text import as_saved
from robots.descriptions.importing import import_as_dh
from robots.descriptions.save_description import read_robot, refused_path
from robots.descriptions.shape_inspection import inspect_shapes
from robots.descriptions.summary import geometry_summary
from robots.kinematics.joints import joints_of
from robots.kinematics.model import RobotModel, build_model, link_placements, tool_placement
from robots.schema.description_checks import named_files
from robots.schema.errors import DescriptionError, ShapeError
from robots.schema.robot_toml import UrdfDescription
from robots.schema.units import position_factor
from robots.shapes.files.read import read_geometry
from robots.shapes.files.unit_guess import guess
from robots.shapes.files.write_glb import glb_of
from robots.shapes.geometry import Geometry
from robots.shapes.surface_points import surface_points
from services.console.common.errors import RefusedRequest
from services.console.define.store import MOST_FILES, Store, put

Json = dict[str, Any]

_MOST_UNZIPPED = 500_000_000
_POINTS = 200  # of a mesh's surface; the page compares those of each two parts


def mesh(store: Store, folder: Path, request: Json) -> Json:
    """Convert a shape file to GLB in the store, in its own units and axes, and summarise it.

    If all of the mesh is in missing files, the result is empty and names them.
    """
    try:
        found = read_geometry(folder / request["file"], within=folder)
    except ShapeError as error:
        if not error.missing:
            raise
        found = Geometry(warnings=(error.reason,), missing=(error.missing,))
    guessed = guess(found)
    return {
        "glb": put(store, glb_of(found)),
        **geometry_summary(found),
        "points": [[float(f"{value:.5g}") for value in point] for point in surface_points(found, _POINTS)],
        "missing": list(found.missing),
        "scale": guessed.scale_m,
        "up": guessed.up,
        "guess": guessed.sentence,
    }


def check(_: Store, folder: Path, request: Json) -> Json:
    """Return every problem of a description, and the placements of its links and tool."""
    values = as_saved(request["description"])
    description, problems = from_values(values, folder=folder, confined=True)
    if description is None:
        # A missing mesh does not prevent computing the placements.
        description, _ignored = from_values(_without_shapes(values), folder=folder, confined=True)
    answer: Json = {"problems": [_problem(each) for each in problems], "tool": None, "links": {}}
    if description is not None:
        model = build_model(description)
        positions = _positions(model, description, request.get("joints"))
        answer["tool"] = tool_placement(model, positions).tolist()
        placements = link_placements(model, positions)
        answer["links"] = dict(zip(model.link_names, placements.tolist(), strict=True))
    return answer


def meshes(_: Store, folder: Path, request: Json) -> Json:
    """Return every mesh of a valid description that cannot be drawn, as a problem with its place."""
    values = request["description"]
    places = {folder / name: place for place, name in named_files(values)}
    found, _odd = inspect_shapes(_description(folder, values))
    problems = []
    for note in found:
        file = Path(note.file)
        name = file.relative_to(folder) if file.is_relative_to(folder) else file.name
        problems.append(_problem(Problem(places.get(file, ()), f"{name}: {note.text}")))
    return {"problems": problems}


def joint_count(_: Store, folder: Path, request: Json) -> Json:
    """Return a description's number of joints."""
    return {"joints": len(joints_of(_description(folder, request["description"])))}


def collisions(_: Store, folder: Path, request: Json) -> Json:
    """Return how each pair of links is checked, or why it is not, like `robot check`.

    The description's own ignored pairs are judged as well: the page marks them as ignored, and can show the
    effect of changing that.
    """
    plan = plan_of(_description(folder, request["description"] | {"collision": {}}))
    return {
        "pairs": [
            {"links": list(each.links), "kind": each.kind, "values": dict(each.values)}
            for each in plan.verdicts
        ]
    }


def unzip(store: Store, folder: Path, request: Json) -> Json:
    """Put the files of a zip archive into the store."""
    files = {}
    try:
        with zipfile.ZipFile(folder / request["file"]) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir()]
            size = sum(entry.file_size for entry in entries)
            if len(entries) > MOST_FILES or size > _MOST_UNZIPPED:
                reason = codes.DEFINE_ZIP_TOO_LARGE(
                    count=len(entries),
                    megabytes=size / 1e6,
                    most=MOST_FILES,
                    most_megabytes=_MOST_UNZIPPED / 1e6,
                )
                raise RefusedRequest(422, reason)
            for entry in entries:
                if reason_of_path := refused_path(entry.filename):
                    raise RefusedRequest(422, reason_of_path)
                # zipfile raises an error if an entry is larger than it declares.
                files[entry.filename] = put(store, archive.read(entry))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, zlib.error, EOFError) as error:
        raise RefusedRequest(422, codes.DEFINE_NOT_ZIP(detail=error)) from None
    return {"files": files}


def import_robot(store: Store, folder: Path, request: Json) -> Json:
    """Convert a URDF to a draft of D-H rows, with each link's shapes as one GLB in the link's frame.

    A robot.toml with its files, from Download zip, is returned as a draft, unless it names a URDF.
    """
    file = request.get("file", "")
    values = request.get("description")
    if PurePosixPath(file).name == DESCRIPTION_FILE:
        inside = PurePosixPath(file).parent
        folder = folder / inside
        values, _ = read_robot(folder)
        if "urdf" not in values:
            files = {
                PurePosixPath(path).relative_to(inside).as_posix(): sha
                for path, sha in request.get("files", {}).items()
                if path != file and PurePosixPath(path).is_relative_to(inside)
            }
            return {"description": values, "files": files, "notes": [], "missing": []}
    values = values or {"name": robot_name(Path(file).stem), "urdf": file}
    description = _description(folder, values)
    if not isinstance(description, UrdfDescription):
        raise RefusedRequest(422, codes.DEFINE_NOT_URDF(file=file))
    found = import_as_dh(description)
    return {
        "description": found.values,
        "files": {path: put(store, content) for path, content in found.files.items()},
        "notes": list(found.notes),
        "missing": list(found.missing),
    }


def _description(folder: Path, values: Json) -> RobotDescription:
    """Return a valid description.

    Raises:
        DescriptionError: If it has problems.
    """
    description, problems = from_values(as_saved(values), folder=folder, confined=True)
    if description is None:
        raise DescriptionError(folder / DESCRIPTION_FILE, [problem.text for problem in problems])
    return description


def _without_shapes(values: Mapping[str, Any]) -> Json:
    without = dict(values)
    if isinstance(values.get("base"), dict):
        without["base"] = {key: each for key, each in values["base"].items() if not key.endswith("mesh")}
    if isinstance(values.get("joint"), list):
        without["joint"] = [
            {**row, "link": {key: each for key, each in row["link"].items() if not key.endswith("mesh")}}
            if isinstance(row, dict) and isinstance(row.get("link"), dict)
            else row
            for row in values["joint"]
        ]
    return without


def _positions(model: RobotModel, description: RobotDescription, given: Any) -> Any:
    """Return joint positions in SI units: the given ones in the file's units, or home."""
    if given is None:
        return model.joints.home
    count = len(model.joints)
    numbers = [each for each in given if isinstance(each, int | float)] if isinstance(given, list) else []
    if len(numbers) != count or len(given) != count or not np.isfinite(numbers).all():
        raise RefusedRequest(422, codes.DEFINE_JOINTS(count=count))
    factors = [position_factor(kind, description.units) for kind in model.joints.types]
    return np.multiply(numbers, factors)


def _problem(problem: Problem) -> Json:
    return {"path": list(problem.path), "text": problem.text}


JOBS: Mapping[str, Callable[[Store, Path, Json], Json]] = {
    "mesh": mesh,
    "check": check,
    "meshes": meshes,
    "joint_count": joint_count,
    "collisions": collisions,
    "import": import_robot,
    "unzip": unzip,
}
