"""`robomesh programs`: the programs that a site stores, with all their versions."""

import json
import os
from collections.abc import Coroutine
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.enum_names import enum_word
from robomesh.contract.keys import ROOT, WHOLE_SITE, check_chunk, check_name, robot_key
from robomesh.contract.messages import to_json
from robomesh.files.atomic_write import write_atomically
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import is_file_title
from robomesh.wire.last_values import last_values
from robomesh.wire.session import Session
from services.command_line.program.commands import program_text
from services.command_line.program.text_diff import unified_diff
from services.command_line.terminal import discovery
from services.command_line.terminal.local_time import time_text
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import print_json, print_line, print_text
from services.errors import ServiceError

app = command_group("programs", "Programs stored at a site: list, show, save, restore, diff, export, import.")

_Name = Annotated[str, typer.Argument(metavar="NAME", help="The program's name, or its id.")]
_Operator = Annotated[str, typer.Option(help="The author's name; else yours.")]
_Version, _Request = schema.ProgramVersion, schema.ProgramRequest
_TIMEOUT_S = 10.0
_ENDING = ".prog"
_LONGEST_NAME = 60  # as in a store
_WORDS = {
    _Version.SAVED: "saved",
    _Version.ASIDE: "put aside",
    _Version.RENAMED: "renamed",
    _Version.RESTORED: "restored",
    _Version.DELETED: "deleted",
    _Version.RUN: "ran, not saved",
}


class StoredProgramError(ServiceError):
    """No stored program has the name, or a file cannot be written."""


class _Store(NamedTuple):
    """The store of a robot's programs, for one command."""

    session: Session
    site: str
    robot: str

    async def programs(self) -> list[schema.StoredProgram]:
        """Return all programs of the robot, deleted ones too."""
        found = await self.session.last(robot_key(self.site, self.robot, "programs"))
        if found is None:
            raise StoredProgramError(
                f"{self.site}/{self.robot}: no store answers (robomesh up starts one), or no such robot"
            )
        assert isinstance(found, schema.ProgramList)
        return list(found.programs)

    async def program(self, name: str) -> schema.StoredProgram:
        """Return a program by its name or id; a deleted one if no other has the name."""
        programs = await self.programs()
        named = [each for each in programs if each.id == name]
        named = named or [each for each in programs if each.current.name == name]
        alive = [each for each in named if not _is_deleted(each)] or named
        if len(alive) > 1:
            ids = ", ".join(each.id for each in alive)
            raise StoredProgramError(f"{name}: is the name of several deleted programs; say which: {ids}")
        if not alive:
            names = ", ".join(each.current.name for each in programs if not _is_deleted(each)) or "none"
            raise StoredProgramError(f"{self.robot} has no program {name!r}; it has: {names}")
        return alive[0]

    async def content(self, name: str, version: int = 0) -> schema.ProgramContent:
        """Return a program's version with its text; 0: the current one."""
        program = await self.program(name)
        return await self.read(schema.ProgramQuery(robot=self.robot, id=program.id, version=version))

    async def read(self, query: schema.ProgramQuery) -> schema.ProgramContent:
        """Return what the store answers."""
        key = robot_key(self.site, WHOLE_SITE, "programs/read")
        answer = await self.session.ask(key, query, timeout_s=_TIMEOUT_S)
        assert isinstance(answer, schema.ProgramContent)
        return answer

    async def change(self, request: schema.ProgramRequest, operator: str) -> schema.ProgramAnswer:
        """Send a request in an operator's name."""
        request.robot = self.robot
        by = check_chunk(operator or discovery.own_name())
        key = robot_key(self.site, WHOLE_SITE, f"programs/request/{by}")
        answer = await self.session.ask(key, request, timeout_s=_TIMEOUT_S)
        assert isinstance(answer, schema.ProgramAnswer)
        return answer

    async def save(self, name: str, text: str, based_on: int, operator: str) -> schema.ProgramAnswer:
        """Save a text as a new program, or as the next version of the program with that name."""
        there = [
            each for each in await self.programs() if each.current.name == name and not _is_deleted(each)
        ]
        request = _Request(action=_Request.SAVE, name=name, text=text)
        if there:
            request.id, request.based_on = there[0].id, based_on or there[0].current.number
        return await self.change(request, operator)


@app.command("list")
def list_(
    robot: Annotated[str, typer.Argument(metavar="[ROBOT]", help="Else the robots of all sites.")] = "",
    deleted: Annotated[bool, typer.Option("--deleted", help="Deleted programs too.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """List programs with their version, author and time."""

    async def collect() -> dict[str, list[schema.StoredProgram]]:
        async with discovery.attached(connect) as session:
            if robot:
                store = await _store(session, robot)
                return {f"{store.site}/{store.robot}": await store.programs()}
            lists = await last_values(session, f"{ROOT}/*/*/programs")
            return {
                "/".join(key.split("/")[1:3]): list(each.programs)
                for key, each in lists.items()
                if isinstance(each, schema.ProgramList)
            }

    found = [
        (name, each)
        for name, programs in discovery.run(collect()).items()
        for each in programs
        if deleted or not _is_deleted(each)
    ]
    if as_json:
        print_json({"programs": [{"robot": name, **_record(each)} for name, each in found]})
        return
    for name, each in found:
        lost = f", deleted: {each.current.reason}" if _is_deleted(each) else ""
        print_line(f"{name}  {each.current.name}  {_line(each.current)}{lost}")
    if not found:
        print_line("no stored programs")


@app.command()
def show(
    robot: Robot,
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="The program's name or id; or a SHA-256 of the audit log.")
    ],
    version: Annotated[int, typer.Option(metavar="N", min=0, help="A version; else the current one.")] = 0,
    versions: Annotated[bool, typer.Option("--versions", help="List the versions, newest first.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Print a program's text, or its versions."""

    async def ask(store: _Store) -> schema.ProgramContent:
        if len(name) == 64 and all(each in "0123456789abcdef" for each in name):
            return await store.read(schema.ProgramQuery(robot=store.robot, sha256=name))
        return await store.content(name, version)

    content = _run(ask, robot, connect)
    if as_json:
        print_json(
            {
                **(_record(content.program) if content.HasField("program") else {}),
                "version": _version(content.version),
                "versions": [_version(each) for each in content.versions],
                "text": content.text,
            }
        )
    elif versions:
        for each in reversed(content.versions):
            reason = f": {each.reason}" if each.reason else ""
            print_line(f"{_line(each)}  {_change(each)} {each.name}{reason}")
    else:
        print_text(content.text)


@app.command()
def save(
    robot: Robot,
    file: Annotated[str, typer.Argument(metavar="FILE", help="The program; - reads standard input.")],
    name: Annotated[str, typer.Option(help="The program's name; else the file's.")] = "",
    based_on: Annotated[
        int, typer.Option(metavar="N", min=0, help="The version that was changed; else the current one.")
    ] = 0,
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Save a file as a new program, or as a new version of the program with its name.

    Exit status 1: the program is no longer at the version --based-on; the text is kept beside it.
    """
    text, title = program_text(file), name or ("" if file == "-" else Path(file).stem)
    if not title:
        raise StoredProgramError("a program from standard input needs a name: --name NAME")
    _changed(lambda store: store.save(title, text, based_on, operator), robot, connect, as_json)


@app.command()
def rename(
    robot: Robot,
    name: _Name,
    new: Annotated[str, typer.Argument(metavar="NEW")],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Rename a program."""
    request = _Request(action=_Request.RENAME, name=new)
    _changed(lambda store: _on_current(store, name, request, operator), robot, connect, as_json)


@app.command()
def delete(
    robot: Robot,
    name: _Name,
    reason: Annotated[str, typer.Option(help="The reason, which every operator sees.")],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Delete a program; all its versions are kept, so that `restore` brings it back."""
    request = _Request(action=_Request.DELETE, reason=reason)
    _changed(lambda store: _on_current(store, name, request, operator), robot, connect, as_json)


@app.command()
def restore(
    robot: Robot,
    name: _Name,
    version: Annotated[int, typer.Argument(metavar="N", min=1, help="The version to bring back.")],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Make an older version's text the newest version; also of a deleted program."""
    request = _Request(action=_Request.RESTORE, version=version)
    _changed(lambda store: _on_current(store, name, request, operator), robot, connect, as_json)


@app.command()
def diff(
    robot: Robot,
    name: _Name,
    old: Annotated[int, typer.Argument(metavar="[OLD]", min=0, help="Else the one before NEW.")] = 0,
    new: Annotated[int, typer.Argument(metavar="[NEW]", min=0, help="Else the current version.")] = 0,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Print the difference of two versions, as `diff -u` does; exit status 1 if they differ."""

    async def ask(store: _Store) -> tuple[schema.ProgramContent, schema.ProgramContent]:
        later = await store.content(name, new)
        before = old or max(later.version.number - 1, 1)
        return await store.content(name, before), later

    sides = _run(ask, robot, connect)
    names = (f"{each.version.name}\tversion {each.version.number}" for each in sides)
    text = unified_diff(*(each.text for each in sides), *names)
    print_text(text)
    if text:
        raise typer.Exit(1)


@app.command("export")
def export(
    robot: Robot,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="The folder; it is made if necessary.")],
    name: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only this program.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite files.")] = False,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Write the current versions of all programs as NAME.prog into a folder."""

    async def ask(store: _Store) -> list[schema.ProgramContent]:
        wanted = name or [each.id for each in await store.programs() if not _is_deleted(each)]
        return [await store.content(each) for each in wanted]

    contents = _run(ask, robot, connect)
    for each in contents:
        # Also a store of another version or maker: "../../x" would be written outside the folder.
        if not is_file_title(each.version.name, _LONGEST_NAME):
            raise StoredProgramError(
                f"{each.version.name!r}: is no file's name; export the other programs with --name"
            )
    files = {folder / f"{each.version.name}{_ENDING}": each.text for each in contents}
    there = [str(path) for path in files if os.path.lexists(path)]
    if there and not force:
        raise StoredProgramError(f"{', '.join(there)}: exists already; --force overwrites it")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, text in files.items():
            write_atomically(path, text.encode(), mode=0o644)
            print_line(str(path))
    except OSError as error:
        raise StoredProgramError(f"{folder}: cannot be written: {error.strerror}") from None


@app.command("import")
def import_(
    robot: Robot,
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Each is named after its file.")],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Save files as programs; a program that has a file's name gets a new version."""
    texts = {path.stem: program_text(str(path)) for path in files}
    if len(texts) < len(files):
        raise StoredProgramError("several files have the same name: import them one by one with save --name")

    async def ask(store: _Store) -> list[schema.ProgramAnswer]:
        return [await store.save(name, text, 0, operator) for name, text in texts.items()]

    for answer in _run(ask, robot, connect):
        _print(answer, as_json)


async def _on_current(
    store: _Store, name: str, request: schema.ProgramRequest, operator: str
) -> schema.ProgramAnswer:
    program = await store.program(name)
    request.id, request.based_on = program.id, program.current.number
    return await store.change(request, operator)


async def _store(session: Session, text: str) -> _Store:
    """Return the store of a robot; SITE/ROBOT need not be present: its programs are there without it."""
    if "/" in text:
        site, _, robot = text.partition("/")
        return _Store(session, check_name(site, "site"), check_name(robot, "robot"))
    return _Store(session, *await discovery.find(session, text))


def _run(ask: Any, robot: str, connect: str) -> Any:
    """Run a coroutine function with the store of a robot."""

    async def run() -> Any:
        async with discovery.attached(connect) as session:
            asked: Coroutine[Any, Any, Any] = ask(await _store(session, robot))
            return await asked

    return discovery.run(run())


def _changed(ask: Any, robot: str, connect: str, as_json: bool) -> None:
    answer = _run(ask, robot, connect)
    _print(answer, as_json)
    if answer.version.change == _Version.ASIDE:
        raise typer.Exit(1)


def _print(answer: schema.ProgramAnswer, as_json: bool) -> None:
    version, current = answer.version, answer.program.current
    if as_json:
        print_json({**_record(answer.program), "version": _version(version)})
        return
    words = f"{version.name}: version {version.number}, {_change(version)}"
    if version.change == _Version.ASIDE:
        words += (
            f": {current.author} has changed it meanwhile (version {current.number}). Compare with `robomesh "
            f"programs diff`, then save on version {current.number}, or restore version {version.number}"
        )
    print_line(words)


def _is_deleted(program: schema.StoredProgram) -> bool:
    return bool(program.current.change == _Version.DELETED)


def _change(version: schema.ProgramVersion) -> str:
    return _WORDS.get(version.change) or f"changed: {enum_word(_Version.Change, version.change)}"


def _line(version: schema.ProgramVersion) -> str:
    return (
        f"version {version.number}  {time_text(version.timestamp)}  {version.author}  {version.bytes} bytes"
    )


def _version(version: schema.ProgramVersion) -> dict[str, Any]:
    """Return a version as JSON values; its time is seconds since the Unix epoch."""
    values: dict[str, Any] = json.loads(to_json(version))
    return {**values, "timestamp": version.timestamp.ToNanoseconds() * 1e-9}


def _record(program: schema.StoredProgram) -> dict[str, Any]:
    return {
        "id": program.id,
        "name": program.current.name,
        "deleted": _is_deleted(program),
        "current": _version(program.current),
    }
