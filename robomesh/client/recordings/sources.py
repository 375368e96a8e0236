"""Places from which a recording is read: a file of this machine, or the folder of a site's recorder."""

import contextlib
from collections.abc import AsyncGenerator, Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from google.protobuf.message import Message

from robomesh.client.recordings.descriptions import RecordingInfo, describe_recording
from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.contract.topics import SCHEMAS
from robomesh.errors import RefusedError
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.series.publisher_time import Recorded

if TYPE_CHECKING:
    from robomesh.recordings.reading import RecordedMessage

Decoder = Callable[[bytes], Message]

# Messages of a file that are read at once, and their bytes.
_PAGE, _PAGE_BYTES = 2000, 16 << 20


class RecordedBytes(Recorded, Protocol):
    """A recorded message."""

    @property
    def data(self) -> bytes:
        """Its bytes."""
        ...


class Page(NamedTuple):
    """Some messages of a topic.

    Attributes:
        schema: Full name of their schema: "foxglove.JointStates"; empty: none.
        decode: Decodes their bytes; None: unknown schema.
    """

    schema: str
    decode: Decoder | None
    messages: Sequence[RecordedBytes]


class Source(Protocol):
    """Place from which a recording is read."""

    @property
    def info(self) -> RecordingInfo:
        """Description of the recording."""
        ...

    def pages(self, keys: Sequence[str], start_ns: int | None, end_ns: int | None) -> AsyncGenerator[Page]:
        """Yield channels' messages between two receive times (both included), each channel's in their order.

        Raises:
            RecordingError: If it cannot be read.
            RobomeshError: If its recorder refuses or does not answer.
        """
        ...

    async def value_names(self) -> list[str]:
        """Return the names of the recorded values.

        Raises:
            RecordingError: If it cannot be read.
            RobomeshError: If its recorder refuses or does not answer.
        """
        ...


class DiskSource:
    """A file of this machine. Its functions never wait, so that a caller needs no event loop.

    Raises:
        RecordingError: If no part of it can be read.
    """

    def __init__(self, path: Path) -> None:
        self.info = describe_recording(path)
        self._path = path

    async def pages(
        self, keys: Sequence[str], start_ns: int | None, end_ns: int | None
    ) -> AsyncGenerator[Page]:
        """See `Source`."""
        from robomesh.recordings.reading import FOREVER_NS, RecordingFile

        with RecordingFile(self._path) as file:
            began_ns = file.layout.start_ns
            if (
                began_ns
                and any(each.messages for each in self.info.topics)
                and began_ns != self.info.start_ns
            ):
                raise RecordingError(f"{self.info.file}: it was replaced: open it again")
            file.clip(start_ns, end_ns)  # refuses what is outside the file
            kinds = {key: (file.schema_name(key), file.decoder(key)) for key in keys}
            begin, end = start_ns or 0, FOREVER_NS if end_ns is None else end_ns + 1
            page: list[RecordedMessage] = []
            length = 0
            for message in file.messages(keys, start_ns=begin, end_ns=end):
                another = bool(page) and page[0].topic != message.topic
                if another or length >= _PAGE_BYTES or len(page) >= _PAGE:
                    yield Page(*kinds[page[0].topic], page)
                    page, length = [], 0
                page.append(message)
                length += len(message.data)
            if page:
                yield Page(*kinds[page[0].topic], page)

    async def value_names(self) -> list[str]:
        """See `Source`."""
        from robomesh.recordings.reading import RecordingFile
        from robomesh.recordings.series.downsampling import known_values

        with RecordingFile(self._path) as file:
            return known_values(file)


class MeshSource:
    """A file in the folder of a site's recorder."""

    def __init__(self, file: RecorderFile, info: RecordingInfo) -> None:
        self._file, self.info = file, info

    async def pages(
        self, keys: Sequence[str], start_ns: int | None, end_ns: int | None
    ) -> AsyncGenerator[Page]:
        """See `Source`."""
        with _as_recording_errors():
            for key in keys:
                async for page in self._file.pages(key, start_ns=start_ns, end_ns=end_ns):
                    yield Page(page.schema, _decoder(page.schema), page.messages)

    async def value_names(self) -> list[str]:
        """See `Source`."""
        with _as_recording_errors():
            return await self._file.value_names()


@contextlib.contextmanager
def _as_recording_errors() -> Iterator[None]:
    """Raise a recorder's refusal of a file as the error that a file on this machine raises."""
    try:
        yield
    except RefusedError as error:
        if not error.code.startswith("recording."):
            raise
        raise RecordingError(error.reason) from None


def _decoder(name: str) -> Decoder | None:
    known = SCHEMAS.get(name)
    return None if known is None else known.FromString
