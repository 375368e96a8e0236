"""Latched stop of one robot in a file of fixed size, which can be written on a full disk.

    slot 0, slot 1   robot and state, a line of JSON with its SHA-256, padded to 4096 bytes
    write            in place, to the slot that does not hold the newest state
    start            uses the newest valid slot; a damaged or empty slot may have been newer, and held a stop

Both slots are allocated and written when the gateway starts, so a later write needs no space. One thread
writes, another one syncs: a stop and its answer wait for neither. The kernel has the data before the sync, so
`kill -9` does not lose it.

A gateway that was killed may have given out stop numbers up to `reserved` without writing them: the next
gateway continues after them. A gateway that shut down normally leaves no gap.
"""

import errno
import json
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from hashlib import sha256
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from protocol_gateway.authority.lease_rules import LatchedStop
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.texts import one_line

SLOT_BYTES = 4096
SLOTS = 2
# Far more than the numbers given out before the newest is written, even on a busy machine.
RESERVED = 1000
# A write that takes longer counts as failed until it completes.
LONGEST_WRITE_S = 1.0
_DIGEST = "sha256"
_LONGEST_TEXT = 400  # characters, so that two texts fit into a slot even when escaped


@dataclass(frozen=True, kw_only=True)
class LatchState:
    """Content of the file.

    Attributes:
        last_stop_id: Number of the newest known stop.
        reserved: Highest number that may have been given out.
    """

    stop: LatchedStop | None = None
    last_stop_id: int = 0
    reserved: int = 0


class LatchFile:
    """Latch file of one robot; the lock of its audit log excludes other gateways.

    Args:
        first: The robot's audit log is empty. Then an empty latch file is no damage: a gateway was killed at
            its first start.

    Attributes:
        found: Content when it was opened; None: none.
        damage: Damage as a sentence; empty: none.
    """

    def __init__(self, path: Path, *, first: bool = False) -> None:
        self.path = path
        self._file: int | None = None
        self._allocated = False
        self._lock = threading.Lock()
        self._newest = LatchState()
        self._written: LatchState | None = None
        self._failure: Reason | None = None
        self._busy_since_s: float | None = None
        self._syncing = False
        self._closed = False
        self._writer = ThreadPoolExecutor(1, thread_name_prefix=f"latch-{path.stem}")
        self._syncer = ThreadPoolExecutor(1, thread_name_prefix=f"latch-sync-{path.stem}")
        self.found, self.damage, self._sequence, self._slot = _read(path, first=first)

    @property
    def problem(self) -> Reason | None:
        """Reason why a restart would lose a stop now; None: it would not."""
        if self._failure:
            return self._failure
        since_s = self._busy_since_s
        if since_s is not None and time.monotonic() - since_s > LONGEST_WRITE_S:
            return codes.LATCH_SLOW(name=self.path.name, seconds=LONGEST_WRITE_S)
        return None

    def begin(self, stop: LatchedStop | None, last_stop_id: int, *, given_out: int) -> None:
        """Allocate the file and write both slots; a failure is in `problem`.

        Args:
            given_out: Highest number that may have been given out, also for unknown stops.
        """
        self._newest = LatchState(stop=stop, last_stop_id=last_stop_id, reserved=given_out + RESERVED)
        self._try_to_write(self._newest)

    def next_number(self, last_stop_id: int, wall_ns: int) -> int:
        """Return the number of the next stop, which is never given out again after a restart.

        Above the numbers that are reserved on disk it is the time in microseconds, because a failing disk
        must not delay a stop.
        """
        number = last_stop_id + 1
        reserved = 0 if self._written is None else self._written.reserved
        return number if number <= reserved else max(number, wall_ns // 1000)

    def keep(self, stop: LatchedStop | None, last_stop_id: int) -> None:
        """Write the latch soon, in the file's thread, without waiting."""
        reserved = last_stop_id + RESERVED
        self._write_soon(LatchState(stop=stop, last_stop_id=last_stop_id, reserved=reserved))

    def _write_soon(self, state: LatchState) -> None:
        with self._lock:
            self._newest = state
            if self._closed:
                self._failure = codes.LATCH_CLOSED(name=self.path.name)
                return
            if self._busy_since_s is not None:
                return
            self._busy_since_s = time.monotonic()
            self._writer.submit(self._write_newest)

    def retry(self) -> None:
        """Retry a failed write; call it repeatedly."""
        if self._failure:
            self._write_soon(replace(self._newest))

    def close(self) -> None:
        """Release the reserved numbers, and close the file."""
        with self._lock:
            self._closed = True
            newest = self._newest
            # Queued after the write that may be in progress.
            self._writer.submit(self._try_to_write, replace(newest, reserved=newest.reserved - RESERVED))
        self._writer.shutdown()
        self._syncer.shutdown()
        if self._file is not None:
            os.close(self._file)
            self._file = None

    # --------------------------------------------------------- in the file's threads

    def _write_newest(self) -> None:
        while True:
            with self._lock:
                state = self._newest
                if state is self._written:
                    self._busy_since_s = None
                    return
            self._try_to_write(state)
            if self._failure:
                with self._lock:
                    self._busy_since_s = None
                return

    def _try_to_write(self, state: LatchState) -> None:
        try:
            if self._allocated:
                self._write_slot(state)
            else:
                self._allocate(state)
        except OSError as error:
            code = codes.LATCH_NOT_WRITABLE if self._allocated else codes.LATCH_NOT_ALLOCATED
            self._failure = code(disk_problem(error), name=self.path.name)
            return
        self._written, self._failure = state, None
        with self._lock:
            if self._syncing:
                return
            self._syncing = True
        self._syncer.submit(self._sync)

    def _allocate(self, state: LatchState) -> None:
        if self._file is None:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
        os.posix_fallocate(self._file, 0, SLOTS * SLOT_BYTES)
        for _ in range(SLOTS):
            # The older slot first, and synced before the newer one is overwritten.
            self._write_slot(state)
            os.fdatasync(self._file)
        folder = os.open(self.path.parent, os.O_RDONLY | os.O_CLOEXEC)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
        self._allocated = True

    def _write_slot(self, state: LatchState) -> None:
        assert self._file is not None
        slot = (self._slot + 1) % SLOTS
        line = _line(state, self._sequence + 1, _owner(self.path))
        if os.pwrite(self._file, line, slot * SLOT_BYTES) != SLOT_BYTES:
            raise OSError(errno.EIO, "Incomplete write")
        self._slot, self._sequence = slot, self._sequence + 1

    def _sync(self) -> None:
        while True:
            synced = self._sequence
            try:
                if self._file is not None:
                    os.fdatasync(self._file)
            except OSError as error:
                self._failure = codes.LATCH_NOT_WRITABLE(disk_problem(error), name=self.path.name)
            with self._lock:
                if self._sequence == synced or self._failure:
                    self._syncing = False
                    return


def disk_problem(error: Exception) -> Reason:
    """Return why a write failed, and what to do."""
    if not isinstance(error, OSError):
        return codes.OTHER(detail=repr(error))
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    return (codes.DISK_FULL if full else codes.DISK_FAULT)(detail=error.strerror)


def _owner(path: Path) -> str:
    """Return the `site/robot` that the slots of a latch file name."""
    return f"{path.parent.name}/{path.stem}"


def _line(state: LatchState, sequence: int, of: str) -> bytes:
    stop = state.stop and {
        name: one_line(value, _LONGEST_TEXT) if isinstance(value, str) else value
        for name, value in state.stop.kept().items()
    }
    numbers = {"last_stop_id": state.last_stop_id, "reserved": state.reserved}
    row: dict[str, Any] = {"of": of, "sequence": sequence, "stop": stop, **numbers}
    digest = {_DIGEST: sha256(_json(row)).hexdigest()}
    line = _json(digest | row)
    assert len(line) < SLOT_BYTES
    return line.ljust(SLOT_BYTES - 1) + b"\n"


def _json(row: dict[str, Any]) -> bytes:
    return json.dumps(row, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode()


class _Slot(NamedTuple):
    """Content of an undamaged slot; `of`: its robot as `site/robot`, empty in old files."""

    sequence: int
    of: str
    state: LatchState


def _read(path: Path, *, first: bool) -> tuple[LatchState | None, str, int, int]:
    """Return the newest valid state, the damage as a sentence, the state's sequence and its slot."""
    nothing = 0, SLOTS - 1
    try:
        with path.open("rb") as file:
            data = file.read(SLOTS * SLOT_BYTES)
    except FileNotFoundError:
        return None, "", *nothing
    except OSError as error:
        return None, f"its latch file {path.name} cannot be read ({error.strerror})", *nothing
    parts = [data[slot * SLOT_BYTES : (slot + 1) * SLOT_BYTES] for slot in range(SLOTS)]
    if first and not data.strip(b"\0"):
        return None, "", *nothing
    slots = [_parsed(part) for part in parts]
    if any(slot is not None and slot.of not in ("", _owner(path)) for slot in slots):
        return None, f"its latch file {path.name} belongs to another robot", *nothing
    found = [(slot.sequence, place, slot.state) for place, slot in enumerate(slots) if slot is not None]
    # A gateway was killed between its first write, to slot 0, and its second, to slot 1.
    begun = slots[0] is not None and slots[0].sequence == 1 and not parts[1].strip(b"\0")
    damage = "" if len(found) == SLOTS or begun else f"its latch file {path.name} is damaged"
    if not found:
        return None, damage, *nothing
    sequence, place, state = max(found, key=itemgetter(0))
    return state, damage, sequence, place


def _parsed(part: bytes) -> _Slot | None:
    """Parse a slot; None: it is damaged."""
    try:
        row = json.loads(part)
        digest = row.pop(_DIGEST)
        if len(part) != SLOT_BYTES or digest != sha256(_json(row)).hexdigest():
            return None
        stop = None if row["stop"] is None else LatchedStop(**row["stop"])
        state = LatchState(stop=stop, last_stop_id=row["last_stop_id"], reserved=row["reserved"])
        # Files that were written before 2026-11-23 name no robot.
        return _Slot(int(row["sequence"]), str(row.get("of", "")), state)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
