"""The audit log of one robot: who asked for what, and what became of it. Append-only, hash-chained.

    append    what is about to be done: on disk, or refused
    note      what has happened: kept until the disk takes it

Entries stand in the order of the calls. `audit_entry` says what a line is, `audit_files` where the
lines are and how a log is checked, `audit_find` how one is searched. When the live file has grown to
its size it becomes an older part, and a new one goes on with the chain:

    new file, locked, ROTATE in it -> the live one's second name, the part's -> the new one is the live one

Whoever is killed meanwhile: there is one whole live file, and it is never empty. Beside it stands the latch
file (`latch`), under the same lock.
"""

import asyncio
import fcntl
import logging
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from protocol_gateway.audit.entry import Entry, Outcome, chain_entry
from protocol_gateway.audit.files import Verification, older_parts, part_name, read_entries, verify
from protocol_gateway.audit.latch import LatchFile, disk_problem
from protocol_gateway.audit.persisted_state import (
    LATCH_UNKNOWN,
    ROTATE,
    UNKNOWN,
    PersistedState,
    apply_entry,
    merge,
    to_values,
    with_latched_stop,
)
from protocol_gateway.audit.recovery import Recovery, find_end
from protocol_gateway.errors import AuditError
from robomesh import reason_codes as codes
from robomesh.reasons import Reason

__all__ = ["AuditLog", "Entry", "Outcome", "Verification", "read_entries", "verify"]

log = logging.getLogger(__name__)

ROTATE_BYTES = 16 << 20
# What has happened is noted after the wire, also while the disk is full: so much waits for it to be mended,
# the second half for all but refusals.
MOST_PENDING = 1000
GATEWAY = "gateway"


@dataclass(frozen=True)
class _Waiting:
    entry: Entry
    written: asyncio.Future[Entry] | None
    retried: bool


class AuditLog:
    """The open log of one robot. Its file is locked: two gateways must not write one chain.

    Attributes:
        latch: The file that holds the latched stop, beside the log.
        mended: What was found wrong with the files when they were opened, in words; empty: nothing.
        problem: Why the last write failed; None: it did not.
    """

    def __init__(
        self,
        path: Path,
        *,
        on_written: Callable[[Entry], None] = lambda entry: None,
        rotate_bytes: int = ROTATE_BYTES,
    ) -> None:
        """Open the log, or begin one; a damaged one (`start`) latches a stop.

        Args:
            on_written: Told of every entry that is on disk, in order.
            rotate_bytes: A live file that has grown to this becomes an older part.

        Raises:
            AuditError: If the folder or file cannot be written, or another process has it open.
        """
        self.path = path
        self.problem: Reason | None = None
        self._on_written = on_written
        self._rotate_bytes = self._rotate_at = rotate_bytes
        self._queue: list[_Waiting] = []
        self._dropped = 0
        self._writer: asyncio.Task[None] | None = None
        self._writing_since_s: float | None = None
        # A thread of its own: a disk that hangs must not hold the threads of everything else.
        self._disk = ThreadPoolExecutor(1, thread_name_prefix=f"audit-{path.stem}")
        self._torn = False
        self._unpublished: list[Entry] = []
        self._name_synced = False  # whether the folder is on disk with the file's name in it
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = _open_locked(path)
            _finish_rotation(path)
            recovery = find_end(path)
            self._end, self.damage = recovery.end, recovery.problem
            if recovery.stop_may_be_lost:
                # Until it is written behind a new beginning, the damage stays as it is.
                self._torn, self._rotate_at = True, 1
            else:
                os.ftruncate(self._file, self._end.length)
            os.fsync(self._file)
            self.latch = LatchFile(path.with_suffix(".latch"), first=recovery.end.number == 0)
            self._remember_stops(recovery)
        except OSError as error:
            raise AuditError(
                f"audit log {path} cannot be written ({error.strerror}): without it no robot is moved"
            ) from None

    @property
    def head(self) -> tuple[int, str]:
        """Number and hash of the last entry."""
        return self._end.number, self._end.hash

    @property
    def state(self) -> PersistedState:
        """What the log's entries say must be remembered across a restart."""
        return self._end.state

    @property
    def stuck_s(self) -> float:
        """How long the disk has been busy with one write [s]."""
        since_s = self._writing_since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    def append(self, entry: Entry) -> asyncio.Future[Entry]:
        """Write an entry down before it is acted on: awaited, it is on disk, with its number and hashes.

        Raises (when awaited):
            AuditError: If it could not be written; then it is not in the log.
        """
        return self._put(entry, retried=False)

    def append_later(self, entry: Entry) -> asyncio.Future[Entry]:
        """As `append`, for what has happened already: what cannot be written now is kept, and written later.

        Raises (when awaited):
            AuditError: If it could not be written yet.
        """
        most = MOST_PENDING // 2 if entry.outcome is Outcome.REFUSED else MOST_PENDING
        if len(self._queue) < most:
            return self._put(entry, retried=True)
        self._dropped += 1 + entry.repeated
        written: asyncio.Future[Entry] = asyncio.get_running_loop().create_future()
        written.set_exception(AuditError(self.problem or codes.AUDIT_QUEUE_FULL(count=len(self._queue))))
        return written

    def retry(self) -> None:
        """Try again to write what was kept; to be called now and then."""
        if self._queue or self._dropped:
            self._start_writer()

    async def settle(self) -> None:
        """Wait until all that waits is written, or could not be."""
        if self._writer is not None:
            await self._writer

    async def close(self) -> None:
        """Write what waits, then close the files."""
        self.retry()
        await self.settle()
        await asyncio.to_thread(self.latch.close)
        self._disk.shutdown()
        os.close(self._file)

    def _remember_stops(self, recovery: Recovery) -> None:
        """Take what log and latch file leave behind; where a stop may be lost, latch one."""
        state, stop, unsent = merge(recovery.end.state, self.latch.found)
        self.damage = ", and ".join(filter(None, (recovery.problem, self.latch.damage)))
        text = (
            f"the gateway was killed before it wrote the entry of stop {stop.id}" if stop is not None else ""
        )
        # A torn line may have held a stop: the one that the latch file knows. Damage may have held any.
        if recovery.damaged or self.latch.damage or (recovery.stop_may_be_lost and stop is None):
            reason = UNKNOWN if recovery.stop_may_be_lost else LATCH_UNKNOWN
            now_ns = time.time_ns()
            number = state.last_stop_id + 1
            if self.latch.found is None:
                # Which numbers were given out is not known. The time in microseconds is above all of them.
                number = max(number, now_ns // 1000)
            state, stop = with_latched_stop(state, number=number, by=GATEWAY, since_ns=now_ns, reason=reason)
            text = self.damage
        if stop is not None:
            values = {"stop_id": str(stop.id), "reason": stop.reason}
            entry = replace(_own_entry("STOP", Outcome.ACCEPTED, text, values), operator=stop.by)
            self._queue.append(_Waiting(entry, None, retried=True))
        elif unsent is not None:
            text = "the gateway was killed before it wrote whether this was sent: the stop stays latched"
            entry = _own_entry("RESET", Outcome.FAILED, text, {"stop_id": str(unsent.id)})
            self._queue.append(_Waiting(entry, None, retried=True))
        self._end = replace(self._end, state=state)
        known = self.latch.found
        newest = max(recovery.end.state.last_stop_id, 0 if known is None else known.last_stop_id)
        newest = newest if state.stop is None else state.stop.id
        self.latch.begin(state.stop, newest, given_out=state.last_stop_id)

    def _put(self, entry: Entry, *, retried: bool) -> asyncio.Future[Entry]:
        written: asyncio.Future[Entry] = asyncio.get_running_loop().create_future()
        self._queue.append(_Waiting(entry, written, retried))
        self._start_writer()
        return written

    def _start_writer(self) -> None:
        if self._writer is None or self._writer.done():
            self._writer = asyncio.create_task(self._write_queue())

    async def _write_queue(self) -> None:
        """Everything that waits, in one write and one fsync, again until nothing new does."""
        loop = asyncio.get_running_loop()
        while True:
            batch, self._queue = self._queue, []
            if self._dropped:
                batch.append(_Waiting(_dropped_entry(self._dropped), None, retried=True))
            dropped, self._dropped = self._dropped, 0
            self._writing_since_s = time.monotonic()
            try:
                # An fsync takes milliseconds, seconds on a busy disk: the joint stream must not wait for it.
                placed = await loop.run_in_executor(self._disk, self._write, [each.entry for each in batch])
            except Exception as error:
                self.problem = codes.AUDIT_NOT_WRITABLE(file=self.path.name, detail=disk_problem(error))
                self._dropped += dropped
                new = bool(self._queue)
                self._queue[:0] = self._fail(batch[:-1] if dropped else batch)
            else:
                self.problem = None
                new = bool(self._queue)
                # Before them may stand the entry that begins a new file.
                for each, entry in zip(batch, placed[-len(batch) :], strict=True):
                    if each.written is not None and not each.written.done():
                        each.written.set_result(entry)
                self._publish(placed)
            finally:
                self._writing_since_s = None
            if not new:
                return

    def _fail(self, batch: list[_Waiting]) -> list[_Waiting]:
        """Tell who waits that it was not written; those that are kept."""
        for each in batch:
            if each.written is not None and not each.written.done():
                each.written.set_exception(
                    AuditError(self.problem or codes.AUDIT_QUEUE_FULL(count=len(batch)))
                )
        return [replace(each, written=None) for each in batch if each.retried]

    def _publish(self, entries: list[Entry]) -> None:
        for entry in entries:
            try:
                self._on_written(entry)
            except Exception:
                log.exception("audit log %s: entry %d was not published", self.path.name, entry.number)

    # ------------------------------------------------- on the disk's own thread

    def _write(self, entries: Sequence[Entry]) -> list[Entry]:
        if self._torn:
            os.ftruncate(self._file, self._end.length)
        if self._end.length >= self._rotate_at or (self._end.number and not self._end.length):
            self._rotate()
        end = self._end
        placed, lines = [], []
        for entry in entries:
            each, line = chain_entry(entry, number=end.number + 1, previous=end.hash)
            placed.append(each)
            lines.append(line)
            end = replace(end, number=each.number, hash=each.hash, state=apply_entry(end.state, each))
        self._torn = True
        written = _write_all(self._file, b"".join(lines), end.length)
        os.fsync(self._file)
        if not self._name_synced:
            _sync_folder(self.path.parent)
            self._name_synced = True
        self._torn = False
        self._end = replace(end, length=end.length + written)
        to_publish, self._unpublished = [*self._unpublished, *placed], []
        return to_publish

    def _rotate(self) -> None:
        """Go on in a new file; where that fails, in this one, until it has grown by as much again."""
        end, fresh = self._end, self.path.with_suffix(".new")
        part = part_name(self.path, end.first)
        text = f"the log goes on from {part.name}"
        beginning = _own_entry(ROTATE, Outcome.ACCEPTED, text, to_values(end.state))
        entry, line = chain_entry(beginning, number=end.number + 1, previous=end.hash)
        try:
            file = os.open(fresh, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o640)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # Before it is the live file: one that is empty was emptied by somebody.
                _write_all(file, line, 0)
                os.fsync(file)
                if end.length:
                    os.link(self.path, part)
                fresh.rename(self.path)
            except OSError:
                os.close(file)
                _finish_rotation(self.path)
                raise
        except OSError as error:
            if not end.length:
                raise
            log.warning("audit log %s was not rotated: %s", self.path.name, error)
            self._rotate_at = end.length + self._rotate_bytes
            return
        os.close(self._file)
        self._file, self._name_synced = file, False
        self._rotate_at = self._rotate_bytes
        self._end = replace(end, first=entry.number, number=entry.number, hash=entry.hash, length=len(line))
        self._unpublished.append(entry)


def _dropped_entry(number: int) -> Entry:
    text = f"{number} requests have no entry here: the disk took none, and no more could be kept"
    return _own_entry("LOST", Outcome.FAILED, text, {"requests": str(number)})


def _own_entry(request: str, outcome: Outcome, text: str, values: dict[str, str]) -> Entry:
    return Entry(
        time_ns=time.time_ns(),
        operator=GATEWAY,
        source=GATEWAY,
        request=request,
        outcome=outcome,
        text=text,
        values=values,
    )


def _open_locked(path: Path) -> int:
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(file)
            raise AuditError(f"audit log {path} is open in another gateway: stop that one first") from None
        if os.path.samestat(os.fstat(file), path.stat()):
            return file
        os.close(file)  # it has become an older part meanwhile


def _finish_rotation(path: Path) -> None:
    """Take away what a rotation that was broken off has left: the log is whole without it."""
    path.with_suffix(".new").unlink(missing_ok=True)
    for part in older_parts(path):
        if part.samefile(path):
            part.unlink()


def _write_all(file: int, data: bytes, place: int) -> int:
    written = 0
    while written < len(data):
        written += os.pwrite(file, data[written:], place + written)
    return written


def _sync_folder(folder: Path) -> None:
    number = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(number)
    finally:
        os.close(number)
