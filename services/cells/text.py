"""Changes of fixtures and floors in the text of a site file; every other line stays byte for byte.

Only the lines of a changed table are parsed and written again, so that comments and the form of all others
remain. The result is parsed and compared before it is used.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import tomlkit
from pydantic import ValidationError
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Table

from robots.descriptions.description_text import inline_text
from robots.schema.bounded_toml import parse_toml
from services.cells.content import new_values
from services.site_file.site import Site
from services.site_file.tables.fixtures import Fixture, Floor

# A comment behind a header is allowed.
_HEADER = re.compile(r"\s*\[")
_POSE = ("xyz", "rpy")


class TextFormError(Exception):
    """The file writes a table in a form that cannot be changed alone."""


def changed_text(
    text: str, cell: str, fixtures: Sequence[Fixture], floors: Mapping[str, Floor | None]
) -> str:
    """Return a site file's text with other fixtures in a cell, and other floors.

    Args:
        fixtures: All fixtures of the cell; meshes as the file names them.
        floors: New floor of each robot whose `floor` changes, by the robot's name.

    Raises:
        TextFormError: If other lines would have to change, or the result would not have these values.
    """
    values = parse_toml(text)
    lines = text.splitlines(keepends=True)
    newline = "\r\n" if lines and lines[0].endswith("\r\n") else "\n"
    wanted = {fixture.name: fixture for fixture in fixtures}
    before = [Fixture.model_validate(row) for row in values.get("fixture", [])]
    try:
        # From the end, so that the numbers of earlier lines remain.
        edits: list[tuple[int, int, list[str]]] = []
        last = _insert_at(lines, cell, before)
        for fixture, (start, end) in zip(before, _tables(lines, "fixture", len(before)), strict=True):
            if fixture.cell != cell:
                continue
            new = wanted.pop(fixture.name, None)
            if new is None:
                edits.append((start, end, []))
            elif changed := new_values(fixture, new):
                edits.append((start, end, _edited(lines[start:end], "fixture", changed)))
        robots = values.get("robot", [])
        for robot, (start, end) in zip(robots, _tables(lines, "robot", len(robots)), strict=True):
            if robot["name"] in floors:
                floor = {"floor": floor_value(floors[robot["name"]])}
                edits.append((start, end, _edited(lines[start:end], "robot", floor)))
        added = [
            line.replace("\n", newline)
            for new in wanted.values()
            for line in ["\n", *fixture_text(new).splitlines(keepends=True)]
        ]
        if added:
            if last == len(lines) and not lines[-1].endswith("\n"):
                lines[-1] += newline
            edits.append((last, last, added))
        for start, end, table in sorted(edits, key=lambda each: each[:2], reverse=True):
            lines[start:end] = table
    except (TOMLKitError, KeyError, TypeError, AttributeError) as error:
        raise TextFormError(str(error)) from None
    changed_file = "".join(lines)
    _check(values, changed_file, cell, fixtures, floors)
    return changed_file


def _tables(lines: Sequence[str], name: str, count: int) -> list[tuple[int, int]]:
    """Return the first line of each [[name]] table, and the line after its last value.

    Its sub-tables belong to it. Comments and empty lines behind it do not.

    Raises:
        TextFormError: If the file does not have this number of such tables.
    """
    header = re.compile(rf"\s*\[\[\s*{name}\s*\]\]")
    below = re.compile(rf"\s*\[+\s*{name}\s*\.")
    found = []
    for start, line in enumerate(lines):
        if not header.match(line):
            continue
        end = start + 1
        last = end
        while end < len(lines) and (not _is_header(lines[end]) or below.match(lines[end])):
            end += 1
            if lines[end - 1].strip() and not lines[end - 1].lstrip().startswith("#"):
                last = end
        found.append((start, last))
    if len(found) != count:
        raise TextFormError(f"{count} {name}s, of which {len(found)} are tables [[{name}]]")
    return found


def _is_header(line: str) -> bool:
    if not _HEADER.match(line):
        return False
    # A line of a longer list also begins with a bracket.
    try:
        tomllib.loads(line)
    except tomllib.TOMLDecodeError:
        return False
    return True


def _insert_at(lines: Sequence[str], cell: str, fixtures: Sequence[Fixture]) -> int:
    """Return the line before which new fixtures are written: behind the cell's last one, else at the end."""
    tables = _tables(lines, "fixture", len(fixtures))
    of_cell = [end for fixture, (_, end) in zip(fixtures, tables, strict=True) if fixture.cell == cell]
    return of_cell[-1] if of_cell else len(lines)


def _edited(lines: Sequence[str], name: str, values: Mapping[str, Any]) -> list[str]:
    """Return a table's lines with other values; None removes a key."""
    document = tomlkit.parse("".join(lines))
    table: Any = document[name][0]
    for key, value in values.items():
        if value is None or value == ():
            table.pop(key, None)
        elif isinstance(there := table.get(key), Table) and value is not False:
            # A table of its own keeps its comments.
            whole = value if isinstance(value, Mapping) else {"height": value}
            for each in [each for each in there if each not in whole]:
                del there[each]
            for each, part in whole.items():
                if each not in there or there[each].unwrap() != part:
                    there[each] = _item(part)
        elif key not in _POSE:
            table[key] = _item(value)
        elif isinstance(table.get("pose"), Table):
            table["pose"][key] = _item(value)
        else:
            # Written again as a whole, because an addition would lose the blank before the brace.
            before = table["pose"].unwrap() if "pose" in table else {}
            table["pose"] = _item({**before, key: value})
    return _lines(document)


def _lines(document: tomlkit.TOMLDocument) -> list[str]:
    # A value that was parsed alone has no newline behind it.
    text = tomlkit.dumps(document)
    return (text if text.endswith("\n") else f"{text}\n").splitlines(keepends=True)


def _item(value: Any) -> Any:
    text = inline_text(_plain(value))
    return tomlkit.parse(f"value = {text}")["value"]


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, tuple) else value


def fixture_text(fixture: Fixture) -> str:
    """Return a fixture as a table of a site file."""
    empty = Fixture(cell=fixture.cell, name=fixture.name, sphere=1.0)
    values = {key: value for key, value in new_values(empty, fixture).items() if value not in (None, ())}
    pose = {key: list(values.pop(key)) for key in _POSE if key in values}  # type: ignore[call-overload]
    document = tomlkit.document()
    document["cell"], document["name"] = fixture.cell, fixture.name
    if fixture.sphere is not None:
        document["sphere"] = fixture.sphere
    for key, value in values.items():
        if key != "sphere":
            document[key] = _item(value)
    if pose:
        document["pose"] = _item(pose)
    return "".join(["[[fixture]]\n", *_lines(document)])


def floor_value(floor: Floor | None) -> Any:
    """Return a floor as a robot's key has it; None: the default, so no key."""
    if floor is None:
        return False
    if floor == Floor():
        return None
    if not floor.warning and not floor.stop:
        return floor.height
    height = {} if floor.height is None else {"height": floor.height}
    return {**height, "warning": floor.warning, "stop": floor.stop}


def _check(
    before: Mapping[str, Any],
    text: str,
    cell: str,
    fixtures: Sequence[Fixture],
    floors: Mapping[str, Floor | None],
) -> None:
    """Check that a text has the wanted values, and the old ones in every other place.

    Raises:
        TextFormError: If it does not.
    """
    try:
        after = parse_toml(text)
        site = Site.model_validate(after)
    except (tomllib.TOMLDecodeError, ValidationError) as error:
        raise TextFormError(f"the result is not a site file: {error}") from None
    if _others(before, cell, floors) != _others(after, cell, floors):
        raise TextFormError("another value would change")
    there = {fixture.name: fixture for fixture in site.fixture if fixture.cell == cell}
    if there.keys() != {fixture.name for fixture in fixtures} or any(
        new_values(there[fixture.name], fixture) for fixture in fixtures
    ):
        raise TextFormError("the fixtures would not have the wanted values")
    for robot in site.robot:
        if robot.name in floors and robot.floor != floors[robot.name]:
            raise TextFormError("the floor would not have the wanted value")


def _others(values: Mapping[str, Any], cell: str, floors: Mapping[str, Floor | None]) -> Any:
    """Return everything but the fixtures of a cell and the floors that change."""
    robots = [
        {key: value for key, value in robot.items() if key != "floor" or robot["name"] not in floors}
        for robot in values.get("robot", [])
    ]
    fixtures = [fixture for fixture in values.get("fixture", []) if fixture["cell"] != cell]
    return {**values, "robot": robots, "fixture": fixtures}
