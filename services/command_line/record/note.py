"""`robomesh note`: write a note on a robot's time, list its notes, or withdraw one."""

from datetime import UTC, datetime
from typing import Annotated, Any

import typer

from robomesh.client.robot.notes import Note, read_notes, withdraw_note, write_note
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import check_name
from robomesh.wire.session import Session
from services.command_line.record.audit import moment
from services.command_line.terminal import discovery
from services.command_line.terminal.local_time import time_text
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import print_json, print_line
from services.errors import ServiceError

app = command_group()


class NoteOptionError(ServiceError):
    """Options that do not fit together."""


@app.command()
def note(
    robot: Robot,
    text: Annotated[str, typer.Argument(metavar="[TEXT]", help="The note; without it, list the notes.")] = "",
    from_: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="TIME",
            help="The moment or the begin of a range: RFC 3339, 15:04, or 10m (ago); else now.",
        ),
    ] = "",
    to: Annotated[str, typer.Option(metavar="TIME", help="The end of a range.")] = "",
    withdraw: Annotated[str, typer.Option(metavar="ID", help="Withdraw a note of yours.")] = "",
    connect: Connect = DEFAULT_ROUTER,
    operator: Annotated[str, typer.Option(help="The author's name; else yours.")] = "",
    as_json: Json = False,
) -> None:
    """Write a note on a robot's time, list its notes, or withdraw one."""
    if withdraw and (text or from_ or to):
        raise NoteOptionError("--withdraw takes no text and no time: a withdrawn note keeps both")
    if text and to and not from_:
        raise NoteOptionError("--to is the end of a range: give its begin with --from")
    now = datetime.now().astimezone()
    begin, end = _time(from_, now), _time(to, now)
    author = operator or discovery.own_name()

    async def ask() -> list[Note]:
        async with discovery.attached(connect) as session:
            place = await _place(session, robot)
            if withdraw:
                return [await withdraw_note(session, place, withdraw, author=author)]
            if text:
                return [await write_note(session, place, text, begin=begin, end=end, author=author)]
            return await read_notes(session, place, since=begin, until=end)

    for each in (found := discovery.run(ask())):
        if as_json:
            print_json(_values(each))
        else:
            print_line(_line(each))
    if not found and not as_json:
        print_line("no notes")


async def _place(session: Session, text: str) -> tuple[str, str]:
    """Return a robot's site and name; SITE/ROBOT need not be present: its notes are there without it."""
    if "/" in text:
        site, _, robot = text.partition("/")
        return check_name(site, "site"), check_name(robot, "robot")
    return await discovery.find(session, text)


def _time(text: str, now: datetime) -> datetime | None:
    return datetime.fromtimestamp(moment(text, now) * 1e-9, UTC) if text else None


def _line(note: Note) -> str:
    until = f" to {time_text(note.end)}" if note.end else ""
    gone = f"  (withdrawn by {note.withdrawn_by})" if note.withdrawn_by else ""
    return f"{note.id}  {time_text(note.begin)}{until}  {note.author}: {note.text}{gone}"


def _values(note: Note) -> dict[str, Any]:
    """Return a note as JSON values; times are seconds since the Unix epoch."""
    return {
        "id": note.id,
        "site": note.site,
        "robot": note.robot,
        "author": note.author,
        "text": note.text,
        "begin": note.begin.timestamp(),
        "end": note.end.timestamp() if note.end else None,
        "written": note.written.timestamp(),
        "withdrawn_by": note.withdrawn_by,
    }
