"""Stops of one robot: sent first, then latched, reported and audited.

    stop          controller's socket -> latched, also in its file -> event -> audit (retried on a full disk)
    link is back  a latched stop is sent again: the controller may have missed it, or was restarted
    still moving  2 s after the first stop: critical event, and the stop is sent again, each 2 s
    within 0.1 s  a further stop sends no further unit: from the same operator it is counted as the same stop,
                  from another it is latched under its own number

A stop never waits for a lock, a queue or a disk.
"""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from protocol_gateway.audit.log import GATEWAY, Outcome
from protocol_gateway.authority import stop_rules
from protocol_gateway.authority.lease_rules import Authority, Now
from protocol_gateway.authority.preconditions import Controller
from protocol_gateway.control.audit_trail import AuditTrail
from protocol_gateway.drivers.driver import Driver, Stop
from protocol_gateway.errors import CommandError, LinkError
from protocol_gateway.journal import Journal
from protocol_gateway.latch_file import LatchFile
from protocol_gateway.link.link import LinkState
from robomesh import reason_codes as codes
from robomesh.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.old_authority.entries import entry_of

_S = schema.Event.Severity

# Longer than any arm needs to come to rest: after this time, a moving arm has ignored its stop unit.
HEED_TIMEOUT_S = 2.0
# A burst of dozens of units would fill the send buffer, which closes the connection.
IN_TRANSIT_S = 0.1


def read_clocks() -> Now:
    """Return the present time on both clocks."""
    return Now(time.monotonic(), time.time_ns())


@dataclass(frozen=True)
class RunningProgram:
    """Program that moves a robot.

    Attributes:
        targets: Its targets in order [rad] or [m].
        done: Number of targets that were sent to the controller.
        held: HOLD was sent, and no RESUME since.
        given_up: RESET was sent while the program was held, so the rest of it must not run.
    """

    name: str
    targets: tuple[tuple[float, ...], ...] = ()
    done: int = 0
    held: bool = False
    given_up: bool = False

    @property
    def ahead(self) -> tuple[tuple[float, ...], ...]:
        """Targets after the current motion."""
        return self.targets[self.done :]


@dataclass(kw_only=True)
class ControlContext:
    """State and services that the control of one robot shares.

    Attributes:
        authority: State of `protocol_gateway.authority.lease_rules`.
        latch: File that keeps the latched stop and its number across a restart.
        send: Writes a unit to the controller's socket immediately, or raises LinkError.
        controller: Returns the current state of the controller.
        on_change: Callback after a change of lease or stop.
        program: Program that runs under the lease; None: none runs.
        preparing: A future of each program that is being checked or audited; its result is the reason to
            cancel the program.
        orphan: Operator of a motion that may still run from before the gateway was killed; empty: none.
    """

    authority: Authority
    driver: Driver
    audit_trail: AuditTrail
    latch: LatchFile
    journal: Journal
    send: Callable[[bytes], None]
    controller: Callable[[], Controller]
    on_change: Callable[[], None]
    set_timer: Callable[[float | None], None]
    program: RunningProgram | None = None
    preparing: set[asyncio.Future[Reason]] = field(default_factory=set)
    orphan: str = ""

    def cancel_preparing(self, why: Reason) -> bool:
        """Cancel the programs that have not started; return whether there were any."""
        for each in self.preparing:
            if not each.done():
                each.set_result(why)
        return bool(self.preparing)

    def write_latch(self) -> None:
        """Write the latched stop and the newest number to the latch file soon."""
        self.latch.keep(self.authority.stop, self.authority.last_stop_id)


class StopHandler:
    """Handler of one robot's stops, which also detects that a stop is ignored."""

    def __init__(self, context: ControlContext) -> None:
        self._context = context
        self._disobeyed_reported_s = 0.0
        self._last_stop: tuple[str, str, Reason, schema.StopAnswer] | None = None  # operator, source

    def stop(self, *, by: str, reason: str, source: str) -> schema.StopAnswer:
        """Send the stop unit, latch the stop, and then report and audit it."""
        context, now = self._context, read_clocks()
        if context.controller().read_only:
            return self._stop_of_read_only(by=by, reason=reason, source=source)
        sent_s = self._in_transit_since(now)
        if sent_s is not None and self._last_stop is not None and self._last_stop[:2] == (by, source):
            _, _, result, answer = self._last_stop
            self._record(
                "STOP", result, answer.stop_id, sent=answer.sent, by=by, source=source, reason=reason
            )
            return answer
        problem = self._send() if sent_s is None else None
        number = context.latch.next_number(context.authority.last_stop_id, now.wall_ns)
        context.authority, latched = stop_rules.stop(
            context.authority, by=by, reason=reason, now=now, number=number
        )
        context.write_latch()
        context.cancel_preparing(codes.PROGRAM_STOPPED(by=by, reason=latched.reason))
        if problem is None:
            context.authority = stop_rules.stop_sent(context.authority, latched.id, sent_s or now.monotonic_s)
            result = codes.STOP_SENT(id=latched.id)
        else:
            result = codes.STOP_NOT_SENT(problem, id=latched.id)
        context.on_change()
        context.journal.report(
            _S.ERROR if problem else _S.WARNING,
            "stop.latched",
            f"{result} ({by}: {latched.reason})",
            why=result,
            stop_id=latched.id,
            by=by,
            reason=latched.reason,
            sent=not problem,
        )
        answer = _answer(result, latched.id, sent=problem is None)
        self._last_stop = None if problem else (by, source, result, answer)
        self._record(
            "STOP", result, latched.id, sent=problem is None, by=by, source=source, reason=latched.reason
        )
        return answer

    def _stop_of_read_only(self, *, by: str, reason: str, source: str) -> schema.StopAnswer:
        """Report and audit a stop of a read-only robot, without sending or latching it.

        No operator could reset the latch, and the gateway never sends motion to this robot.
        """
        context = self._context
        why = context.controller().read_only
        assert why is not None
        result = codes.STOP_READ_ONLY(why)
        context.journal.report(_S.ERROR, "stop.not_sent", f"{result} ({by}: {reason})", why=result, by=by)
        answer = _answer(result, 0, sent=False)
        self._record("STOP", result, 0, sent=False, by=by, source=source, reason=reason)
        return answer

    def send_latched_stop(self) -> None:
        """Send the latched stop, if there is one, again."""
        context = self._context
        latched = context.authority.stop
        if latched is None or context.controller().read_only:
            return
        if self._send() is None:
            context.authority = stop_rules.stop_sent(
                context.authority, latched.id, read_clocks().monotonic_s, first=True
            )
            context.on_change()
            result = codes.STOP_SENT_AGAIN(id=latched.id)
            context.journal.report(_S.WARNING, "stop.sent", result.text, why=result, stop_id=latched.id)
            self._record_repeat(result, latched.id, sent=True)

    def check_heeded(self, *, moving: bool, now: Now) -> None:
        """Report a robot that still moves after its stop, and send the stop again."""
        context = self._context
        latched, first_s = context.authority.stop, context.authority.stopping_s
        if not moving or latched is None or first_s is None:
            return
        if now.monotonic_s - max(first_s, self._disobeyed_reported_s) < HEED_TIMEOUT_S:
            return
        self._disobeyed_reported_s = now.monotonic_s
        problem = self._send()
        result = codes.STOP_DISOBEYED(problem or codes.STOP_UNIT_REPEATED(), id=latched.id)
        context.journal.report(_S.CRITICAL, "stop.disobeyed", result.text, why=result, stop_id=latched.id)
        self._record_repeat(result, latched.id, sent=problem is None)

    def _record_repeat(self, result: Reason, stop_id: int, *, sent: bool) -> None:
        # A different request name, because a restart must not read it as a new stop.
        self._record("STOP_AGAIN", result, stop_id, sent=sent, by=GATEWAY, source=GATEWAY)

    def _record(
        self,
        request: str,
        result: Reason,
        stop_id: int,
        *,
        sent: bool,
        by: str,
        source: str,
        reason: str = "",
    ) -> None:
        self._context.audit_trail.write_later(
            entry_of(
                request,
                operator=by,
                source=source,
                outcome=Outcome.ACCEPTED if sent else Outcome.FAILED,
                text=result.text,
                why=result,
                stop_id=stop_id,
                reason=reason,
            )
        )

    def _in_transit_since(self, now: Now) -> float | None:
        """Return the time at which the latched stop's unit was sent (monotonic), if just now."""
        latched = self._context.authority.stop
        if (
            latched is None
            or latched.sent_s is None
            or self._context.controller().link.state is not LinkState.UP
        ):
            return None
        return latched.sent_s if now.monotonic_s - latched.sent_s < IN_TRANSIT_S else None

    def _send(self) -> Reason | None:
        """Write the stop unit to the socket; return the reason of a failure."""
        try:
            self._context.send(self._context.driver.encode(Stop()))
        except (LinkError, CommandError) as error:
            return codes.STOP_SENT_LATER(error.reason)
        return None


def _answer(result: Reason, stop_id: int, *, sent: bool) -> schema.StopAnswer:
    return schema.StopAnswer(stop_id=stop_id, sent=sent, text=result.text, reason=reason_message(result))
