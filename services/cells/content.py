"""Contents of cells as messages: fixtures and the floor, in SI units, to and from the site file's part.

The file has millimetres and degrees. A value that a message carries back is rounded to a nanometre and a
nanodegree, so that 0.1 mm is 0.1 in the file again.
"""

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from pydantic import ValidationError

from protocol_gateway.seam.table import problem_text
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from services.site_file.tables.fixtures import Fixture, Floor
from services.site_file.tables.robot import Robot

_DECIMALS = 6
_DEGREE_DECIMALS = 9
# Most objects in a request: more of them belong into a mesh, and each is a row on the page.
MOST_FIXTURES = 200
MOST_IGNORED = 100
# Further away, or larger, is a mistake in units [mm].
_LARGEST_MM = 1_000_000.0
_Kind = schema.CellChange


def content_of(fixtures: Iterable[Fixture], floor: Floor | None) -> schema.CellContent:
    """Return fixtures and a floor as a message; its fixtures are sorted by name.

    Args:
        floor: None: the cell has no floor.
    """
    content = schema.CellContent()
    for fixture in sorted(fixtures, key=lambda each: each.name):
        content.fixtures.append(_fixture_message(fixture))
    content.floor.none = floor is None
    if floor is not None:
        if floor.height is not None:
            content.floor.height = _metres(floor.height)
        content.floor.warning_distance = _metres(floor.warning)
        content.floor.stop_distance = _metres(floor.stop)
    return content


def version_of(content: schema.CellContent) -> str:
    """Return the SHA-256 of a content (hex), which does not depend on the order of its fixtures."""
    fixtures = sorted(_plain(fixture) for fixture in map(_parsed, content.fixtures))
    floor = _parsed_floor(content.floor)
    row = [fixtures, None if floor is None else floor.model_dump()]
    return hashlib.sha256(json.dumps(row, sort_keys=True).encode()).hexdigest()


def check_limits(content: schema.CellContent, shapes: Sequence[str]) -> None:
    """Check a client's content against limits that a site file does not have.

    Args:
        shapes: Shape files that fixtures may use.

    Raises:
        RefusedError: With the fixture and what is wrong with it.
    """
    if len(content.fixtures) > MOST_FIXTURES:
        raise RefusedError(
            codes.CELL_TOO_MANY(count=len(content.fixtures), what="fixtures", most=MOST_FIXTURES)
        )
    for message in content.fixtures:
        if len(message.ignore) > MOST_IGNORED:
            raise RefusedError(
                codes.CELL_TOO_MANY(count=len(message.ignore), what="ignored links", most=MOST_IGNORED)
            )
        if message.HasField("mesh") and message.mesh.file not in shapes:
            raise RefusedError(codes.CELL_MESH(name=message.name, file=message.mesh.file))
    for fixture in fixtures_of(content):
        if (problem := _size_problem(fixture)) is not None:
            raise RefusedError(codes.CELL_FIXTURE(name=fixture.name, detail=problem))


def fixtures_of(content: schema.CellContent, cell: str = "any") -> tuple[Fixture, ...]:
    """Return the fixtures of a content as the site file's part.

    Raises:
        RefusedError: With the fixture and what is wrong with it.
    """
    found = []
    for message in content.fixtures:
        try:
            found.append(_parsed(message, cell))
        except ValidationError as error:
            raise RefusedError(codes.CELL_FIXTURE(name=message.name, detail=_first_problem(error))) from None
    return tuple(found)


def floor_of(content: schema.CellContent) -> Floor | None:
    """Return the floor of a content; None: the cell has none.

    Raises:
        RefusedError: If a value is invalid.
    """
    try:
        return _parsed_floor(content.floor)
    except ValidationError as error:
        raise RefusedError(codes.CELL_CONTENT(detail=f"floor: {_first_problem(error)}")) from None


def changes(before: schema.CellContent, after: schema.CellContent) -> Iterator[schema.CellChange]:
    """Yield what differs between two contents, as in the site file: millimetres and degrees."""
    olds = {each.name: each for each in map(_parsed, before.fixtures)}
    news = {each.name: each for each in map(_parsed, after.fixtures)}
    for name in sorted(olds.keys() | news.keys()):
        old, new = olds.get(name), news.get(name)
        if old is None or new is None:
            yield _Kind(kind=_Kind.ADDED if old is None else _Kind.REMOVED, fixture=name)
            continue
        for key, value in new_values(old, new).items():
            yield _Kind(
                kind=_Kind.CHANGED, fixture=name, key=key, before=_text(_value(old, key)), after=_text(value)
            )
    old_floor, new_floor = _parsed_floor(before.floor), _parsed_floor(after.floor)
    if old_floor != new_floor:
        yield _Kind(
            kind=_Kind.CHANGED, key="floor", before=_floor_text(old_floor), after=_floor_text(new_floor)
        )


def summary(found: Iterable[schema.CellChange]) -> str:
    """Return changes as one text for events and the audit log."""
    texts = []
    for each in found:
        what = each.fixture or "the cell"
        match each.kind:
            case _Kind.ADDED:
                texts.append(f"{what} added")
            case _Kind.REMOVED:
                texts.append(f"{what} removed")
            case _:
                texts.append(f"{what}: {each.key} {each.before} -> {each.after}")
    return "; ".join(texts)


def new_values(old: Fixture, new: Fixture) -> dict[str, object]:
    """Return the keys of the site file whose values differ, with the new value; None: the key goes.

    `xyz` and `rpy` are keys of `pose`. Values that are equal to a nanometre count as equal.
    """
    rounded = _parsed(_fixture_message(old), old.cell)
    keys = ("box", "cylinder", "sphere", "mesh", "mesh_scale", "xyz", "rpy", "color", "exact", "ignore")
    return {key: _value(new, key) for key in keys if _value(rounded, key) != _value(new, key)}


def member_of(robot: Robot) -> schema.CellMember:
    """Return a robot's settings for display."""
    return schema.CellMember(
        name=robot.name,
        model=Path(robot.model).name,
        xyz=_vector(map(_metres, robot.pose.xyz)),
        rpy=_vector(map(math.radians, robot.pose.rpy)),
        controller=robot.controller,
        protocol=robot.protocol,
        check=robot.check,
        warning_distance=_metres(robot.clearance.warning),
        stop_distance=_metres(robot.clearance.stop),
        stop_proven=bool(robot.proof_of_stop),
    )


# ----------------------------------------------------------------- to messages


def _fixture_message(fixture: Fixture) -> schema.CellFixture:
    message = schema.CellFixture(
        name=fixture.name,
        xyz=_vector(map(_metres, fixture.pose.xyz)),
        rpy=_vector(map(math.radians, fixture.pose.rpy)),
        color=fixture.color or "",
        exact=fixture.exact,
        ignore=fixture.ignore,
    )
    if fixture.box is not None:
        message.box.CopyFrom(_vector(map(_metres, fixture.box)))
    elif fixture.cylinder is not None:
        message.cylinder.radius, message.cylinder.height = map(_metres, fixture.cylinder)
    elif fixture.sphere is not None:
        message.sphere = _metres(fixture.sphere)
    elif fixture.mesh is not None:
        message.mesh.file, message.mesh.scale = str(fixture.mesh), fixture.mesh_scale
    return message


def _vector(values: Iterable[float]) -> schema.Vector3:
    x, y, z = values
    return schema.Vector3(x=x, y=y, z=z)


def _metres(millimetres: float) -> float:
    return millimetres / 1000.0


# --------------------------------------------------------------- from messages


def _parsed(message: schema.CellFixture, cell: str = "any") -> Fixture:
    shape: dict[str, object] = {}
    match message.WhichOneof("shape"):
        case "box":
            shape["box"] = _millimetres(message.box)
        case "cylinder":
            shape["cylinder"] = tuple(
                _millimetre(each) for each in (message.cylinder.radius, message.cylinder.height)
            )
        case "sphere":
            shape["sphere"] = _millimetre(message.sphere)
        case "mesh":
            shape["mesh"], shape["mesh_scale"] = Path(message.mesh.file), message.mesh.scale
    rpy = tuple(
        _plus_zero(round(math.degrees(each), _DEGREE_DECIMALS))
        for each in (message.rpy.x, message.rpy.y, message.rpy.z)
    )
    return Fixture.model_validate(
        {
            "cell": cell,
            "name": message.name,
            "pose": {"xyz": _millimetres(message.xyz), "rpy": rpy},
            "color": message.color or None,
            "exact": message.exact,
            "ignore": tuple(message.ignore),
            **shape,
        }
    )


def _parsed_floor(message: schema.CellFloor) -> Floor | None:
    if message.none:
        return None
    return Floor(
        height=_millimetre(message.height) if message.HasField("height") else None,
        warning=_millimetre(message.warning_distance),
        stop=_millimetre(message.stop_distance),
    )


def _millimetres(vector: schema.Vector3) -> tuple[float, float, float]:
    return _millimetre(vector.x), _millimetre(vector.y), _millimetre(vector.z)


def _millimetre(metres: float) -> float:
    return _plus_zero(round(metres * 1000.0, _DECIMALS))


def _plus_zero(value: float) -> float:
    """Return 0.0 for -0.0, which the file would show with its sign."""
    return value + 0.0


def _size_problem(fixture: Fixture) -> str | None:
    sizes = {
        "pose": fixture.pose.xyz,
        "box": fixture.box or (),
        "cylinder": fixture.cylinder or (),
        "sphere": () if fixture.sphere is None else (fixture.sphere,),
    }
    for key, values in sizes.items():
        for value in values:
            if abs(value) > _LARGEST_MM:
                return f"{key}: {value:g} mm is more than {_LARGEST_MM:g} mm: requests have metres"
    if any(abs(angle) > 360.0 for angle in fixture.pose.rpy):
        return "pose: an angle is more than 360 degrees: requests have radians"
    return None


def _first_problem(error: ValidationError) -> str:
    problem = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in problem["loc"])
    return f"{where}: {problem_text(problem)}" if where else problem_text(problem)


def _plain(fixture: Fixture) -> str:
    row = fixture.model_dump(mode="json", exclude={"cell"})
    return json.dumps(row, sort_keys=True)


def _value(fixture: Fixture, key: str) -> object:
    if key in ("xyz", "rpy"):
        return getattr(fixture.pose, key)
    if key == "mesh":
        return None if fixture.mesh is None else str(fixture.mesh)
    return getattr(fixture, key)


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, float):
        return f"{value:.10g}"
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _floor_text(floor: Floor | None) -> str:
    if floor is None:
        return "false"
    height = "the lowest base" if floor.height is None else _text(floor.height)
    more = (
        f", warning {_text(floor.warning)}, stop {_text(floor.stop)}" if floor.warning or floor.stop else ""
    )
    return f"{height}{more}"
