"""One robot of a gateway: its link, topics and authority. A failure here affects only this robot."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable, Hashable
from functools import partial
from pathlib import Path

from protocol_gateway.audit.log import AuditLog, Entry
from protocol_gateway.audit.search import Query, SearchServer, find
from protocol_gateway.authority import events
from protocol_gateway.authority.audit_entry import entry_message
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.authority.robot_authority import HEED_TIMEOUT_S
from protocol_gateway.configuration.settings import RobotSettings
from protocol_gateway.execution.audit_trail import AuditTrail
from protocol_gateway.execution.clocks import read_clocks
from protocol_gateway.execution.control import Control, Performers
from protocol_gateway.execution.jog_runner import JogRunner
from protocol_gateway.execution.mesh_requests import MeshRequests
from protocol_gateway.execution.program_runner import ProgramRunner
from protocol_gateway.legacy.clients import LegacyClients
from protocol_gateway.link.link import (
    JOINT_COUNT,
    JOINT_VALUES,
    ControllerLink,
    LinkState,
    LinkStatus,
)
from protocol_gateway.link.status import transition_events
from protocol_gateway.persistence.persisted_state import ROTATE
from protocol_gateway.robot.parts import (
    CellCheck,
    link_settings,
    make_authority,
    make_checks,
    make_driver,
    make_proofs,
)
from protocol_gateway.seam import Activity, Carries, Channel, Driver
from protocol_gateway.telemetry import set_up_file
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.telemetry.signals import Signals
from protocol_gateway.telemetry.state_messages import (
    controller_state,
    lease_state,
    timestamp,
    unit_counts,
)
from protocol_gateway.telemetry.telemetry import Telemetry
from protocol_gateway.telemetry.watchdog import SLOW_STALE_S, STALE_S
from robomesh import reason_codes as codes
from robomesh.contract.keys import presence_key
from robomesh.contract.topics import Role
from robomesh.publications.publisher import LIST_LENGTH, Publisher
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.presence import PresenceWatch
from robomesh.wire.session import Session
from robots.descriptions.description import load
from robots.kinematics.joints import Joints, joints_of

log = logging.getLogger(__name__)

_S = schema.Event.Severity

_POLL_S = 0.1
_HEARTBEAT_S = 1.0
_RETRY_S = 1.0
_KEEP_SET_UP_S = 1.0


class Robot:
    """A robot on the mesh, from its controller's socket to its keys.

    Raises:
        DescriptionError, GatewaySettingsError, CodeTableError, AuditError, KeyNameError: If its settings
            cannot be used.
    """

    def __init__(
        self,
        session: Session,
        site: str,
        settings: RobotSettings,
        *,
        audit_path: Path,
        rotate_bytes: int,
        cell_check: CellCheck,
    ) -> None:
        description = load(settings.description)
        joints = joints_of(description)
        driver = make_driver(settings, joints, self._relay)
        self._settings, self._capabilities = settings, driver.capabilities
        self._session, self._site = session, site
        self._proofs = make_proofs(site, settings, description, driver)
        self._read_only = self._proofs.why_read_only("")
        self._reported_unproven: Reason | None = None
        self._missing_channels: set[str] = set()
        # Ids of other gateways that serve this robot.
        self._others: set[str] = set()

        publisher = self._publisher
        self._controller_topic, self._lease_topic, self._program_topic, self._units_topic = (
            publisher(topic, together=True) for topic in ("controller", "lease", "program", "units")
        )
        self._audit_topic = publisher("audit")
        self._journal = Journal(publisher("events"), settings.name)
        self._set_up_path = audit_path.with_suffix(".tool")
        confirmed = set_up_file.read(self._set_up_path)
        self._signals = Signals(publisher("signals"), self._journal, joints.names, confirmed)
        self._telemetry = self._make_telemetry(joints)
        self._link = self._make_link(driver, joints)
        self._link_status = self._link.status
        self._audit = AuditLog(audit_path, on_written=self._on_written, rotate_bytes=rotate_bytes)
        self._audit_trail = AuditTrail(self._audit, self._journal)
        authority = make_authority(self._audit, joints, driver, read_only=self._read_only is not None)
        self._checks = make_checks(settings, cell_check, joints, authority, self._controller)
        self._control = Control(authority, self._performers(), self._checks)
        self._programs = self._make_programs()
        self._jogs = self._make_jogs(joints)
        self._legacy = self._make_legacy_clients(joints)
        self._requests = self._make_requests()
        session.answer(site, settings.name, "audit/find", SearchServer(audit_path).answer)
        self._operators, self._gateways = self._presence(Role.OPERATOR), self._presence(Role.GATEWAY)
        self._report_startup()

    # ------------------------------------------------------------------ parts

    def _publisher(self, topic: str, *, together: bool = False) -> Publisher:
        return self._session.declare_publisher(self._site, self._settings.name, topic, together=together)

    def _presence(self, role: Role) -> PresenceWatch:
        return self._session.watch_presence(presence_key(self._site, self._settings.name, role.value, "*"))

    def _make_telemetry(self, joints: Joints) -> Telemetry:
        return Telemetry(
            joints,
            fast=self._publisher("joints", together=True),
            slow=self._publisher("joints/slow", together=True),
            raw=self._publisher("raw"),
            signals=self._signals,
            journal=self._journal,
            stale_after_s=self._settings.stale_after_s,
            status_stale_s=STALE_S if self._capabilities.slow_hz is None else SLOW_STALE_S,
            on_status=self._on_controller_status,
            on_activity=self._on_activity,
            on_refused=self._on_refused,
            stop_expected=self._stop_expected,
            rests=self._rests if self._settings.thin_at_rest else None,
        )

    def _make_link(self, driver: Driver, joints: Joints) -> ControllerLink:
        return ControllerLink(
            link_settings(self._settings),
            driver,
            joints,
            on_event=self._telemetry.on_event,
            on_status=self._on_link,
            on_channel=self._on_channel,
            on_fate_unknown=lambda why: self._control.handle(events.FateUnknown(why)),
            tolerates=self._tolerates,
        )

    def _performers(self) -> Performers:
        return Performers(
            audit_trail=self._audit_trail,
            latch=self._audit.latch,
            journal=self._journal,
            send=self._link.send,
            controller=self._controller,
            publish=self._publish_state,
            confirm_set_up=self._signals.confirm,
            controlled=self._link.controlled,
            other_gateway=self._other_gateway,
        )

    def _make_programs(self) -> ProgramRunner:
        return ProgramRunner(
            self._control,
            self._checks,
            journal=self._journal,
            controller=self._controller,
            publish=self._publish_state,
            publish_source=self._publisher("program/source").put,
        )

    def _make_jogs(self, joints: Joints) -> JogRunner:
        return JogRunner(
            self._control,
            self._checks,
            joints=joints,
            journal=self._journal,
            controller=self._controller,
            can_jog=self._capabilities.jogs,
            tool_speed=self._settings.jog_speed,
        )

    def _make_legacy_clients(self, joints: Joints) -> LegacyClients | None:
        if self._settings.legacy_clients is None:
            return None
        return LegacyClients(
            self._settings.legacy_clients,
            self._settings.codes,
            joints,
            self._control,
            journal=self._journal,
            audit=self._audit_trail.write_later,
            publish=self._publish_state,
        )

    def _make_requests(self) -> MeshRequests:
        return MeshRequests(
            self._session,
            self._site,
            self._settings.name,
            control=self._control,
            programs=self._programs,
            jogs=self._jogs,
            audit=self._audit_trail.write_later,
        )

    # ----------------------------------------------------------------- service

    def _report_startup(self) -> None:
        if self._audit.damage:
            self._journal.report(
                _S.ERROR, "audit.damaged", f"audit log {self._audit.path.name}: {self._audit.damage}"
            )
        self._report_read_only()
        stop = self._control.authority.stop
        if stop is not None:
            text = f"stop request {stop.id} ({stop.by}: {stop.reason}) is still latched after the restart"
            self._journal.report(_S.WARNING, "stop.remembered", text, stop_id=stop.id)
        for entry in find(self._audit.path, Query(most=LIST_LENGTH)):
            with contextlib.suppress(ValueError, TypeError):  # a changed line: `verify` reports it
                self._audit_topic.remember(entry_message(entry), source_time_ns=entry.time_ns)
        self._publish_state()

    def _report_read_only(self) -> None:
        if self._read_only:
            text = f"the robot is read-only: {self._read_only}"
            self._journal.report(_S.WARNING, "robot.read_only", text, why=self._read_only)

    @property
    def link(self) -> ControllerLink:
        """Link to the robot's controller."""
        return self._link

    @property
    def signals(self) -> Signals:
        """Signals that the controller reports."""
        return self._signals

    @property
    def stopped(self) -> bool:
        """True while a stop is latched."""
        return self._control.authority.stop is not None

    @property
    def has_current_joints(self) -> bool:
        """True if joint positions were received that are not stale."""
        return self._telemetry.positions(time.monotonic()) is not None

    @property
    def use(self) -> Reason | None:
        """Reason to refuse a change of the cell: the robot is controlled, or may move; None: it rests."""
        name, authority, controller = self._settings.name, self._control.authority, self._controller()
        if authority.lease is not None:
            return codes.CELL_CONTROLLED(robot=name, holder=authority.lease.holder)
        if not self.has_current_joints or authority.moving is None:
            return codes.CELL_UNKNOWN(robot=name)
        moves = authority.moving or authority.motion is not None or self._control.program is not None
        if moves or controller.status.activity in (Activity.MOVING, Activity.HOMING, Activity.HOLDING):
            return codes.CELL_MOVES(robot=name)
        return None

    @property
    def audit_trail(self) -> AuditTrail:
        """Writer of the robot's audit log."""
        return self._audit_trail

    @property
    def journal(self) -> Journal:
        """Reporter of the robot's events."""
        return self._journal

    async def run(self) -> None:
        """Keep the link and the heartbeats until cancelled; then stop motion under a lease."""
        self._control.handle(
            events.LinkRestored()
        )  # no link yet, but the failed send makes it connect without pauses
        works = (self._link.run, self._watch_sessions, self._watch_gateways, self._keep_set_up)
        tasks = [asyncio.create_task(self._keep_running(work)) for work in works]
        if self._legacy is not None:
            tasks.append(asyncio.create_task(self._legacy.listen(self._session, self._settings.name)))
        try:
            await self._keep_running(self._poll)
        finally:
            try:
                # Before the link ends, because the stop is sent over it.
                self._control.handle(events.LeaseEnded(codes.ENDED_GATEWAY()))
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    async def close(self) -> None:
        """Disconnect old client programs, write pending entries, and close the audit log."""
        if self._legacy is not None:
            await self._legacy.close()
        await self._jogs.close()
        await self._programs.close()
        # Stop answering before the audit log closes, so that every answer has an entry.
        self._requests.close()
        self._requests.record_counted()
        await self._control.close()
        await self._audit.close()

    async def _keep_running(self, work: Callable[[], Awaitable[None]]) -> None:
        """Run endless work, and restart it after a failure, so that other robots are not affected."""
        while True:
            try:
                await work()
            except Exception:
                log.exception("%s: the gateway failed for this robot and restarts", self._settings.name)
                text = "the gateway failed for this robot and restarts: see the gateway's log"
                with contextlib.suppress(Exception):  # reporting itself may be what failed
                    self._journal.report(_S.ERROR, "gateway.failed", text)
                await asyncio.sleep(_RETRY_S)

    async def _keep_set_up(self) -> None:
        """Write what was confirmed of tool, payload and frame, soon after it has changed."""
        kept = dict(self._signals.confirmed)
        while True:
            await asyncio.sleep(_KEEP_SET_UP_S)
            if (confirmed := dict(self._signals.confirmed)) == kept:
                continue
            kept = confirmed
            try:
                await asyncio.to_thread(set_up_file.write, self._set_up_path, confirmed)
            except OSError as error:
                log.warning("%s: cannot be written: %s", self._set_up_path, error)

    async def _poll(self) -> None:
        next_s = 0.0
        while True:
            self._control.arrivals.note_running(time.monotonic())
            await asyncio.sleep(_POLL_S)
            self._control.handle(events.TimePassed())
            now_s = time.monotonic()
            if self._link.status.state is LinkState.UP:
                self._telemetry.check_timeouts(now_s)
            self._observe()
            if now_s >= next_s:
                next_s = now_s + _HEARTBEAT_S
                self._publish_state()
                self._requests.record_counted()
                self._audit_trail.write_pending()

    async def _watch_sessions(self) -> None:
        """End the lease of an operator's program or page when its session ends."""
        async for who, alive in self._operators:
            if not alive:
                self._control.handle(events.SessionEnded(who.id))

    async def _watch_gateways(self) -> None:
        """Follow which other gateways serve this robot."""
        async for who, alive in self._gateways:
            if who.id != self._session.identity:
                (self._others.add if alive else self._others.discard)(who.id)

    def _other_gateway(self) -> Reason | None:
        """Return why another gateway forbids control: each refuses what the other one grants and sends."""
        if not self._others:
            return None
        return codes.GATEWAY_TWICE(robot=self._settings.name, id=min(self._others))

    # ------------------------------------------------------------------ state

    def _relay(self, unit: bytes, answer: bool, kind: Hashable) -> None:
        if self._legacy is None:
            return
        relay = partial(self._legacy.relay, unit, answer)
        if answer or not self._link.defer_in_flood(("relay", kind), relay):
            relay()

    def _on_link(self, status: LinkStatus) -> None:
        before, self._link_status = self._link_status, status
        if status.state is LinkState.DOWN:
            self._telemetry.forget()
        elif status.code in (JOINT_COUNT, JOINT_VALUES):
            self._telemetry.invalidate_positions(other_robot=status.code == JOINT_COUNT)
        for event in transition_events(before, status):
            self._journal.report(event.severity, event.code, event.text, why=event.reason)
        if before.state is not status.state:
            if before.state is LinkState.UP:
                self._control.handle(events.LinkLost(status.text))
            if status.state is LinkState.DOWN and self._legacy is not None:
                self._legacy.link_is_down(status.text)
            if before.state is LinkState.DOWN:
                self._control.handle(events.LinkRestored())
        self._publish_state()

    def _on_channel(self, channel: Channel, why: Reason | None) -> None:
        """Report once that a channel was lost, and that it is back."""
        name = channel.name
        if why is not None and name not in self._missing_channels:
            self._missing_channels.add(name)
            text = f"the controller's {name} interface is not connected: {why}"
            self._journal.report(_S.WARNING, "link.channel_lost", text, why=why, channel=name)
        elif why is None and name in self._missing_channels:
            self._missing_channels.discard(name)
            text = f"the controller's {name} interface is connected again"
            self._journal.report(_S.INFO, "link.channel_back", text, channel=name)
        if why is None and Carries.STOP in channel.carries:
            self._control.handle(events.LinkRestored())
        self._publish_state()

    def _on_controller_status(self) -> None:
        before, self._read_only = (
            self._read_only,
            self._proofs.why_read_only(self._telemetry.software)
            or self._telemetry.undeclared_axes
            or self._telemetry.motion_impossible,
        )
        if self._read_only != before:
            self._report_read_only()
        unproven = self._joints_unproven()
        if unproven is not None and unproven != self._reported_unproven and self._telemetry.software:
            self._reported_unproven = unproven
            self._journal.report(_S.WARNING, "joints.unproven", str(unproven), why=unproven)
        self._control.handle(events.StatusChanged())
        self._observe()
        self._publish_state()

    def _joints_unproven(self) -> Reason | None:
        return self._telemetry.undeclared_axes or self._proofs.why_joints_unproven(self._telemetry.software)

    def _tolerates(self, why: Reason) -> bool:
        """Publish positions of unproven joints that cannot be, marked: their comparison shows the reason."""
        if self._joints_unproven() is None or why.code == codes.JOINT_NO_NUMBER.name:
            if self._legacy is not None:
                self._legacy.discard_states()
            return False
        self._telemetry.mark_invalid(why, time.monotonic())
        return True

    def _on_activity(self, activity: Activity | None, dated_s: float) -> None:
        # A status can only end a motion. To handle one costs a snapshot of the controller.
        if self._control.authority.motion is not None:
            self._control.handle(events.StatusReported(activity, dated_s))

    def _stop_expected(self, now_s: float) -> bool:
        """Return whether the controller may report a stop that the gateway has sent."""
        authority = self._control.authority
        just_reset = authority.reset_s is not None and now_s - authority.reset_s < HEED_TIMEOUT_S
        return authority.stop is not None or just_reset

    def _rests(self) -> bool:
        """Return whether the arm rests, and no motion, program or jog is under way."""
        authority = self._control.authority
        return authority.moving is False and authority.motion is None and self._control.program is None

    def _on_refused(self) -> None:
        self._control.handle(events.UnitRefused())

    def _on_written(self, entry: Entry) -> None:
        self._audit_topic.put(entry_message(entry), source_time_ns=entry.time_ns)
        if entry.request == ROTATE:
            name = self._audit.path.name
            self._journal.report(_S.INFO, "audit.rotated", f"audit log {name}: {entry.text}", file=name)

    def _observe(self) -> None:
        if self._link.status.state is not LinkState.UP:
            return
        moving = self._telemetry.moving(time.monotonic())
        if moving is not None:
            self._control.handle(events.MotionObserved(moving))

    def _controller(self) -> ControllerState:
        now_s, software = time.monotonic(), self._telemetry.software
        unproven = self._joints_unproven()
        changes = self._signals.unconfirmed
        return ControllerState(
            link=self._link.status,
            status=self._telemetry.status(now_s),
            fault=self._telemetry.fault(now_s),
            positions=self._telemetry.positions(now_s) if unproven is None else None,
            positions_stale=self._capabilities.no_joints or self._telemetry.why_stale(now_s),
            unproven=unproven,
            invalid=self._telemetry.why_invalid(now_s),
            software=software,
            software_unknown=self._proofs.why_software_unknown(software),
            reports_set_up=self._signals.has_set_up,
            set_up=codes.CHECK_TOOL_CHANGED(changes=", ".join(changes)) if changes else None,
            read_only=self._read_only,
            capabilities=self._capabilities,
            stop_arrives=self._link.carries(Carries.STOP),
            stop_ends=self._link.stop_ends,
            accept_unknown=self._settings.accept_unknown,
            recover=self._settings.recover,
        )

    def _publish_state(self) -> None:
        now = read_clocks()
        last = self._link.last_received
        authority, counters = self._control.authority, self._link.counters
        self._controller_topic.put(
            controller_state(
                self._controller(),
                authority.stop,
                counters=counters,
                health=self._link.health,
                age_s=None if last is None else now.monotonic_s - last.monotonic_s,
                rate_hz=self._link.rate_hz,
                controller_time_s=self._telemetry.controller_time_s,
                audit_head=self._audit.head,
                speed_percent=authority.speed_percent,
                legacy_clients=None if self._legacy is None else self._legacy.counts,
                policy=self._checks.policy,
                unchecked=self._checks.problem,
                check_starting=self._checks.is_starting,
                program=self._programs.running,
                jog=self._jogs.running,
                joints_sha256=self._proofs.joints_sha256,
                now=now,
            )
        )
        self._units_topic.put(unit_counts(counters, self._telemetry.thinned, now))
        self._lease_topic.put(lease_state(authority, now))
        self._programs.state.timestamp.CopyFrom(timestamp(now.wall_ns))
        self._program_topic.put(self._programs.state)
