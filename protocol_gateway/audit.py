"""The audit log of one robot: who asked for what, and what became of it. Append-only, hash-chained.

A line an entry, JSON; `hash` is the SHA-256 of the same object without `hash`, keys sorted, no blanks:

    {"hash":"5f…","number":7,"operator":"li","outcome":"ACCEPTED","previous":"c0…",
     "request":"MOVE_ABSOLUTE","source":"mesh","text":"","time_ns":1790000000000000000,"values":{"id":"3"}}

`previous` is the hash of the entry before, 64 zeros in the first, so a changed, missing or moved line
shows; a cut tail shows to whoever knows a later hash (the head, published on the mesh). The lease's
secret is never in it.
"""

import asyncio
import fcntl
import hashlib
import json
import logging
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from protocol_gateway.errors import AuditError

log = logging.getLogger(__name__)

NOTHING_BEFORE = "0" * 64
# Stops are noted after the wire, also while the disk is full: this many wait for it to be mended.
MOST_OWED = 1000


class Outcome(StrEnum):
    """What became of a request. FAILED: accepted, but it did not reach the controller."""

    ACCEPTED = "ACCEPTED"
    REFUSED = "REFUSED"
    FAILED = "FAILED"


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A line of the log; number, previous and hash are the log's to give.

    Attributes:
        time_ns: When it was asked, ns since the Unix epoch.
        source: Where it came from: "mesh", "gateway".
        values: What was asked for, as text.
    """

    time_ns: int
    operator: str
    source: str
    request: str
    outcome: Outcome
    text: str = ""
    values: Mapping[str, str] = field(default_factory=dict)
    number: int = 0
    previous: str = NOTHING_BEFORE
    hash: str = ""


@dataclass(frozen=True, kw_only=True)
class Verification:
    """Whether a log is whole; `first_break`: number of the first entry that is not as it was written."""

    ok: bool
    entries: int
    first_break: int | None
    text: str


def chained(entry: Entry, *, number: int, previous: str) -> Entry:
    """The entry in its place in the chain, with its hash."""
    placed = replace(entry, number=number, previous=previous)
    return replace(placed, hash=_hash(placed))


def _hash(entry: Entry) -> str:
    return hashlib.sha256(_canonical(entry, with_hash=False)).hexdigest()


def _canonical(entry: Entry, *, with_hash: bool = True) -> bytes:
    row = asdict(entry)
    if not with_hash:
        del row["hash"]
    text = json.dumps(row, ensure_ascii=False, separators=(",", ":"), sort_keys=True)
    # Half a surrogate pair is no character, and must not keep the rest from being written.
    return text.encode(errors="backslashreplace")


def parse_line(line: bytes) -> Entry:
    """An entry from its line.

    Raises:
        AuditError: If the line is not one.
    """
    try:
        row = json.loads(line)
        return Entry(**{**row, "outcome": Outcome(row["outcome"])})
    except (ValueError, KeyError, TypeError) as error:
        raise AuditError(f"not an audit entry: {line[:80]!r} ({error})") from None


def read_entries(path: Path) -> Iterator[Entry]:
    """Every readable entry of a log, oldest first; no file: none."""
    if not path.exists():
        return
    with path.open("rb") as file:
        for line in file:
            try:
                yield parse_line(line)
            except AuditError:
                continue  # `verify` tells where; who only looks for something goes on


def verify(path: Path, head: str | None = None) -> Verification:
    """Check a log's chain, and that the entry whose hash is `head` is still in it.

    Raises:
        OSError: If the file cannot be read.
    """
    previous, number, found = NOTHING_BEFORE, 0, head is None
    with path.open("rb") as file:
        for line in file:
            number += 1
            try:
                entry = parse_line(line)
                whole = line.endswith(b"\n") and line[:-1] == _canonical(entry)
            except AuditError as error:
                return _broken(number, str(error))
            if not whole or entry.hash != _hash(entry):
                return _broken(number, f"entry {number} was changed: its hash does not fit its contents")
            if entry.number != number or entry.previous != previous:
                return _broken(number, f"something before entry {number} was taken out, put in or changed")
            previous = entry.hash
            found = found or entry.hash == head
    if not found:
        return _broken(number + 1, f"the log ends after entry {number}, but no entry has the hash {head}")
    return Verification(ok=True, entries=number, first_break=None, text=f"{number} entries, unbroken")


def _broken(number: int, text: str) -> Verification:
    return Verification(ok=False, entries=number - 1, first_break=number, text=text)


class AuditLog:
    """The open log of one robot. Its file is locked: two gateways must not write one chain.

    Attributes:
        mended: What was found wrong with the file when it was opened, in words; empty: nothing.
    """

    def __init__(self, path: Path, *, on_written: Callable[[Entry], None] = lambda entry: None) -> None:
        """Open the log, or begin one; a torn last line (power cut) is cut off.

        Args:
            on_written: Told of every entry that is on disk, in order.

        Raises:
            AuditError: If the folder or file cannot be written, or another process has it open.
        """
        self.path = path
        self._on_written = on_written
        self._waiting: list[tuple[Entry, asyncio.Future[Entry]]] = []
        self._owed: list[Entry] = []
        self._writer: asyncio.Task[None] | None = None
        self._torn = False
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
            _lock(self._file, path)
            self.mended = self._find_end()
            os.fsync(self._file)
        except OSError as error:
            raise AuditError(
                f"audit log {path} cannot be written ({error.strerror}): without it no robot is moved"
            ) from None

    @property
    def head(self) -> tuple[int, str]:
        """Number and hash of the last entry."""
        return self._number, self._previous

    def _find_end(self) -> str:
        self._number, self._previous, self._length = 0, NOTHING_BEFORE, 0
        mended = ""
        with self.path.open("rb") as file:
            for line in file:
                if not line.endswith(b"\n"):
                    os.ftruncate(self._file, self._length)
                    return f"a torn last line of {len(line)} bytes was cut off after entry {self._number}"
                self._length += len(line)
                self._number += 1
                try:
                    entry = parse_line(line)
                except AuditError:
                    mended = mended or f"entry {self._number} cannot be read"
                    continue
                if (entry.number, entry.previous, entry.hash) != (self._number, self._previous, _hash(entry)):
                    mended = mended or f"the chain is broken at entry {self._number}"
                self._previous = entry.hash
        return mended

    async def append(self, entry: Entry) -> Entry:
        """Write an entry; it is on disk when this returns. Entries stand in the order of the calls.

        Returns:
            The entry with its number and hashes.

        Raises:
            AuditError: If it could not be written; then it is not in the log.
        """
        future: asyncio.Future[Entry] = asyncio.get_running_loop().create_future()
        self._waiting.append((entry, future))
        self._start_writer()
        return await future

    async def append_or_owe(self, entry: Entry) -> Entry:
        """As `append`, for what has happened already: what cannot be written now is kept, and written later.

        Raises:
            AuditError: If it could not be written yet.
        """
        try:
            return await self.append(entry)
        except AuditError:
            if len(self._owed) < MOST_OWED:
                self._owed.append(entry)
            raise

    def pay(self) -> None:
        """Try again to write what is owed; to be called now and then."""
        if self._owed:
            self._start_writer()

    async def close(self) -> None:
        """Write what waits, then close the file."""
        self.pay()
        if self._writer is not None:
            await self._writer
        os.close(self._file)

    def _start_writer(self) -> None:
        if self._writer is None or self._writer.done():
            self._writer = asyncio.create_task(self._write_waiting())

    async def _write_waiting(self) -> None:
        """Everything that waits, in one write and one fsync, again until nothing does."""
        while True:
            waiting, self._waiting = self._waiting, []
            owed = len(self._owed)
            try:
                placed = self._placed([*self._owed, *(entry for entry, _ in waiting)])
                # An fsync takes milliseconds, seconds on a busy disk: the joint stream must not wait for it.
                await asyncio.to_thread(self._write, placed)
            except Exception as error:
                reason = error.strerror if isinstance(error, OSError) else repr(error)
                problem = f"the audit log {self.path.name} cannot be written ({reason})"
                for _, future in waiting:
                    if not future.done():
                        future.set_exception(AuditError(problem))
            else:
                self._number, self._previous = placed[-1].number, placed[-1].hash
                del self._owed[:owed]
                for (_, future), entry in zip(waiting, placed[owed:], strict=True):
                    if not future.done():
                        future.set_result(entry)
                self._tell(placed)
            if not self._waiting:
                return

    def _placed(self, entries: list[Entry]) -> list[Entry]:
        placed, number, previous = [], self._number, self._previous
        for entry in entries:
            number += 1
            placed.append(chained(entry, number=number, previous=previous))
            previous = placed[-1].hash
        return placed

    def _tell(self, entries: list[Entry]) -> None:
        for entry in entries:
            try:
                self._on_written(entry)
            except Exception:
                log.exception("audit log %s: entry %d was not published", self.path.name, entry.number)

    def _write(self, entries: list[Entry]) -> None:
        if self._torn:
            os.ftruncate(self._file, self._length)
        self._torn = True
        lines = b"".join(_canonical(entry) + b"\n" for entry in entries)
        written = 0
        while written < len(lines):
            written += os.pwrite(self._file, lines[written:], self._length + written)
        os.fsync(self._file)
        self._length += written
        self._torn = False


def _lock(file: int, path: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(file)
        raise AuditError(f"audit log {path} is open in another gateway: stop that one first") from None
