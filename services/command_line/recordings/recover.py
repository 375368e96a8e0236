"""`robomesh recordings recover`: a file whose writer was killed, made whole."""

from pathlib import Path

from mcap_files import recover as files
from mcap_files.capture import is_being_written
from mcap_files.files import describe_file
from services.command_line import discovery
from services.command_line.recordings.errors import ExportError
from services.command_line.recordings.output import progress


def run(file: Path, as_json: bool) -> None:
    """Make it whole; the original is kept until the new one is checked.

    Raises:
        CaptureError: If there is nothing to recover.
        ExportError: If it is being recorded, or the disk refuses.
    """
    state = files.state_of(file)
    if is_being_written(file):
        raise ExportError(f"{file}: is being recorded now: there is nothing to recover until that ends")
    if state is files.State.INDEXED:
        words, messages, cut = "whole already", sum(t.messages for t in describe_file(file).topics), False
        damaged = 0
    else:
        try:
            with progress("recovering") as tell:
                found = files.recover(file, tell)
        except OSError as error:
            raise ExportError(f"{file}: not recovered, and as it was: {error.strerror or error}") from None
        words, messages, cut, damaged = "recovered", found.messages, found.cut, found.damaged
    if as_json:
        discovery.print_json(
            {
                "file": str(file),
                "messages": messages,
                "cut": cut,
                "damaged_chunks": damaged,
                "recovered": words == "recovered",
            }
        )
    else:
        print(
            f"{file}: {words}, {messages} messages"
            + (f" without those of {damaged} damaged chunks" if damaged else "")
            + (", up to where its writer was killed" if cut else "")
        )
