"""`robomesh recordings list` and `info`: the recordings of all sites, and the content of one."""

import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from robomesh import reason_codes as codes
from robomesh.client.recordings.descriptions import (
    RecordingInfo,
    describe_recording,
    find_recording,
    list_recordings,
)
from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.enum_names import enum_word
from robomesh.contract.messages import to_json
from robomesh.errors import RobomeshError, SessionError
from robomesh.recordings.errors import RecordingError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import for_terminal
from robomesh.wire.session import Session
from services.command_line.terminal import discovery
from services.command_line.terminal.local_time import local_time, time_text
from services.command_line.terminal.options import Connect, Json
from services.command_line.terminal.output import print_json, print_line
from services.export.errors import ExportError

NamedRecording = Annotated[
    str, typer.Argument(metavar="[SITE/]NAME", help="A name or file from `list`; not that of several.")
]
RecordingSource = Annotated[
    str,
    typer.Argument(metavar="FILE.mcap|[SITE/]NAME", help="A file of this machine, or a name from `list`."),
]
_Change = schema.RecordingChange


def list_(
    deleted: Annotated[bool, typer.Option("--deleted", help="Deleted recordings too.")] = False,
    tag: Annotated[list[str] | None, typer.Option(metavar="TAG", help="Only with this tag.")] = None,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """List the recordings of every site, newest first."""
    wanted = {each.casefold() for each in tag or ()}

    async def main() -> list[RecordingInfo]:
        async with discovery.attached(connect) as session:
            return await list_recordings(session, deleted=deleted, on_silent=_report_silent)

    recordings = [
        each for each in discovery.run(main()) if wanted <= {tagged.casefold() for tagged in each.tags}
    ]
    for each in recordings:
        each.message.site = each.site
        if as_json:
            show(each.message, as_json)
    if not as_json:
        _print_table([each.message for each in recordings])


def _print_table(recordings: list[schema.Recording]) -> None:
    if not recordings:
        print_line("no recordings")
        return
    rows = [("recorded", "length", "size", "robot", "name", "")]
    for each in recordings:
        rows.append(
            (
                time_text(each.start) if each.HasField("start") else "-",
                f"{each.duration.ToNanoseconds() * 1e-9:.1f} s",
                f"{each.bytes / 1e6:.1f} MB",
                _robot(each),
                for_terminal(each.name or each.file) + (f" part {each.part}" if each.part else ""),
                "; ".join(filter(None, (_state(each), for_terminal(", ".join(each.tags))))),
            )
        )
    whole, length, size, robot, name, _ = (max(map(len, column)) for column in zip(*rows, strict=True))
    for row in rows:
        columns = (
            row[0].ljust(whole),
            row[1].rjust(length),
            row[2].rjust(size),
            row[3].ljust(robot),
            row[4].ljust(name),
            row[5],
        )
        print_line("  ".join(columns).rstrip())
    print_line("robomesh recordings info NAME shows the content of one")


async def found(session: Session, what: str, *, closed: bool = False, only: bool = False) -> RecordingInfo:
    """Return the newest recording that `[SITE/]NAME` or `[SITE/]FILE` names.

    Args:
        closed: Skip recordings that are still being written.
        only: Refuse a name that several recordings have.

    Raises:
        ExportError: If no recording has the name.
        RecordingError: If several have it, and `only`.
    """
    try:
        return await find_recording(session, what, closed=closed, only=only, on_silent=_report_silent)
    except RecordingError as error:
        if error.code == codes.RECORDING_AMBIGUOUS.name:
            raise
        raise ExportError(
            f"no recording {what!r}, neither a file of this machine nor in robomesh recordings list"
        ) from None


def _report_silent(site: str, error: RobomeshError) -> None:
    print_line(f"robomesh: without the recordings of {site}: {error}", err=True)


@asynccontextmanager
async def attached_for(what: str, router: str) -> AsyncIterator[Session]:
    """Open a session to look for a recording that is not a file of this machine.

    Raises:
        ExportError: If no router answers.
    """
    try:
        async with discovery.attached(router) as session:
            yield session
    except SessionError as error:
        raise ExportError(f"{what}: no such file on this machine, and no mesh to search: {error}") from None


def info(what: RecordingSource, connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """Show a recording's topics, message counts, losses and attachments."""

    async def ask() -> schema.Recording:
        async with attached_for(what, connect) as session:
            listed = await found(session, what)
            asker = session.own_name
            return await RecorderFile(session, listed.recorder_site, listed.file, asker=asker).describe()

    path = Path(what)
    show(describe_recording(path).message if path.is_file() else discovery.run(ask()), as_json)


def show(recording: schema.Recording, as_json: bool) -> None:
    """Print one recording: a line, then its content."""
    values = _values(recording)
    if as_json:
        print_json(values)
        return
    state = _state(recording)
    part = f" part {recording.part}" if recording.part else ""
    print_line(
        for_terminal(f"{recording.name or recording.file}{part}  ") + f"{_robot(recording)}  "
        f"{time_text(recording.start)}, {values['duration_s']:.1f} s, {recording.bytes / 1e6:.2f} MB"
        + (f"  ({state})" if state else "")
    )
    print_line(f"    file: {recording.file}")
    if recording.tags:
        print_line(f"    tags: {', '.join(recording.tags)}")
    for line in recording.note.splitlines():
        print_line(f"    note: {line}")
    for change in recording.history:
        print_line(f"    {_change_line(change)}")
    if recording.HasField("audit_head"):
        print_line(f"    audit log: entry {values['audit_head']['number']}, {values['audit_head']['hash']}")
    for each in recording.merged_from:
        print_line(f"    from {_source(each)}")
    if recording.cause:
        print_line(f"    saved because of: {recording.cause}")
    if recording.attachments:
        print_line(f"    attached: {', '.join(recording.attachments)}")
    for topic in recording.topics:
        lost = f", {topic.lost} lost" if topic.lost else ""
        print_line(f"    {topic.topic}: {topic.messages}{_rate(topic, values['duration_s'])}{lost}")


def _change_line(change: schema.RecordingChange) -> str:
    words = f"{time_text(change.timestamp)}  {change.author} "
    match change.change:
        case _Change.RENAMED:
            return f"{words}renamed it to {change.name}"
        case _Change.NOTED:
            return f"{words}changed the note"
        case _Change.TAGGED:
            return f"{words}changed the tags: {', '.join(change.tags) or 'none'}"
        case _Change.DELETED:
            return f"{words}deleted it: {change.reason} ({change.bytes} bytes, SHA-256 {change.sha256})"
        case _:
            return f"{words}changed it: {enum_word(_Change.Change, change.change)}"


def _state(recording: schema.Recording) -> str:
    if recording.deleted:
        newest = recording.history[-1] if recording.history else schema.RecordingChange()
        return for_terminal(f"deleted by {newest.author}: {newest.reason}")
    if recording.open:
        return "recording now"
    if recording.merged_from:
        count = len(recording.merged_from)
        merged = "a recording merged with other topics" if count == 1 else f"merged from {count} recordings"
        return f"{merged}; {recording.problem}" if recording.problem else merged
    return recording.problem or ("recovered" if recording.recovered else "")


def _robot(recording: schema.Recording) -> str:
    if recording.robot:
        return f"{recording.site}/{recording.robot}"
    return "several robots" if recording.merged_from else "no robot"


def _source(recording: schema.Recording) -> str:
    """Return one line about a recording in a merged file; files of earlier versions have no times."""
    words = f"{_robot(recording)} {recording.name}"
    if recording.part:
        words += f" part {recording.part}"
    if recording.HasField("start"):
        words += f", {time_text(recording.start)}"
    if recording.HasField("duration"):
        words += f", {recording.duration.ToNanoseconds() * 1e-9:.1f} s"
    if lost := sum(topic.lost for topic in recording.topics):
        words += f", {lost} lost"
    return words + (", recovered" if recording.recovered else "")


def _rate(topic: schema.Recording.TopicCount, duration_s: float) -> str:
    """Return the rate of a video topic, as text; empty for other topics."""
    return (
        f", {topic.messages / duration_s:.1f} pictures/s" if "/video/" in topic.topic and duration_s else ""
    )


def _start(recording: schema.Recording) -> datetime:
    return local_time(recording.start)


def summary(recording: schema.Recording) -> str:
    """Return one line about a finished recording: length, size, losses, file."""
    lost = sum(topic.lost for topic in recording.topics)
    part = f" part {recording.part}" if recording.part else ""
    return (
        f"{recording.name}{part}: {recording.duration.ToNanoseconds() * 1e-9:.1f} s, "
        f"{recording.bytes / 1e6:.2f} MB, {f'{lost} messages lost' if lost else 'nothing lost'}, "
        f"file {recording.file} in the folder of {recording.site}'s recorder"
    )


def _source_values(recording: schema.Recording) -> dict[str, Any]:
    start = _start(recording) if recording.HasField("start") else None
    length_s = recording.duration.ToNanoseconds() * 1e-9 if recording.HasField("duration") else None
    return {
        "name": recording.name,
        "site": recording.site,
        "robot": recording.robot,
        "part": recording.part,
        "start": start.isoformat(timespec="milliseconds") if start else None,
        "duration_s": length_s,
        "recovered": recording.recovered,
        "lost": sum(topic.lost for topic in recording.topics),
    }


def _change_values(change: schema.RecordingChange) -> dict[str, Any]:
    """Return a change as JSON values; its time is seconds since the Unix epoch."""
    values: dict[str, Any] = json.loads(to_json(change))
    return {**values, "timestamp": change.timestamp.ToNanoseconds() * 1e-9}


def _values(recording: schema.Recording) -> dict[str, Any]:
    return {
        "name": recording.name,
        "site": recording.site,
        "robot": recording.robot,
        "file": recording.file,
        "start": _start(recording).isoformat(timespec="milliseconds"),
        "duration_s": recording.duration.ToNanoseconds() * 1e-9,
        "bytes": recording.bytes,
        "open": recording.open,
        "problem": recording.problem,
        "cause": recording.cause,
        "part": recording.part,
        "note": recording.note,
        "tags": list(recording.tags),
        "deleted": recording.deleted,
        "changes": [_change_values(each) for each in recording.history],
        "recovered": recording.recovered,
        "merged_from": [_source_values(each) for each in recording.merged_from],
        "attachments": list(recording.attachments),
        "audit_head": {"number": recording.audit_head.number, "hash": recording.audit_head.hash.hex()}
        if recording.HasField("audit_head")
        else None,
        "topics": [
            {"topic": topic.topic, "messages": topic.messages, "lost": topic.lost}
            for topic in recording.topics
        ],
    }
