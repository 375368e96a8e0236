"""`robomesh recordings rename`, `note`, `tag` and `delete`."""

from collections.abc import Callable
from typing import Annotated

import typer

from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import check_chunk
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.record.listing import NamedRecording, found, show
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, Json
from services.command_line.terminal.output import print_line

_Request = schema.RecordingRequest
Operator = Annotated[str, typer.Option(help="The author's name; else yours.")]


def rename(
    what: NamedRecording,
    new: Annotated[str, typer.Argument(metavar="NEW")],
    connect: Connect = DEFAULT_ROUTER,
    operator: Operator = "",
    as_json: Json = False,
) -> None:
    """Rename a recording; its file keeps its name and its bytes."""
    recording = _change(what, lambda _: _Request(action=_Request.RENAME, name=new), connect, operator)
    _print(recording, f"{recording.file}: is named {recording.name}", as_json)


def note(
    what: NamedRecording,
    text: Annotated[str, typer.Argument(metavar="TEXT", help='The note; "" removes it.')],
    connect: Connect = DEFAULT_ROUTER,
    operator: Operator = "",
    as_json: Json = False,
) -> None:
    """Write a note about a recording, in place of an earlier one."""
    recording = _change(what, lambda _: _Request(action=_Request.NOTE, note=text), connect, operator)
    _print(recording, f"{recording.name}: {'has the note' if recording.note else 'has no note'}", as_json)


def tag(
    what: NamedRecording,
    tags: Annotated[list[str], typer.Argument(metavar="TAG...")],
    remove: Annotated[bool, typer.Option("--remove", help="Remove these tags.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    operator: Operator = "",
    as_json: Json = False,
) -> None:
    """Add tags to a recording, or remove them."""
    named = {each.strip().casefold() for each in tags}

    def request(now: schema.Recording) -> schema.RecordingRequest:
        kept = [each for each in now.tags if not remove or each.casefold() not in named]
        return _Request(action=_Request.TAG, tags=kept if remove else [*kept, *tags])

    recording = _change(what, request, connect, operator)
    words = f"{recording.name}: {', '.join(recording.tags) or 'no tags'}"
    _print(recording, words, as_json)


def delete(
    what: NamedRecording,
    reason: Annotated[str, typer.Option(help="The reason, which every operator sees.")],
    connect: Connect = DEFAULT_ROUTER,
    operator: Operator = "",
    as_json: Json = False,
) -> None:
    """Delete a recording's file for good; who, when, why and its SHA-256 are kept."""
    recording = _change(what, lambda _: _Request(action=_Request.DELETE, reason=reason), connect, operator)
    gone = recording.history[-1] if recording.history else schema.RecordingChange()
    words = f"{recording.file}: deleted, {gone.bytes} bytes, SHA-256 {gone.sha256}"
    _print(recording, words, as_json)


def _change(
    what: str,
    request: Callable[[schema.Recording], schema.RecordingRequest],
    router: str,
    operator: str,
) -> schema.Recording:
    """Change a recording of a site, from its newest description.

    Raises:
        ExportError: If no recording has the name.
        RobomeshError: If several have it, or its recorder refuses or does not answer.
    """

    async def main() -> schema.Recording:
        async with discovery.attached(router) as session:
            info = await found(session, what, only=True)
            by = check_chunk(operator or discovery.own_name())
            file = RecorderFile(session, info.recorder_site, info.file, asker=session.own_name)
            asked = request(info.message)
            asked.based_on = info.message.changes
            return await file.change(asked, by)

    return discovery.run(main())


def _print(recording: schema.Recording, words: str, as_json: bool) -> None:
    if as_json:
        show(recording, as_json)
    else:
        print_line(words)
