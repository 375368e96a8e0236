"""The cells of a site file, for the gateway that changes them and the services that follow."""

import os
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import ValidationError

from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.files.atomic_write import write_atomically
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.cells import CellDescription
from robots.descriptions.description import load
from robots.kinematics.kinematic_tree import tree_of
from robots.schema.bounded_toml import MOST_CHARACTERS, parse_toml
from services.cells import content as cell_content
from services.cells.descriptions import cells_of
from services.cells.text import TextFormError, changed_text
from services.site_file.site import Site, resolve_site
from services.site_file.tables.fixtures import Fixture, Floor, fixture_problem, name_problem
from services.site_file.tables.robot import Robot

# Ending of the file that the last change replaced.
PREVIOUS = ".1"


class CellFile:
    """Fixtures and floors of a site's cells, as the site file gives them, and their changes.

    Args:
        path: The site file; None: changes cannot be saved.
        site: Its content, as loaded.
    """

    def __init__(self, path: Path | None, site: Site) -> None:
        # A link to the file remains a link.
        self._path = None if path is None else path.resolve()
        self._folder = Path() if path is None else path.parent
        self._site = site
        self._text, self._written = "", site
        # What <file>.1 had before the last `save`; None: there was none.
        self._older: str | None = None
        if self._path is not None:
            try:
                self._text = _read(self._path)
                self._written = _site_of(self._text)
            except (OSError, ValueError):
                self._text = ""
            if not self._text or resolve_site(self._written, self._folder) != site:
                # Changed while it was loaded: `save` reports it.
                self._text, self._written = "", site

    @property
    def name(self) -> str:
        """Name of the file; empty: there is none."""
        return "" if self._path is None else self._path.name

    def robots(self, robot: str) -> list[Robot]:
        """Return the robots of a robot's cell, itself included."""
        (own,) = (each for each in self._written.robot if each.name == robot)
        return [each for each in self._written.robot if each.cell == own.cell] if own.cell else [own]

    def cell(self, robot: str) -> str:
        """Return the name of a robot's cell; empty: it is alone."""
        return self.robots(robot)[0].cell

    def members(self, robot: str) -> list[schema.CellMember]:
        """Return the settings of the robots of a robot's cell."""
        return [cell_content.member_of(each) for each in self.robots(robot)]

    def meshes(self) -> list[str]:
        """Return the shape files that fixtures may use: those that the site file names."""
        return sorted({str(each.mesh) for each in self._written.fixture if each.mesh is not None})

    def content(self, robot: str) -> schema.CellContent:
        """Return the content of a robot's cell."""
        return self._content(self._written, robot)

    def previous(self, robot: str) -> schema.CellContent | None:
        """Return the content of a robot's cell before the last change of the file; None: unknown."""
        if self._path is None:
            return None
        try:
            before = _site_of(_read(self._previous_path))
            content = self._content(before, robot)
        except (OSError, ValueError):
            return None
        return None if content == self.content(robot) else content

    def problem(self, robot: str) -> Reason | None:
        """Return why the cell of a robot cannot be changed; None: it can."""
        if self._path is None:
            return codes.CELL_NO_FILE(robot=robot)
        if not os.access(self._path, os.W_OK) or not os.access(self._path.parent, os.W_OK):
            return codes.CELL_READ_ONLY(file=self.name)
        try:
            there = _read(self._path)
        except (OSError, ValueError) as error:
            return codes.CELL_DISK(file=self.name, detail=_detail(error))
        return None if self._text and there == self._text else codes.CELL_FILE_CHANGED(file=self.name)

    def changes(self, before: schema.CellContent, after: schema.CellContent) -> list[schema.CellChange]:
        """Return what differs between two contents, as in the site file."""
        return [*cell_content.changes(before, after)]

    def summary(self, changes: Sequence[schema.CellChange]) -> str:
        """Return changes as one text for events and the audit log."""
        return cell_content.summary(changes)

    def describe(self, robot: str, content: schema.CellContent) -> tuple[str, CellDescription]:
        """Return the version of a content, and what motions are checked against.

        Raises:
            RefusedError: If the content is invalid.
        """
        site = self._with(robot, content)
        cell = self.cell(robot)
        links = {
            each.name: {link.name: bool(link.checked) for link in tree_of(load(each.model)).links}
            for each in self._site.robot
            if each.name in {member.name for member in self.robots(robot)}
        }
        fixtures = tuple(fixture for fixture in site.fixture if fixture.cell == cell and cell)
        if problem := fixture_problem(fixtures, links):
            raise RefusedError(codes.CELL_CONTENT(detail=problem))
        return cell_content.version_of(content), cells_of(site)[robot]

    def normal(self, robot: str, content: schema.CellContent) -> schema.CellContent:
        """Return a content with the values that the file would have.

        Raises:
            RefusedError: If it is invalid.
        """
        cell_content.check_limits(content, self.meshes())
        fixtures = cell_content.fixtures_of(content)
        return cell_content.content_of(fixtures, cell_content.floor_of(content))

    def save(self, robot: str, content: schema.CellContent) -> None:
        """Write the content of a robot's cell; keep the file before it as <file>.1.

        Raises:
            RefusedError: If the file cannot be changed; then it has its old content.
        """
        if (problem := self.problem(robot)) is not None:
            raise RefusedError(problem)
        assert self._path is not None
        text = self._undone(robot, content) or self._changed(robot, content)
        try:
            self._older = _read(self._previous_path)
        except (OSError, ValueError):
            self._older = None
        self._write(self._previous_path, self._text)
        self._write(self._path, text)
        self._text, self._written = text, _site_of(text)

    def restore(self) -> None:
        """Write the file back as it was before the last `save`.

        Raises:
            RefusedError: If that is not possible.
        """
        assert self._path is not None
        try:
            text = _read(self._previous_path)
            written = _site_of(text)
            if _read(self._path) != self._text:
                raise RefusedError(codes.CELL_FILE_CHANGED(file=self.name))
        except (OSError, ValueError) as error:
            raise RefusedError(codes.CELL_DISK(file=self.name, detail=_detail(error))) from None
        self._write(self._path, text)
        self._text, self._written = text, written
        if self._older is None:
            self._previous_path.unlink(missing_ok=True)
        else:
            self._write(self._previous_path, self._older)

    # ------------------------------------------------------------------ texts

    @property
    def _previous_path(self) -> Path:
        assert self._path is not None
        return self._path.with_name(self._path.name + PREVIOUS)

    def _changed(self, robot: str, content: schema.CellContent) -> str:
        fixtures, floors = self._parts(robot, content)
        try:
            return changed_text(self._text, self.cell(robot), fixtures, floors)
        except (TextFormError, ValueError):
            raise RefusedError(codes.CELL_FILE_FORM(file=self.name)) from None

    def _undone(self, robot: str, content: schema.CellContent) -> str:
        """Return the previous text, with its comments, if it has this content and is otherwise equal."""
        _, floors = self._parts(robot, content)
        try:
            text = _read(self._previous_path)
            before = _site_of(text)
            if self._content(before, robot) != content:
                return ""
            cell = self.cell(robot)
            names = {each.name for each in self.robots(robot)} if floors else set()
            return text if _rest(before, cell, names) == _rest(self._written, cell, names) else ""
        except (OSError, ValueError, RefusedError):
            return ""

    def _write(self, path: Path, text: str) -> None:
        assert self._path is not None
        try:
            mode = stat.S_IMODE(self._path.stat().st_mode)
            write_atomically(path, text.encode(), mode=mode)
        except OSError as error:
            raise RefusedError(codes.CELL_DISK(file=self.name, detail=_detail(error))) from None

    # ---------------------------------------------------------------- contents

    def _content(self, site: Site, robot: str) -> schema.CellContent:
        """Return a cell's content in a site.

        Raises:
            ValueError: If the site has no such robot.
        """
        own = next((each for each in site.robot if each.name == robot), None)
        if own is None:
            raise ValueError(f"no robot {robot}")
        robots = [each for each in site.robot if each.cell == own.cell] if own.cell else [own]
        fixtures = [each for each in site.fixture if own.cell and each.cell == own.cell]
        given = [each for each in robots if "floor" in each.model_fields_set]
        return cell_content.content_of(fixtures, (given or robots)[0].floor)

    def _parts(
        self, robot: str, content: schema.CellContent
    ) -> tuple[tuple[Fixture, ...], Mapping[str, Floor | None]]:
        """Return a content's fixtures, and the floor of each robot whose key changes.

        Raises:
            RefusedError: If the content is invalid.
        """
        cell = self.cell(robot)
        fixtures = cell_content.fixtures_of(content, cell)
        if fixtures and not cell:
            raise RefusedError(codes.CELL_NO_CELL(robot=robot))
        floor = cell_content.floor_of(content)
        if floor == cell_content.floor_of(self.content(robot)):
            return fixtures, {}
        robots = self.robots(robot)
        given = [each for each in robots if "floor" in each.model_fields_set]
        return fixtures, {each.name: floor for each in given or robots[:1]}

    def _with(self, robot: str, content: schema.CellContent) -> Site:
        """Return the site with another content of a robot's cell, with resolved paths.

        Raises:
            RefusedError: If the content is invalid.
        """
        cell = self.cell(robot)
        fixtures, floors = self._parts(robot, content)
        others = tuple(each for each in self._written.fixture if each.cell != cell)
        robots = tuple(
            each.model_copy(update={"floor": floors[each.name]}) if each.name in floors else each
            for each in self._written.robot
        )
        if problem := name_problem((*others, *fixtures), {each.name: each.cell for each in robots}):
            raise RefusedError(codes.CELL_CONTENT(detail=problem))
        changed = self._written.model_copy(update={"fixture": (*others, *fixtures), "robot": robots})
        if self._path is None or self._written is self._site:
            return changed
        return resolve_site(changed, self._folder)


def _rest(site: Site, cell: str, names: set[str]) -> Site:
    """Return a site without what a change of a cell may change."""
    robots = tuple(
        each.model_copy(update={"floor": None}) if each.name in names else each for each in site.robot
    )
    fixtures = tuple(each for each in site.fixture if each.cell != cell)
    return site.model_copy(update={"robot": robots, "fixture": fixtures})


def _read(path: Path) -> str:
    with path.open(encoding="utf-8", newline="") as file:
        return file.read(MOST_CHARACTERS + 1)


def _site_of(text: str) -> Site:
    """Return the content of a site file's text.

    Raises:
        ValueError: If it is not valid.
    """
    try:
        return Site.model_validate(parse_toml(text))
    except ValidationError as error:
        raise ValueError(str(error)) from None


def _detail(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
