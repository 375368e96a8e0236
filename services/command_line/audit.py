"""`robomesh audit`."""

from pathlib import Path

import typer

from protocol_gateway.audit import verify as verify_log
from services.command_line.find import print_json
from services.errors import ServiceError


class AuditFileError(ServiceError):
    """An audit log that cannot be read."""


def verify(file: Path, head: str, as_json: bool) -> None:
    """Print whether a log is whole; exit status 1 when it is not."""
    try:
        result = verify_log(file, head or None)
    except OSError as error:
        raise AuditFileError(f"{file}: cannot be read: {error.strerror}") from None
    if as_json:
        print_json(
            {
                "ok": result.ok and result.entries > 0,
                "entries": result.entries,
                "first_break": result.first_break,
            }
        )
    elif not result.entries:
        print(f"{file}: no entry at all: an emptied log looks like this")
    elif result.ok:
        print(f"{file}: {result.entries} entries, whole and unchanged")
    else:
        print(f"{file}: {result.text}")
    if not result.ok or not result.entries:
        raise typer.Exit(1)
