"""Recordings that clients are reading through the recorder, by their last request."""

import time
from typing import NamedTuple

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema

# A client that has requested a part of a file and not its end still reads it for this long [s]: a slow
# browser takes a piece in that time.
_PIECE_S = 60.0
_RANGE_S = 5.0


class _Use(NamedTuple):
    asker: str
    until_s: float


class RecordingUses:
    """Clients' uses of files, by file and kind of request."""

    def __init__(self) -> None:
        self._uses: dict[tuple[str, str, str], _Use] = {}

    def note_piece(self, asker: str, request: schema.PieceRequest, answer: schema.Piece) -> None:
        """Note an answered request for bytes of a file: the last ones end the use."""
        # A single byte asks for the size and the version.
        if not request.attachment and request.length != 1:
            ended = request.offset + len(answer.data) >= answer.total
            self._note("piece", asker, request.file, 0.0 if ended else _PIECE_S)

    def note_range(self, asker: str, request: schema.RangeRequest, answer: schema.RecordedMessages) -> None:
        """Note an answered request for messages: the last ones end the use."""
        self._note("range", asker, request.file, _RANGE_S if answer.more else 0.0)

    def note_wait(self, kind: str, asker: str, file: str, again_s: float) -> None:
        """Note a client that has to wait for its quota, if it was reading the file."""
        if (kind, asker, file) in self._uses:
            self._note(kind, asker, file, again_s + _RANGE_S)

    def of(self, file: str, name: str) -> Reason | None:
        """Return the reason why a file is in use; None if no client reads it. Any thread may call it."""
        now = time.monotonic()
        for (_, _, used), use in list(self._uses.items()):
            if used == file and use.until_s > now:
                return codes.RECORDING_FETCHED(who=use.asker, name=name, seconds=max(use.until_s - now, 1.0))
        return None

    def _note(self, kind: str, asker: str, file: str, for_s: float) -> None:
        key, now = (kind, asker, file), time.monotonic()
        self._uses[key] = _Use(asker, now + for_s)
        for ended in [each for each, use in self._uses.items() if use.until_s <= now]:
            del self._uses[ended]
