"""What Control writes into the audit log: before a thing is done, or after it, but never instead of it."""

import asyncio
import time
from dataclasses import replace

from bus.schemas.robomesh_pb2 import CommandRequest, Event, LeaseRequest
from protocol_gateway.admission import LONGEST_WAIT_S
from protocol_gateway.audit import AuditLog, Entry, Outcome
from protocol_gateway.errors import AuditError
from protocol_gateway.journal import Journal


class Ledger:
    """Entries of one robot. What cannot be written is said in an event, and stops nothing but motion."""

    def __init__(self, audit: AuditLog, journal: Journal) -> None:
        self._audit = audit
        self._journal = journal
        self._writing: set[asyncio.Task[None]] = set()

    async def before(self, entry: Entry) -> None:
        """Write down what is about to be done; it is on disk when this returns.

        Raises:
            AuditError: If it is not, or not within a second; then it must not be done.
        """
        try:
            async with asyncio.timeout(LONGEST_WAIT_S):
                await self._audit.append(entry)
        except AuditError as error:
            self._say_failed(error)
            raise
        except TimeoutError:
            late = AuditError(f"the audit log's disk takes longer than {LONGEST_WAIT_S:g} s")
            # The entry will be on disk yet, so what became of it has to stand behind it.
            self.after_later(replace(entry, outcome=Outcome.FAILED, text=f"not done: {late}"))
            self._say_failed(late)
            raise late from None

    async def after(self, entry: Entry) -> None:
        """Write down what has happened; a full disk makes it late."""
        try:
            await self._audit.append_or_owe(entry)
        except AuditError as error:
            self._say_failed(error)

    def after_later(self, entry: Entry) -> None:
        """As `after`, without waiting for the disk."""
        task = asyncio.create_task(self.after(entry))
        self._writing.add(task)
        task.add_done_callback(self._writing.discard)

    async def settle(self) -> None:
        """Wait until all that was begun is written, or could not be."""
        await asyncio.gather(*self._writing)

    def _say_failed(self, error: AuditError) -> None:
        text = f"{error}: the robot is not moved while that is so; stop still works"
        self._journal.say(Event.Severity.ERROR, "audit.failed", text)


def entry_of(
    request: str, *, operator: str, source: str, outcome: Outcome, text: str, **values: object
) -> Entry:
    """An entry dated now; values that are empty are left out."""
    return Entry(
        time_ns=time.time_ns(),
        operator=operator,
        source=source,
        request=request,
        outcome=outcome,
        text=text,
        values={name: str(value) for name, value in values.items() if value not in ("", 0)},
    )


def lease_entry(request: LeaseRequest, *, operator: str, source: str, outcome: Outcome, text: str) -> Entry:
    """The entry of a lease request."""
    return entry_of(
        LeaseRequest.Action.Name(request.action),
        operator=operator,
        source=source,
        outcome=outcome,
        text=text,
        ttl_s=request.ttl_s,
        to=request.to,
        reason=request.reason,
    )


def command_entry(request: CommandRequest, *, operator: str, source: str) -> Entry:
    """The entry of a command that is accepted."""
    return entry_of(
        CommandRequest.Command.Name(request.command),
        operator=operator,
        source=source,
        outcome=Outcome.ACCEPTED,
        text="",
        id=str(request.id),
        joint_positions=" ".join(f"{value:.6g}" for value in request.joint_positions),
        speed_percent=f"{request.speed_percent:g}" if request.HasField("speed_percent") else "",
        stop_id=request.stop_id,
    )
