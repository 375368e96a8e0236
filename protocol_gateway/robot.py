"""One robot of a gateway: its link, topics and authority. What fails here, fails for this robot alone."""

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bus.errors import KeyNameError, RefusedError
from bus.keys import check_chunk
from bus.publisher import LIST_LENGTH, Publisher
from bus.requests import Request
from bus.schemas import robomesh_pb2 as schema
from bus.session import Session
from protocol_gateway.audit import AuditLog, Entry, read_entries
from protocol_gateway.authority import Now
from protocol_gateway.control import Control
from protocol_gateway.driver import Driver
from protocol_gateway.journal import Journal
from protocol_gateway.ledger import Ledger
from protocol_gateway.link import ControllerLink, LinkSettings, LinkState, LinkStatus
from protocol_gateway.motion import is_moving
from protocol_gateway.obstacles import Controller
from protocol_gateway.restart import remembered
from protocol_gateway.states import audit_entry, controller_state, lease_state
from protocol_gateway.telemetry import Telemetry
from protocol_gateway.texts import LONGEST, one_line
from protocol_gateway.unit_driver import UnitDriver
from robots.description import load
from robots.joints import joints_of

log = logging.getLogger(__name__)

_S = schema.Event.Severity

_LOOK_S = 0.05
_HEARTBEAT_S = 1.0
_MEND_S = 1.0
MESH = "mesh"


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """One robot, as the site file gives it.

    Attributes:
        name: In keys.
        description: A library robot's name, or a path.
        host: Of the controller; `port` too.
        codes: Type codes, where the controller sends numbers: {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}.
        accept_unknown: What the controller never tells and is done without: "mode", "homed".
        stop_proven: The stop unit was tried on this controller; without that the robot is read-only.
            How to try it: docs/safety.md.
        stale_after_s: Without a unit for this long, nothing is known of the robot any more; without positions
            for this long, it is not moved.
        reconnect_after_s: Without a unit for this long, the connection is made anew.
    """

    name: str
    description: str | Path
    host: str
    port: int
    codes: Mapping[int, str] = field(default_factory=dict)
    accept_unknown: frozenset[str] = frozenset()
    stop_proven: bool = False
    stale_after_s: float = 1.0
    reconnect_after_s: float = 4.0


class Robot:
    """A robot on the mesh, from its controller's socket to its keys.

    Raises:
        DescriptionError, CodeTableError, AuditError, KeyNameError: If it cannot be run as it is set.
    """

    def __init__(self, session: Session, site: str, settings: RobotSettings, audit_folder: Path) -> None:
        joints = joints_of(load(settings.description))
        driver: Driver = UnitDriver(joints.types, settings.codes)
        self._settings = settings
        self._read_only = _why_read_only(settings, driver)

        def publisher(topic: str) -> Publisher:
            return session.declare_publisher(site, settings.name, topic)

        self._controller_topic = publisher("controller")
        self._lease_topic = publisher("lease")
        self._audit_topic = publisher("audit")
        self._journal = Journal(publisher("events"), settings.name)
        self._telemetry = Telemetry(
            joints,
            fast=publisher("joints"),
            slow=publisher("joints/slow"),
            raw=publisher("raw"),
            journal=self._journal,
            stale_after_s=settings.stale_after_s,
            on_status=self._on_told,
            on_refused=lambda: self._control.refused(),
        )
        self._link = ControllerLink(
            LinkSettings(
                host=settings.host,
                port=settings.port,
                stale_after_s=settings.stale_after_s,
                reconnect_after_s=settings.reconnect_after_s,
            ),
            driver,
            on_event=self._telemetry.on_event,
            on_status=self._on_link,
        )
        self._link_state = LinkState.DOWN
        path = audit_folder / site / f"{settings.name}.jsonl"
        self._audit = AuditLog(path, on_written=self._on_written)
        self._control = Control(
            joints,
            driver,
            Ledger(self._audit, self._journal),
            self._journal,
            authority=remembered(read_entries(path)),
            send=self._link.send,
            controller=self._controller,
            on_change=self._publish_state,
        )
        session.answer(site, settings.name, "stop", self._answer_stop)
        session.answer(site, settings.name, "lease/request/*", self._answer_lease)
        session.answer(site, settings.name, "command/*", self._answer_command)
        self._say_how_it_starts()

    def _say_how_it_starts(self) -> None:
        if self._audit.mended:
            self._journal.say(
                _S.ERROR, "audit.mended", f"audit log {self._audit.path.name}: {self._audit.mended}"
            )
        if self._read_only:
            self._journal.say(_S.WARNING, "robot.read_only", f"the robot is read-only: {self._read_only}")
        stop = self._control.authority.stop
        if stop is not None:
            text = f"stop request {stop.id} ({stop.by}: {stop.reason}) is latched since before this start"
            self._journal.say(_S.WARNING, "stop.remembered", text, stop_id=stop.id)
        for entry in deque(read_entries(self._audit.path), maxlen=LIST_LENGTH):
            with contextlib.suppress(ValueError, TypeError):  # somebody changed that line: `verify` tells
                self._audit_topic.remember(audit_entry(entry), source_time_ns=entry.time_ns)
        self._publish_state()

    async def run(self) -> None:
        """Keep the link and the heartbeats until cancelled; then stop what moves under a lease."""
        link = asyncio.create_task(self._go_on(self._link.run))
        try:
            await self._go_on(self._beat)
        finally:
            try:
                # While there is a link to stop it over.
                self._control.end_lease("the gateway is being ended")
            finally:
                link.cancel()
                await asyncio.gather(link, return_exceptions=True)

    async def close(self) -> None:
        """Write what is still to be written, and close the audit log."""
        await self._control.close()
        await self._audit.close()

    async def _go_on(self, work: Callable[[], Awaitable[None]]) -> None:
        """Do endless work; when it fails begin it anew, for the other robots know nothing of it."""
        while True:
            try:
                await work()
            except Exception:
                log.exception("%s: the gateway failed at this robot and begins anew", self._settings.name)
                text = "the gateway failed at this robot and begins anew: its log says why"
                with contextlib.suppress(Exception):  # what failed may be the saying itself
                    self._journal.say(_S.ERROR, "gateway.failed", text)
                await asyncio.sleep(_MEND_S)

    async def _beat(self) -> None:
        next_s = 0.0
        while True:
            await asyncio.sleep(_LOOK_S)
            self._control.check_expiry()
            now_s = time.monotonic()
            if self._link.status.state is LinkState.UP:
                self._telemetry.look(now_s)
            self._observe()
            if now_s >= next_s:
                next_s = now_s + _HEARTBEAT_S
                self._publish_state()
                self._audit.pay()

    # --------------------------------------------------------------- requests

    async def _answer_stop(self, request: Request) -> schema.StopAnswer:
        message = request.message
        assert isinstance(message, schema.StopRequest)
        # Whatever is wrong with its texts, a stop is a stop.
        by, reason = one_line(message.by).strip(), one_line(message.reason).strip()
        return self._control.stop(by=by or "somebody", reason=reason, source=MESH)

    async def _answer_lease(self, request: Request) -> schema.LeaseAnswer:
        message = request.message
        assert isinstance(message, schema.LeaseRequest)
        message.reason, message.to = one_line(message.reason), one_line(message.to)
        return await self._control.lease(message, operator=_operator(request), source=MESH)

    async def _answer_command(self, request: Request) -> schema.CommandAnswer:
        message = request.message
        assert isinstance(message, schema.CommandRequest)
        return await self._control.command(message, operator=_operator(request), source=MESH)

    # ------------------------------------------------------------------ state

    def _on_link(self, status: LinkStatus) -> None:
        before, self._link_state = self._link_state, status.state
        if status.state is LinkState.DOWN:
            self._telemetry.forget()
        if before is not status.state:
            lost = status.state is LinkState.DOWN or before is LinkState.UP
            severity = _S.WARNING if lost else _S.INFO
            self._journal.say(
                severity, f"link.{status.state.value}", f"link to the controller: {status.text}"
            )
            if before is LinkState.DOWN:
                self._control.link_is_back()
        self._publish_state()

    def _on_told(self) -> None:
        self._control.news()
        self._observe()
        self._publish_state()

    def _on_written(self, entry: Entry) -> None:
        self._audit_topic.put(audit_entry(entry), source_time_ns=entry.time_ns)

    def _observe(self) -> None:
        if self._link.status.state is not LinkState.UP:
            return
        activity = self._telemetry.status(time.monotonic()).activity
        self._control.observe(moving=is_moving(activity, self._telemetry.watch))

    def _controller(self) -> Controller:
        now_s = time.monotonic()
        return Controller(
            link=self._link.status,
            status=self._telemetry.status(now_s),
            fault=self._telemetry.fault(now_s),
            positions=self._telemetry.positions(now_s),
            positions_gone=self._telemetry.positions_gone(now_s),
            read_only=self._read_only,
            accept_unknown=self._settings.accept_unknown,
        )

    def _publish_state(self) -> None:
        now = Now(time.monotonic(), time.time_ns())
        last = self._link.last_received
        authority = self._control.authority
        self._controller_topic.put(
            controller_state(
                self._controller(),
                authority.stop,
                counters=self._link.counters,
                age_s=None if last is None else now.monotonic_s - last.monotonic_s,
                rate_hz=self._link.rate_hz,
                controller_time_s=self._telemetry.controller_time_s,
                now=now,
            )
        )
        self._lease_topic.put(lease_state(authority, now))


def _operator(request: Request) -> str:
    """In whose name something is asked.

    Raises:
        RefusedError: If it is no name: cut or mended, it might become somebody else's.
    """
    name = request.chunk
    if len(name) > LONGEST:
        raise RefusedError(f"operator {one_line(name, 40)}: a name has at most {LONGEST} characters")
    try:
        return check_chunk(name)
    except KeyNameError as error:
        raise RefusedError(str(error)) from None


def _why_read_only(settings: RobotSettings, driver: Driver) -> str:
    """Why nothing may be sent to the controller, and what would be right; empty: it may be sent to."""
    if not driver.can_stop:
        return (
            "the site file's codes have no stop for its controller: "
            'add the code of "COMMAND:stop", or of "COMMAND"'
        )
    if not settings.stop_proven:
        return (
            "its stop is not proven: try the stop unit on its controller (docs/safety.md says how), "
            "then write stop_proven = true at this robot in the site file"
        )
    return ""
