"""`robomesh recordings fetch`: a recording from its site's recorder over the mesh, with resume."""

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from robomesh.client.recordings.recorder_file import Fetched, RecorderFile
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.errors import QuotaError
from services.command_line.record.listing import attached_for, found
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, Json
from services.command_line.terminal.output import print_json, print_line, progress
from services.export.errors import ExportError


def fetch(
    what: Annotated[str, typer.Argument(metavar="[SITE/]NAME", help="A name or file from `list`.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A file, or a folder.")] = Path(),
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Fetch a recording from its site; a repeated fetch resumes."""
    done = _run(what, out, connect)
    if as_json:
        print_json({"file": str(done.file), "bytes": done.total, "resumed_at": done.resumed_at})
    else:
        begun = f", from byte {done.resumed_at} on" if done.resumed_at else ""
        print_line(f"{done.file}: {done.total / 1e6:.2f} MB{begun}")


@contextlib.contextmanager
def local_file(what: str, router: str) -> Iterator[Path]:
    """Yield a file of this machine, or a site's recording in a temporary file.

    Raises:
        ExportError: If neither exists.
    """
    if Path(what).is_file():
        yield Path(what)
        return
    with tempfile.TemporaryDirectory(prefix="robomesh-") as folder:
        yield _run(what, Path(folder), router).file


def _run(what: str, out: Path, router: str) -> Fetched:
    try:
        return discovery.run(_fetch(what, out, router))
    except OSError as error:
        raise ExportError(f"{out}: cannot be written: {error.strerror or error}") from None


async def _fetch(what: str, out: Path, router: str) -> Fetched:
    async with attached_for(what, router) as session:
        recording = await found(session, what)

        def report_quota(error: QuotaError) -> None:
            # Standard error, so that it appears above the progress bar.
            print_line(f"{recording.file} waits: {error}", err=True)

        file = RecorderFile(
            session,
            recording.recorder_site,
            recording.file,
            asker=session.own_name,
            on_quota=report_quota,
        )
        with progress(recording.file) as report:
            return await file.fetch(out, on_progress=report)
