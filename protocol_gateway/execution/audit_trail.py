"""Audit entries of Control: written before a command is executed, or after an event has happened."""

import asyncio
import time
from collections.abc import Sequence
from dataclasses import replace

from protocol_gateway.audit.flood_counter import STOP, FloodCounter
from protocol_gateway.audit.log import AuditLog, Entry, Outcome
from protocol_gateway.authority.admission import LONGEST_WAIT_S
from protocol_gateway.seam.errors import AuditError
from protocol_gateway.telemetry.journal import Journal
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import Event


class AuditTrail:
    """Writer of one robot's audit entries. A failed write is reported as an event and blocks only motion."""

    def __init__(self, audit: AuditLog, journal: Journal) -> None:
        self._audit = audit
        self._journal = journal
        self._floods = FloodCounter()
        self._failing = False

    async def write_before(self, *entries: Entry) -> None:
        """Write entries of commands before they are executed; they are on disk when this returns.

        Raises:
            AuditError: If they are not on disk within a second; then the commands must not be executed.
        """
        if any(entry.request == "RESET" for entry in entries):
            # A restart derives the latched stop from the order of the entries.
            self._write_counts(STOP)
        late = AuditError(codes.AUDIT_SLOW(seconds=LONGEST_WAIT_S))
        if self._audit.stuck_s > LONGEST_WAIT_S:
            self._record_not_done(entries, late, Outcome.REFUSED)
            raise late
        try:
            async with asyncio.timeout(LONGEST_WAIT_S):
                await asyncio.gather(*map(self._audit.append, entries))
        except AuditError as error:
            self._record_not_done(entries, error, Outcome.REFUSED)
            raise
        except TimeoutError:
            # The entry will still reach the disk, so a FAILED entry must follow it.
            self._record_not_done(entries, late, Outcome.FAILED)
            raise late from None

    def write_later(self, entry: Entry) -> None:
        """Write the entry of a past event, without waiting for the disk; a flood is counted."""
        if self._floods.admits(entry, time.monotonic()):
            self._append_later(entry)

    def write_pending(self) -> None:
        """Write counted entries, and retry failed writes; call it each second."""
        self._write_counts()
        self._audit.retry()
        latch = self._audit.latch
        latch.retry()
        if latch.problem is not None:
            if not self._failing:
                self._report_failure(AuditError(latch.problem))
        elif self._failing and not self._audit.problem and self._audit.stuck_s < LONGEST_WAIT_S:
            self._failing = False
            self._journal.report(Event.Severity.INFO, "audit.mended", "the audit log can be written again")

    async def settle(self) -> None:
        """Wait until all pending entries are written, or have failed."""
        self._write_counts()
        await self._audit.settle()

    def _write_counts(self, request: str = "") -> None:
        for entry in self._floods.counts(time.monotonic(), request=request):
            self._append_later(entry)

    def _append_later(self, entry: Entry) -> None:
        self._audit.append_later(entry).add_done_callback(self._on_written)

    def _on_written(self, written: asyncio.Future[Entry]) -> None:
        error = None if written.cancelled() else written.exception()
        if error is not None:
            self._report_failure(error)

    def _record_not_done(self, entries: Sequence[Entry], error: AuditError, outcome: Outcome) -> None:
        for entry in entries:
            reason = codes.NOT_DONE(error.reason)
            self.write_later(replace(entry, outcome=outcome, text=reason.text, reason=reason))
        self._report_failure(error)

    def _report_failure(self, error: BaseException) -> None:
        self._failing = True
        text = f"{error}: motion is refused until this is fixed; stop still works"
        why = error.reason if isinstance(error, AuditError) else None
        self._journal.report(Event.Severity.ERROR, "audit.failed", text, why=why)
