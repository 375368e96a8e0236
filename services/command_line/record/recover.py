"""`robomesh recordings recover`: completion of a file whose writer was killed."""

from pathlib import Path

from robomesh.recordings.files import describe_file
from robomesh.recordings.writing import recover as files
from robomesh.recordings.writing.capture import is_being_written
from services.command_line.record.export.errors import ExportError
from services.command_line.terminal.output import print_json, print_line, progress


def run(file: Path, as_json: bool) -> None:
    """Complete a file; the original is kept until the new one is verified.

    Raises:
        CaptureError: If the file holds nothing to recover.
        ExportError: If the file is still being written, or the disk refuses.
    """
    state = files.state_of(file)
    if is_being_written(file):
        raise ExportError(f"{file}: is still being recorded: recover it after that ends")
    if state is files.State.INDEXED:
        words, messages, cut = "complete already", sum(t.messages for t in describe_file(file).topics), False
        damaged = 0
    else:
        try:
            with progress("recovering") as report:
                found = files.recover(file, report)
        except OSError as error:
            raise ExportError(f"{file}: not recovered, and unchanged: {error.strerror or error}") from None
        words, messages, cut, damaged = "recovered", found.messages, found.cut, found.damaged
    if as_json:
        print_json(
            {
                "file": str(file),
                "messages": messages,
                "cut": cut,
                "damaged_chunks": damaged,
                "recovered": words == "recovered",
            }
        )
    else:
        print_line(
            f"{file}: {words}, {messages} messages"
            + (f" without those of {damaged} damaged chunks" if damaged else "")
            + (", up to where its writer was killed" if cut else "")
        )
