"""`robomesh recordings fetch`: a recording from its site's recorder over the mesh, with resume."""

import asyncio
import contextlib
import hashlib
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from robomesh.errors import NoAnswerError, QuotaError
from robomesh.keys import WHOLE_SITE, robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from services.command_line import discovery
from services.command_line.recordings.errors import ExportError
from services.command_line.recordings.listing import attached_for, found
from services.command_line.recordings.output import progress

_PIECE = 1 << 20
_TIMEOUT_S, _TRIES = 10.0, 2
# A quota counts one minute: after that some of it is free again.
_LONGEST_WAIT_S = 60.0


def run(what: str, out: Path, router: str, as_json: bool) -> None:
    """Fetch `[SITE/]NAME` or `[SITE/]FILE`, and resume an earlier fetch of the same version.

    Raises:
        ExportError: If no recording has the name, it cannot be written, or it changes during the fetch.
    """
    done = _run(what, out, router)
    if as_json:
        discovery.print_json({"file": str(done.file), "bytes": done.total, "resumed_at": done.resumed_at})
    else:
        begun = f", from byte {done.resumed_at} on" if done.resumed_at else ""
        print(f"{done.file}: {done.total / 1e6:.2f} MB{begun}")


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


class _Fetched(NamedTuple):
    file: Path
    resumed_at: int
    total: int


def _run(what: str, out: Path, router: str) -> _Fetched:
    try:
        return discovery.run(_fetch(what, out, router, into=out.is_dir()))
    except OSError as error:
        raise ExportError(f"{out}: cannot be written: {error.strerror or error}") from None


async def _fetch(what: str, out: Path, router: str, *, into: bool) -> _Fetched:
    async with attached_for(what, router) as session:
        site, recording = await found(session, what)
        name = recording.file
        # The name comes from another machine: accept no path.
        if name in ("", ".", "..") or Path(name).name != name:
            raise ExportError(f"{what}: its recorder names the file {name!r}, which is not a plain file name")
        out = out / name if into else out
        key = robot_key(site, WHOLE_SITE, f"recordings/piece/{session.own_name}")
        first = await _piece(session, key, schema.PieceRequest(file=name, length=1))
        # With the version in the name, a fetch never resumes another version's file.
        version = hashlib.sha256(first.version.encode()).hexdigest()[:12]
        partial = out.with_name(f".{out.name}.{version}.part")
        begun = partial.stat().st_size if partial.exists() else 0
        with partial.open("ab") as stream, progress(name) as report:
            at = begun
            while at < first.total:
                length = min(_PIECE, first.total - at)
                piece = await _piece(session, key, schema.PieceRequest(file=name, offset=at, length=length))
                if piece.version != first.version or not piece.data:
                    raise ExportError(f"{name} changed during the fetch: fetch it again")
                stream.write(piece.data)
                at += len(piece.data)
                report(at / first.total)
        partial.replace(out)
        return _Fetched(out, begun, first.total)


async def _piece(session: Session, key: str, request: schema.PieceRequest) -> schema.Piece:
    tries = _TRIES
    while True:
        try:
            piece = await session.ask(key, request, timeout_s=_TIMEOUT_S)
            assert isinstance(piece, schema.Piece)
            return piece
        except QuotaError as error:
            # Standard error, so that it appears above the progress bar.
            print(f"{request.file} waits: {error}", file=sys.stderr)
            await asyncio.sleep(min(error.again_s, _LONGEST_WAIT_S))
        except NoAnswerError:
            if not tries:
                raise
            tries -= 1
