"""`robomesh recordings rename`, `note`, `tag` and `delete`."""

from collections.abc import Callable, Sequence

from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.contract.keys import check_chunk
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.record.listing import found, show
from services.command_line.terminal import discovery
from services.command_line.terminal.output import print_line

_Request = schema.RecordingRequest


def rename(what: str, new: str, router: str, operator: str, as_json: bool) -> None:
    """Rename a recording."""
    recording = _change(what, lambda _: _Request(action=_Request.RENAME, name=new), router, operator)
    _print(recording, f"{recording.file}: is named {recording.name}", as_json)


def note(what: str, text: str, router: str, operator: str, as_json: bool) -> None:
    """Set a recording's note."""
    recording = _change(what, lambda _: _Request(action=_Request.NOTE, note=text), router, operator)
    _print(recording, f"{recording.name}: {'has the note' if recording.note else 'has no note'}", as_json)


def tag(what: str, tags: Sequence[str], router: str, operator: str, *, remove: bool, as_json: bool) -> None:
    """Add tags to a recording, or remove them."""
    named = {each.strip().casefold() for each in tags}

    def request(now: schema.Recording) -> schema.RecordingRequest:
        kept = [each for each in now.tags if not remove or each.casefold() not in named]
        return _Request(action=_Request.TAG, tags=kept if remove else [*kept, *tags])

    recording = _change(what, request, router, operator)
    words = f"{recording.name}: {', '.join(recording.tags) or 'no tags'}"
    _print(recording, words, as_json)


def delete(what: str, reason: str, router: str, operator: str, as_json: bool) -> None:
    """Delete a recording."""
    recording = _change(what, lambda _: _Request(action=_Request.DELETE, reason=reason), router, operator)
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
