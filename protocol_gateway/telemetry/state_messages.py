"""Conversion of the gateway's state into messages of the mesh."""

from collections.abc import Sequence

from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.timestamp_pb2 import Timestamp

from protocol_gateway.authority.lease_rules import Authority, LatchedStop, Lease, Now
from protocol_gateway.authority.preconditions import ControllerState, commands_of, recoveries_of
from protocol_gateway.checking.policy import Policy
from protocol_gateway.link.health import LinkHealth
from protocol_gateway.link.link import LinkCounters, LinkState
from protocol_gateway.seam import Activity, JointsReceived, Mode, StopEnds, UnknownReceived
from robomesh import reason_codes as codes
from robomesh.contract.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema

_S = schema.ControllerState
_LINKS = {LinkState.DOWN: _S.DOWN, LinkState.UP: _S.UP, LinkState.SILENT: _S.SILENT}
_MODES = {None: _S.MODE_UNKNOWN, Mode.REMOTE: _S.REMOTE, Mode.LOCAL: _S.LOCAL}
_CHECKS = {Policy.OFF: _S.OFF, Policy.WARN: _S.WARN, Policy.REQUIRE: _S.REQUIRE}
_STOPS = {
    None: schema.Capabilities.NOT_NOW,
    StopEnds.OURS: schema.Capabilities.OURS,
    StopEnds.ANY: schema.Capabilities.ANY,
}
_KNOWN = {None: _S.UNKNOWN, True: _S.YES, False: _S.NO}
_ACTIVITIES = {
    None: _S.ACTIVITY_UNKNOWN,
    Activity.IDLE: _S.IDLE,
    Activity.MOVING: _S.MOVING,
    Activity.HOMING: _S.HOMING,
    Activity.HOLDING: _S.HOLDING,
    Activity.STOPPED: _S.STOPPED,
    Activity.FAULT: _S.FAULT,
}


def timestamp(wall_ns: int) -> Timestamp:
    """Convert a time in ns since the Unix epoch to a protobuf timestamp."""
    seconds, nanos = divmod(wall_ns, 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=nanos)


class JointStatesMessage:
    """Reusable message of one robot's joints: filling it takes an eighth of the time of a new one."""

    def __init__(self, names: Sequence[str]) -> None:
        self._message = JointStates(joints=[JointState(name=name) for name in names])
        self._rows = list(self._message.joints)
        self._has_velocities = False

    def fill(self, joints: JointsReceived, wall_ns: int) -> JointStates:
        """Return the message with a unit's positions and velocities, stamped with its receive time."""
        date = self._message.timestamp
        date.seconds, date.nanos = divmod(wall_ns, 1_000_000_000)
        for row, position in zip(self._rows, joints.positions, strict=True):
            row.position = position
        if joints.velocities is not None:
            for row, velocity in zip(self._rows, joints.velocities, strict=True):
                row.velocity = velocity
        elif self._has_velocities:
            for row in self._rows:
                row.ClearField("velocity")
        self._has_velocities = joints.velocities is not None
        return self._message


def raw_record(record: UnknownReceived, wall_ns: int) -> schema.RawRecord:
    """Return the message of a record that the driver does not know, as it was received."""
    return schema.RawRecord(
        timestamp=timestamp(wall_ns), type=record.type, items=record.items, data=record.raw
    )


def controller_state(
    controller: ControllerState,
    stop: LatchedStop | None,
    *,
    counters: LinkCounters,
    health: LinkHealth,
    age_s: float | None,
    rate_hz: float,
    controller_time_s: float | None,
    legacy_clients: schema.LegacyClients | None,
    audit_head: tuple[int, str],
    speed_percent: float | None,
    policy: Policy,
    unchecked: Reason | None,
    check_starting: bool,
    program: schema.ControllerState.Program | None,
    jog: schema.JogState | None,
    joints_sha256: str,
    now: Now,
) -> schema.ControllerState:
    """Return the controller's state; a value that the controller does not report is "unknown"."""
    status, reasons = controller.status, _link_reasons(controller)
    state = schema.ControllerState(
        timestamp=timestamp(now.wall_ns),
        link=_LINKS[controller.link.state],
        link_text="; ".join(map(str, reasons)),
        link_reasons=map(reason_message, reasons),
        mode=_MODES[status.mode],
        activity=_ACTIVITIES[status.activity],
        homed=_KNOWN[status.homed],
        trace=_KNOWN[status.trace],
        fault=controller.fault,
        read_only=controller.read_only is not None,
        software=controller.software,
        joints_unproven=controller.unproven is not None,
        joints_sha256=joints_sha256,
        last_unit_age_s=age_s,
        controller_time_s=controller_time_s,
        rate_hz=rate_hz,
        speed_percent=speed_percent,
        check=_CHECKS[policy],
        check_text="" if unchecked is None else unchecked.text,
        check_reason=None if unchecked is None else reason_message(unchecked),
        check_starting=check_starting,
        program=program,
        jog=jog,
        capabilities=_capabilities(controller),
        counters=schema.LinkCounters(
            units_received=counters.units_received,
            units_malformed=counters.units_malformed,
            units_sent=counters.units_sent,
            bytes_received=counters.bytes_received,
            bytes_sent=counters.bytes_sent,
            records_unknown=counters.records_unknown,
            connections=counters.connections,
            refusals=counters.refusals,
            units_lost=counters.units_lost,
            units_skipped=counters.units_skipped,
        ),
        health=None if age_s is None else _health(health, flooding=controller.link.flooding),
    )
    number, last_hash = audit_head
    if number:
        state.audit_head.CopyFrom(schema.AuditHead(number=number, hash=bytes.fromhex(last_hash)))
    if legacy_clients is not None:
        state.legacy_clients.CopyFrom(legacy_clients)
    if stop is not None:
        state.stop.CopyFrom(
            schema.StopState(
                id=stop.id,
                since=timestamp(stop.since_ns),
                by=stop.by,
                reason=stop.reason,
                sent=stop.sent_s is not None,
                why=None if stop.why is None else reason_message(stop.why),
            )
        )
    return state


def _capabilities(controller: ControllerState) -> schema.Capabilities:
    capabilities = controller.capabilities
    if controller.read_only is not None:
        return schema.Capabilities(
            stops=schema.Capabilities.NONE, absolute=capabilities.absolute, slow_hz=capabilities.slow_hz
        )
    return schema.Capabilities(
        stops=_STOPS[controller.stop_ends],
        commands=commands_of(controller),
        absolute=capabilities.absolute,
        dies_with_link=_KNOWN[capabilities.dies_with_link],
        recoveries=recoveries_of(controller),
        slow_hz=capabilities.slow_hz,
    )


def _health(health: LinkHealth, *, flooding: bool) -> schema.LinkHealth:
    return schema.LinkHealth(
        jitter_s=health.jitter_s,
        network_round_trip_s=health.network_round_trip_s,
        answer_s=health.answer_s,
        stamp_uncertainty_s=health.stamp_uncertainty_s,
        flooding=flooding,
    )


def _link_reasons(controller: ControllerState) -> list[Reason]:
    reasons = [controller.link.reason]
    # While the link is not up, its own reason already covers missing positions.
    if controller.positions_stale is not None and controller.link.state is LinkState.UP:
        reasons.append(controller.positions_stale)
    if controller.unproven is not None and controller.link.state is LinkState.UP:
        reasons.append(controller.unproven)
        if controller.invalid is not None:
            reasons.append(controller.invalid)
    if controller.read_only is not None:
        reasons.append(codes.READ_ONLY(controller.read_only))
    return reasons


def unit_counts(counters: LinkCounters, thinned: int, now: Now) -> schema.UnitCounts:
    """Return the numbers of the controller's units."""
    return schema.UnitCounts(
        timestamp=timestamp(now.wall_ns),
        received=counters.units_received,
        malformed=counters.units_malformed,
        lost=counters.units_lost,
        skipped=counters.units_skipped,
        thinned=thinned,
    )


def lease_state(authority: Authority, now: Now) -> schema.Lease:
    """Return the public lease state, without the secret."""
    message = schema.Lease(timestamp=timestamp(now.gateway_ns))
    if authority.ended is not None:
        message.ended = authority.ended.text
        message.ended_reason.CopyFrom(reason_message(authority.ended))
    for asker in authority.asked_by:
        message.asked_by.add(operator=asker.operator, reason=asker.reason, since=timestamp(asker.since_ns))
    lease = authority.lease
    if lease is not None:
        message.holder = lease.holder
        message.since.CopyFrom(timestamp(lease.since_ns))
        message.until.CopyFrom(timestamp(lease.until_ns))
        message.offered_to = lease.offered_to
        message.motion = lease.motion is not None
    return message


def lease_answer(lease: Lease | None, now: Now) -> schema.LeaseAnswer:
    """Return the answer to the lease's holder, with the secret; without a lease, only the gateway's time."""
    message = schema.LeaseAnswer(now=timestamp(now.gateway_ns))
    if lease is not None:
        message.lease = lease.secret
        message.holder = lease.holder
        message.since.CopyFrom(timestamp(lease.since_ns))
        message.until.CopyFrom(timestamp(lease.until_ns))
    return message
