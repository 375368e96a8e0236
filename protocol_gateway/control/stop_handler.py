"""StopHandler of one robot: on the wire first, latched, and only then said and written down.

    stop          controller's socket -> latched, in its file -> event -> audit, owed while the disk is full
    link is back  a latched stop is sent (again): the controller may not have had it, or was restarted
    still moving  2 s after the first stop: critical event, and the stop is sent again, each 2 s
    within 0.1 s  the unit of one that was just sent is on its way for others too: the same asker's is that
                  stop, and counted; another's is latched under a number of its own

Nothing here waits, for a lock, a queue or a disk.
"""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from protocol_gateway.audit.latch import LatchFile
from protocol_gateway.audit.log import GATEWAY, Outcome
from protocol_gateway.authority import lease_rules
from protocol_gateway.authority.lease_rules import Authority, Now
from protocol_gateway.authority.preconditions import Controller
from protocol_gateway.control.audit_trail import AuditTrail, entry_of
from protocol_gateway.drivers.driver import Driver, Stop
from protocol_gateway.errors import CommandError, LinkError
from protocol_gateway.journal import Journal
from protocol_gateway.link.link import LinkState
from robomesh import reason_codes as codes
from robomesh.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema

_S = schema.Event.Severity

# Longer than any arm takes to come to rest: one that still moves does not heed its stop unit.
HEED_TIMEOUT_S = 2.0
# Dozens of units at once would look like a controller that does not read, and cost the connection.
IN_TRANSIT_S = 0.1


def read_clocks() -> Now:
    """Now, on both clocks."""
    return Now(time.monotonic(), time.time_ns())


@dataclass(frozen=True)
class RunningProgram:
    """The program that moves a robot.

    Attributes:
        targets: Everywhere that it goes, in order [rad] or [m].
        done: So many of them are told to the controller already.
        held: HOLD was sent, and no RESUME since.
        given_up: RESET was sent while it was on hold: nothing of it is to come after that.
    """

    name: str
    targets: tuple[tuple[float, ...], ...] = ()
    done: int = 0
    held: bool = False
    given_up: bool = False

    @property
    def ahead(self) -> tuple[tuple[float, ...], ...]:
        """Everywhere that it will still go after the motion that runs."""
        return self.targets[self.done :]


@dataclass(kw_only=True)
class ControlContext:
    """One robot as what guards it has it.

    Attributes:
        authority: The state of `protocol_gateway.authority.lease_rules`.
        latch: Where the latched stop and its number outlive this process.
        send: Puts a unit on the controller's socket at once, or raises LinkError.
        controller: What is known of the controller now.
        on_change: Told when lease or stop changed.
        program: What runs step by step under the lease; None: nothing does.
        preparing: Of each program that is being checked, or written down, before it begins: to be told why it
            must not.
        orphan: Whose motion may still run from before a gateway was killed; empty: nobody's.
    """

    authority: Authority
    driver: Driver
    audit_trail: AuditTrail
    latch: LatchFile
    journal: Journal
    send: Callable[[bytes], None]
    controller: Callable[[], Controller]
    on_change: Callable[[], None]
    program: RunningProgram | None = None
    preparing: set[asyncio.Future[Reason]] = field(default_factory=set)
    orphan: str = ""

    def cancel_preparing(self, why: Reason) -> bool:
        """Let no program begin that has not yet; whether there was one."""
        for each in self.preparing:
            if not each.done():
                each.set_result(why)
        return bool(self.preparing)

    def write_latch(self) -> None:
        """Write soon whether a stop is latched, and the newest number."""
        self.latch.keep(self.authority.stop, self.authority.last_stop_id)


class StopHandler:
    """StopHandler one robot, and sees to it that the stop is heeded."""

    def __init__(self, context: ControlContext) -> None:
        self._context = context
        self._disobeyed_reported_s = 0.0
        self._last_stop: tuple[str, str, Reason, schema.StopAnswer] | None = None  # asked by, from where

    def stop(self, *, by: str, reason: str, source: str) -> schema.StopAnswer:
        """Send the stop unit, latch it, and only then say and write down that it was so."""
        context, now = self._context, read_clocks()
        if context.controller().read_only:
            return self._stop_of_read_only(by=by, reason=reason, source=source)
        sent_s = self._in_transit_since(now)
        if sent_s is not None and self._last_stop is not None and self._last_stop[:2] == (by, source):
            _, _, said, answer = self._last_stop
            self._record("STOP", said, answer.stop_id, sent=answer.sent, by=by, source=source, reason=reason)
            return answer
        problem = self._send() if sent_s is None else None
        number = context.latch.next_number(context.authority.last_stop_id, now.wall_ns)
        context.authority, latched = lease_rules.stop(
            context.authority, by=by, reason=reason, now=now, number=number
        )
        context.write_latch()
        context.cancel_preparing(codes.PROGRAM_STOPPED(by=by, reason=latched.reason))
        if problem is None:
            context.authority = lease_rules.stop_sent(
                context.authority, latched.id, sent_s or now.monotonic_s
            )
            said = codes.STOP_SENT(id=latched.id)
        else:
            said = codes.STOP_NOT_SENT(problem, id=latched.id)
        context.on_change()
        context.journal.report(
            _S.ERROR if problem else _S.WARNING,
            "stop.latched",
            f"{said} ({by}: {latched.reason})",
            why=said,
            stop_id=latched.id,
            by=by,
            reason=latched.reason,
            sent=not problem,
        )
        answer = _answer(said, latched.id, sent=problem is None)
        self._last_stop = None if problem else (by, source, said, answer)
        self._record(
            "STOP", said, latched.id, sent=problem is None, by=by, source=source, reason=latched.reason
        )
        return answer

    def _stop_of_read_only(self, *, by: str, reason: str, source: str) -> schema.StopAnswer:
        """Nothing is sent, and nothing latched: nobody could clear it, and nothing needs it."""
        context = self._context
        why = context.controller().read_only
        assert why is not None
        said = codes.STOP_READ_ONLY(why)
        context.journal.report(_S.ERROR, "stop.not_sent", f"{said} ({by}: {reason})", why=said, by=by)
        answer = _answer(said, 0, sent=False)
        self._record("STOP", said, 0, sent=False, by=by, source=source, reason=reason)
        return answer

    def send_latched_stop(self) -> None:
        """Send a latched stop (again)."""
        context = self._context
        latched = context.authority.stop
        if latched is None or context.controller().read_only:
            return
        if self._send() is None:
            context.authority = lease_rules.stop_sent(
                context.authority, latched.id, read_clocks().monotonic_s, first=True
            )
            context.on_change()
            said = codes.STOP_SENT_AGAIN(id=latched.id)
            context.journal.report(_S.WARNING, "stop.sent", said.text, why=said, stop_id=latched.id)
            self._record_repeat(said, latched.id, sent=True)

    def check_heeded(self, *, moving: bool, now: Now) -> None:
        """A robot that goes on moving after its stop is told of, and told again."""
        context = self._context
        latched, first_s = context.authority.stop, context.authority.stopping_s
        if not moving or latched is None or first_s is None:
            return
        if now.monotonic_s - max(first_s, self._disobeyed_reported_s) < HEED_TIMEOUT_S:
            return
        self._disobeyed_reported_s = now.monotonic_s
        problem = self._send()
        said = codes.STOP_DISOBEYED(problem or codes.STOP_UNIT_REPEATED(), id=latched.id)
        context.journal.report(_S.CRITICAL, "stop.disobeyed", said.text, why=said, stop_id=latched.id)
        self._record_repeat(said, latched.id, sent=problem is None)

    def _record_repeat(self, said: Reason, stop_id: int, *, sent: bool) -> None:
        # By a name of its own: it latches nothing, so a start need not read it.
        self._record("STOP_AGAIN", said, stop_id, sent=sent, by=GATEWAY, source=GATEWAY)

    def _record(
        self, request: str, said: Reason, stop_id: int, *, sent: bool, by: str, source: str, reason: str = ""
    ) -> None:
        self._context.audit_trail.write_later(
            entry_of(
                request,
                operator=by,
                source=source,
                outcome=Outcome.ACCEPTED if sent else Outcome.FAILED,
                text=said.text,
                why=said,
                stop_id=stop_id,
                reason=reason,
            )
        )

    def _in_transit_since(self, now: Now) -> float | None:
        """When the latched stop's unit was sent (monotonic), if just now; no RESET came behind it."""
        latched = self._context.authority.stop
        if (
            latched is None
            or latched.sent_s is None
            or self._context.controller().link.state is not LinkState.UP
        ):
            return None
        return latched.sent_s if now.monotonic_s - latched.sent_s < IN_TRANSIT_S else None

    def _send(self) -> Reason | None:
        """Put the stop unit on the socket; return why that failed."""
        try:
            self._context.send(self._context.driver.encode(Stop()))
        except (LinkError, CommandError) as error:
            return codes.STOP_SENT_LATER(error.reason)
        return None


def _answer(said: Reason, stop_id: int, *, sent: bool) -> schema.StopAnswer:
    return schema.StopAnswer(stop_id=stop_id, sent=sent, text=said.text, reason=reason_message(said))
