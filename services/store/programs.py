"""All programs of a site: in memory as on the disk, within its quota."""

import secrets
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import reason_codes as codes
from robomesh.contract.keys import check_name as check_robot
from robomesh.errors import KeyNameError, RefusedError
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import (
    ProgramAnswer,
    ProgramContent,
    ProgramList,
    ProgramQuery,
    ProgramRequest,
    ProgramSource,
    ProgramVersion,
)
from services.store.files import DamagedError, ProgramFiles
from services.store.history import ProgramHistory, changed, check_text, name_key, sha256, sorted_by_name
from services.store.settings import MIB

MOST_PROGRAMS = 500
# Texts of one robot that ran without being saved.
MOST_RUNS = 200
# What a version takes besides its text.
_VERSION_BYTES = 512


@dataclass
class _Robot:
    """Programs of one robot; `texts` are the saved versions' texts, by hash, with their bytes."""

    files: ProgramFiles
    programs: dict[str, ProgramHistory] = field(default_factory=dict)
    runs: tuple[ProgramVersion, ...] = ()
    texts: dict[str, int] = field(default_factory=dict)


class ProgramChange(NamedTuple):
    """The answer to a request, and the program's name before; None: nothing has changed."""

    answer: ProgramAnswer
    old_name: str | None


class ProgramStore:
    """Programs of a site. Its methods block on the disk; one at a time may be called.

    Args:
        folder: The site's folder.
        most_bytes: Quota of all saved versions.
        most_run_bytes: Space for texts that ran without being saved.
    """

    def __init__(self, folder: Path, *, most_bytes: int, most_run_bytes: int) -> None:
        self._folder, self._most_bytes, self._most_run_bytes = folder, most_bytes, most_run_bytes
        self._robots: dict[str, _Robot] = {}
        self.saved_bytes = 0

    @property
    def robots(self) -> tuple[str, ...]:
        """Robots that are known: added, or with a folder."""
        return tuple(self._robots)

    @property
    def count(self) -> int:
        """Number of programs that are not deleted."""
        return sum(
            not program.is_deleted for robot in self._robots.values() for program in robot.programs.values()
        )

    def open(self) -> Iterator[Reason]:
        """Read all programs from the disk; yield what is damaged.

        Raises:
            OSError: If the disk refuses.
        """
        for folder in sorted(self._folder.iterdir()):
            if folder.is_dir() and _is_robot(folder.name):
                yield from self._open_robot(folder.name)

    def _open_robot(self, name: str) -> Iterator[Reason]:
        self.add_robot(name)
        robot = self._robots[name]
        for program in robot.files.programs():
            if isinstance(program, DamagedError):
                yield codes.PROGRAMS_DAMAGED(detail=program)
                continue
            robot.programs[program.id] = program
            for version in program.versions:
                self._count(robot, version)
        runs = robot.files.runs()
        if isinstance(runs, DamagedError):
            yield codes.PROGRAMS_DAMAGED(detail=runs)
        else:
            robot.runs = runs
        robot.files.remove_unnamed(frozenset(robot.texts) | {each.sha256 for each in robot.runs})

    def add_robot(self, name: str) -> None:
        """Accept programs of a robot."""
        self._robots.setdefault(name, _Robot(ProgramFiles(self._folder / name)))

    def programs(self, robot: str) -> ProgramList:
        """Return the list to publish."""
        programs = sorted_by_name(self._robots[robot].programs.values())
        return ProgramList(programs=[each.message for each in programs])

    def change(self, asked: ProgramRequest, author: str, at_ns: int) -> ProgramChange:
        """Save, rename, delete or restore a program.

        Raises:
            RefusedError: If the request is not possible; nothing has changed then.
        """
        robot = self._robot(asked.robot)
        if asked.id or asked.action != ProgramRequest.SAVE:
            program = self._program(asked.robot, asked.id)
        else:
            program = ProgramHistory(secrets.token_hex(8))
            if len(robot.programs) >= MOST_PROGRAMS:
                raise RefusedError(codes.PROGRAMS_TOO_MANY(robot=asked.robot, most=MOST_PROGRAMS))
        version = changed(program, asked, author, at_ns)
        if version.number <= len(program.versions):
            return ProgramChange(ProgramAnswer(program=program.message, version=version), None)
        old_name = program.current.name if program.versions else version.name
        if version.change not in (ProgramVersion.DELETED, ProgramVersion.ASIDE):
            self._check_name_is_free(asked.robot, program.id, version.name)
        saved = version.sha256 in robot.texts
        if version.change != ProgramVersion.DELETED:
            self._check_quota(_VERSION_BYTES + (0 if saved else version.bytes))
        is_new_text = not saved and all(run.sha256 != version.sha256 for run in robot.runs)
        program = program.with_version(version)
        try:
            robot.files.write_program(program, asked.text if is_new_text else None)
        except OSError as error:
            raise RefusedError(codes.PROGRAMS_DISK(detail=error.strerror or error)) from None
        robot.programs[program.id] = program
        self._count(robot, version)
        return ProgramChange(ProgramAnswer(program=program.message, version=version), old_name)

    def read(self, asked: ProgramQuery) -> ProgramContent:
        """Return a version with its text, and all versions of its program.

        Raises:
            RefusedError: If there is no such text.
        """
        robot = self._robot(asked.robot)
        if asked.id:
            program = self._program(asked.robot, asked.id)
            content = _content(program, program.version(asked.version))
        elif (found := _by_hash(robot, asked.sha256)) is not None:
            content = found
        else:
            raise RefusedError(codes.PROGRAMS_TEXT(robot=asked.robot, sha256=asked.sha256[:12] or "none"))
        try:
            content.text = robot.files.text(content.version)
        except DamagedError as error:
            raise RefusedError(codes.PROGRAMS_DAMAGED(detail=error)) from None
        return content

    def keep_run(self, robot_name: str, source: ProgramSource) -> None:
        """Keep a text that ran, unless a saved version has it; the oldest texts make room for it.

        Raises:
            RefusedError: If it cannot be kept.
        """
        robot, hash_ = self._robot(robot_name), sha256(check_text(source.text))
        newest = robot.runs[-1] if robot.runs else ProgramVersion()
        if hash_ in robot.texts or (newest.sha256, newest.timestamp) == (hash_, source.timestamp):
            return
        run = ProgramVersion(
            change=ProgramVersion.RUN,
            timestamp=source.timestamp,
            author=source.operator,
            name=source.name or "unnamed",
            sha256=hash_,
            bytes=len(source.text.encode()),
        )
        others = [each for each in robot.runs if each.sha256 != hash_]
        is_new_text = len(others) == len(robot.runs)
        try:
            self._write_runs(robot, [*others, run][-MOST_RUNS:], source.text if is_new_text else None)
            self._make_room()
        except OSError as error:
            raise RefusedError(codes.PROGRAMS_DISK(detail=error.strerror or error)) from None

    # ------------------------------------------------------------------

    def _robot(self, name: str) -> _Robot:
        if name not in self._robots:
            raise RefusedError(codes.PROGRAMS_ROBOT(site=self._folder.name, robot=name))
        return self._robots[name]

    def _program(self, robot: str, id_: str) -> ProgramHistory:
        program = self._robot(robot).programs.get(id_)
        if program is None:
            raise RefusedError(codes.PROGRAMS_UNKNOWN(robot=robot, id=id_ or "without an id"))
        return program

    def _check_name_is_free(self, robot: str, id_: str, name: str) -> None:
        for other in self._robots[robot].programs.values():
            taken = other.id != id_ and not other.is_deleted
            if taken and name_key(other.current.name) == name_key(name):
                raise RefusedError(codes.PROGRAMS_NAME_TAKEN(robot=robot, name=other.current.name))

    def _check_quota(self, more_bytes: int) -> None:
        if self.saved_bytes + more_bytes > self._most_bytes:
            raise RefusedError(codes.PROGRAMS_FULL(most_mib=self._most_bytes / MIB))

    def _count(self, robot: _Robot, version: ProgramVersion) -> None:
        self.saved_bytes += _VERSION_BYTES
        if version.sha256 not in robot.texts:
            robot.texts[version.sha256] = version.bytes
            self.saved_bytes += version.bytes

    def _write_runs(self, robot: _Robot, runs: Iterable[ProgramVersion], text: str | None) -> None:
        before, runs = robot.runs, tuple(runs)
        robot.files.write_runs(runs, text)
        robot.runs = runs
        kept = {each.sha256 for each in runs} | robot.texts.keys()
        for version in before:
            if version.sha256 not in kept:
                robot.files.remove_text(version.sha256)

    def _make_room(self) -> None:
        """Remove the oldest runs of the site beyond the space for them."""
        runs = [(robot, run) for robot in self._robots.values() for run in robot.runs]
        beyond = sum(run.bytes + _VERSION_BYTES for _, run in runs) - self._most_run_bytes
        oldest = deque(sorted(runs, key=lambda each: _ns(each[1].timestamp)))
        while beyond > 0 and oldest:
            robot, run = oldest.popleft()
            self._write_runs(robot, [each for each in robot.runs if each.sha256 != run.sha256], None)
            beyond -= run.bytes + _VERSION_BYTES


def _by_hash(robot: _Robot, hash_: str) -> ProgramContent | None:
    """Return the newest version with a text, else its last run."""
    if hash_ in robot.texts:
        found = [
            (_ns(version.timestamp), program.id, version)
            for program in robot.programs.values()
            for version in program.versions
            if version.sha256 == hash_
        ]
        _, id_, version = max(found, key=lambda each: each[:2])
        return _content(robot.programs[id_], version)
    run = next((each for each in robot.runs if each.sha256 == hash_), None)
    return None if run is None else ProgramContent(version=run)


def _content(program: ProgramHistory, version: ProgramVersion) -> ProgramContent:
    return ProgramContent(program=program.message, versions=program.versions, version=version)


def _ns(at: Timestamp) -> int:
    return at.ToNanoseconds()


def _is_robot(name: str) -> bool:
    try:
        return bool(check_robot(name, "robot"))
    except KeyNameError:
        return False
