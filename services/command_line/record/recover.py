"""`robomesh recordings recover`: completion of a file whose writer was killed."""

from pathlib import Path
from typing import Annotated

import typer

from robomesh.recordings.files import describe_file
from robomesh.recordings.recovery import recover as files
from robomesh.recordings.writing.capture import is_being_written
from services.command_line.terminal.options import Json
from services.command_line.terminal.output import print_json, print_line, progress
from services.export.errors import ExportError


def recover(file: Annotated[Path, typer.Argument(metavar="FILE.mcap")], as_json: Json = False) -> None:
    """Complete a recording whose writer was killed; a recorder does this when it starts."""
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
