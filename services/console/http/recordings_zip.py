"""Several recordings as one ZIP, written while it is sent: uncompressed, at most one piece in memory."""

import io
import zipfile
from collections.abc import AsyncIterator, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.recordings.changes import CHANGES, changes_json
from robomesh.recordings.names import SUFFIX
from robomesh.schemas import robomesh_pb2 as schema

_FIRST_YEAR, _LAST_YEAR = 1980, 2107  # of a ZIP's time


class ZipEntry(NamedTuple):
    """A recording in the ZIP; `saved` is its file's checked name, `first` has its size and version."""

    site: str
    saved: str
    file: RecorderFile
    info: schema.Recording
    first: schema.Piece


class _Sent(io.RawIOBase):
    """Stream of what the ZIP's writer has written and nothing has taken yet; it cannot seek."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, data: "bytes | bytearray | memoryview", /) -> int:  # type: ignore[override]
        self._waiting += data
        return len(data)

    def take(self) -> bytes:
        """Return what was written since the last call."""
        taken = bytes(self._waiting)
        self._waiting.clear()
        return taken


async def zip_of(entries: Sequence[ZipEntry]) -> AsyncIterator[bytes]:
    """Yield a ZIP of these recordings; files of several sites are in folders.

    Raises:
        RecordingError: If a file changes meanwhile: `recording.changed`.
        RobomeshError: If a recorder refuses or does not answer.
    """
    out, is_one_site = _Sent(), len({each.site for each in entries}) == 1
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for site, saved, file, info, first in entries:
            name = saved if is_one_site else f"{site}/{saved}"
            entry = zipfile.ZipInfo(name, _time(info))
            entry.file_size = first.total  # decides whether the entry needs ZIP64
            with archive.open(entry, "w") as content:
                async for data in file.pieces(0, first.total, version=first.version):
                    content.write(data)
                    yield out.take()
            if info.history:
                beside = zipfile.ZipInfo(name.removesuffix(SUFFIX) + CHANGES, _time(info))
                archive.writestr(beside, changes_json(info.history))
                yield out.take()
    yield out.take()


def _time(info: schema.Recording) -> tuple[int, int, int, int, int, int]:
    """Return the recording's start as a ZIP's time, which is local."""
    start = datetime.fromtimestamp(info.start.ToNanoseconds() * 1e-9, tz=UTC).astimezone()
    if not _FIRST_YEAR <= start.year <= _LAST_YEAR:
        return (_FIRST_YEAR, 1, 1, 0, 0, 0)
    return (start.year, start.month, start.day, start.hour, start.minute, start.second)
