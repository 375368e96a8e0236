"""Audit log of one robot: requests, senders and outcomes. Append-only, hash-chained.

    append          entry of a request before it is executed: on disk, or an error
    append_later    entry of a past event: kept in memory until the disk takes it

Entries are in the order of the calls. `authority.audit_entry` defines a line, `files` the files of a log and
its verification, `search` the search. When the live file has reached its size, it becomes an older part, and
a new file continues the chain:

    create new file, lock it, write ROTATE -> link the live file under the part's name -> rename the new file

A crash at any step leaves one complete live file, which is never empty. The latch file (`latch_file`) is in
the same folder, under the same lock.
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

from protocol_gateway.audit.files import Verification, older_parts, part_name, read_entries, verify
from protocol_gateway.audit.recovery import RecoveredLog, find_end
from protocol_gateway.authority.audit_entry import GATEWAY, Entry, Outcome, chain_entry
from protocol_gateway.persistence.latch_file import LatchFile, disk_problem
from protocol_gateway.persistence.persisted_state import (
    LATCH_UNKNOWN,
    ROTATE,
    UNKNOWN,
    PersistedState,
    apply_entry,
    merge,
    to_values,
    with_latched_stop,
)
from protocol_gateway.seam.errors import AuditError
from robomesh import reason_codes as codes
from robomesh.files.atomic_write import fsync_folder
from robomesh.reasons import Reason

__all__ = ["AuditLog", "Entry", "Outcome", "Verification", "read_entries", "verify"]

log = logging.getLogger(__name__)

ROTATE_BYTES = 16 << 20
# Most entries that wait in memory while the disk fails; refusals may use only half of it.
MOST_PENDING = 1000


@dataclass(frozen=True)
class _Waiting:
    entry: Entry
    written: asyncio.Future[Entry] | None
    retried: bool


class AuditLog:
    """Open audit log of one robot. Its file is locked, because two gateways must not write one chain.

    Attributes:
        latch: The latch file of the same robot.
        damage: Damage found in the files when they were opened, as a sentence; empty: none.
        problem: Why the last write failed; None: it succeeded.
    """

    def __init__(
        self,
        path: Path,
        *,
        on_written: Callable[[Entry], None] = lambda entry: None,
        rotate_bytes: int = ROTATE_BYTES,
    ) -> None:
        """Open the log, or create one; damage (`recovery`) latches a stop.

        Args:
            on_written: Called with every entry that is on disk, in order.
            rotate_bytes: Size at which the live file becomes an older part.

        Raises:
            AuditError: If the folder or file cannot be written, or another process has the log open.
        """
        self.path = path
        self.problem: Reason | None = None
        self._on_written = on_written
        self._rotate_bytes = self._rotate_at = rotate_bytes
        self._queue: list[_Waiting] = []
        self._dropped = 0
        self._writer: asyncio.Task[None] | None = None
        self._writing_since_s: float | None = None
        # A dedicated thread: a disk that hangs must not block the shared thread pool.
        self._disk = ThreadPoolExecutor(1, thread_name_prefix=f"audit-{path.stem}")
        self._torn = False
        self._unpublished: list[Entry] = []
        self._name_synced = False  # the folder, with the file's name, is synced to disk
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = _open_locked(path)
            _finish_rotation(path)
            recovery = find_end(path)
            self._end, self.damage = recovery.end, recovery.problem
            if recovery.stop_may_be_lost:
                # Keep the damaged file unchanged; the first write rotates to a new file.
                self._torn, self._rotate_at = True, 1
            else:
                os.ftruncate(self._file, self._end.length)
            os.fsync(self._file)
            self.latch = LatchFile(path.with_suffix(".latch"), first=recovery.end.number == 0)
            self._remember_stops(recovery)
        except OSError as error:
            raise AuditError(
                f"audit log {path} cannot be written ({error.strerror}): the gateway needs it to move a robot"
            ) from None

    @property
    def head(self) -> tuple[int, str]:
        """Number and hash of the last entry."""
        return self._end.number, self._end.hash

    @property
    def state(self) -> PersistedState:
        """State that the log preserves across a restart."""
        return self._end.state

    @property
    def stuck_s(self) -> float:
        """Duration of the write that is in progress [s]; 0: none."""
        since_s = self._writing_since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    def append(self, entry: Entry) -> asyncio.Future[Entry]:
        """Write the entry of a request before it is executed; the future is done when it is on disk.

        Raises (when awaited):
            AuditError: If it could not be written; then it is not in the log.
        """
        return self._put(entry, retried=False)

    def append_later(self, entry: Entry) -> asyncio.Future[Entry]:
        """Write the entry of a past event; if that fails, keep it and retry later.

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
        """Retry failed writes; call it repeatedly."""
        if self._queue or self._dropped:
            self._start_writer()

    async def settle(self) -> None:
        """Wait until all pending entries are written, or have failed."""
        if self._writer is not None:
            await self._writer

    async def close(self) -> None:
        """Write pending entries, then close the files."""
        self.retry()
        await self.settle()
        await asyncio.to_thread(self.latch.close)
        self._disk.shutdown()
        os.close(self._file)

    def _remember_stops(self, recovery: RecoveredLog) -> None:
        """Restore the latched stop from log and latch file; latch a new one if a stop may be lost."""
        state, stop, unsent = merge(recovery.end.state, self.latch.found)
        self.damage = ", and ".join(filter(None, (recovery.problem, self.latch.damage)))
        text = (
            f"the gateway was killed before it wrote the entry of stop {stop.id}" if stop is not None else ""
        )
        # A torn line can only have held the stop that the latch file knows. Other damage may have held any.
        if recovery.damaged or self.latch.damage or (recovery.stop_may_be_lost and stop is None):
            reason = UNKNOWN if recovery.stop_may_be_lost else LATCH_UNKNOWN
            now_ns = time.time_ns()
            number = state.last_stop_id + 1
            if self.latch.found is None:
                # The numbers given out are unknown. The time in microseconds is above all of them.
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
        """Write all pending entries in one write and one fsync, until no new ones are queued."""
        loop = asyncio.get_running_loop()
        while True:
            batch, self._queue = self._queue, []
            if self._dropped:
                batch.append(_Waiting(_dropped_entry(self._dropped), None, retried=True))
            dropped, self._dropped = self._dropped, 0
            self._writing_since_s = time.monotonic()
            try:
                # In a thread: an fsync takes up to seconds, and the joint stream must not wait for it.
                placed = await loop.run_in_executor(self._disk, self._write, [each.entry for each in batch])
            except Exception as error:
                self.problem = codes.AUDIT_NOT_WRITABLE(disk_problem(error), file=self.path.name)
                self._dropped += dropped
                new = bool(self._queue)
                self._queue[:0] = self._fail(batch[:-1] if dropped else batch)
            else:
                self.problem = None
                new = bool(self._queue)
                # The first may be a ROTATE entry, which has no future.
                for each, entry in zip(batch, placed[-len(batch) :], strict=True):
                    if each.written is not None and not each.written.done():
                        each.written.set_result(entry)
                self._publish(placed)
            finally:
                self._writing_since_s = None
            if not new:
                return

    def _fail(self, batch: list[_Waiting]) -> list[_Waiting]:
        """Fail the futures of entries that were not written; return the entries to retry."""
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
            fsync_folder(self.path.parent)
            self._name_synced = True
        self._torn = False
        self._end = replace(end, length=end.length + written)
        to_publish, self._unpublished = [*self._unpublished, *placed], []
        return to_publish

    def _rotate(self) -> None:
        """Continue in a new file; if that fails, in this one, until it has grown by the size again."""
        end, fresh = self._end, self.path.with_suffix(".new")
        part = part_name(self.path, end.first)
        text = f"the log goes on from {part.name}"
        beginning = _own_entry(ROTATE, Outcome.ACCEPTED, text, to_values(end.state))
        entry, line = chain_entry(beginning, number=end.number + 1, previous=end.hash)
        try:
            file = os.open(fresh, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o640)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # Written before the rename, so that an empty live file always means tampering.
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
    text = f"{number} requests have no entry here: the disk failed, and the queue in memory was full"
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
        os.close(file)  # it was rotated in the meantime


def _finish_rotation(path: Path) -> None:
    """Remove the remains of an interrupted rotation; the log is complete without them."""
    path.with_suffix(".new").unlink(missing_ok=True)
    for part in older_parts(path):
        if part.samefile(path):
            part.unlink()


def _write_all(file: int, data: bytes, place: int) -> int:
    written = 0
    while written < len(data):
        written += os.pwrite(file, data[written:], place + written)
    return written
