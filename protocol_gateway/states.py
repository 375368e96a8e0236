"""What the gateway knows, as messages of the mesh."""

from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.timestamp_pb2 import Timestamp

from bus.schemas import robomesh_pb2 as schema
from protocol_gateway.audit import Entry
from protocol_gateway.authority import Authority, Lease, Now, Stop
from protocol_gateway.driver import Activity, JointsReceived, Mode, UnknownReceived
from protocol_gateway.link import LinkCounters, LinkState
from protocol_gateway.obstacles import Controller

_S = schema.ControllerState
_LINKS = {LinkState.DOWN: _S.DOWN, LinkState.UP: _S.UP, LinkState.SILENT: _S.SILENT}
_MODES = {None: _S.MODE_UNKNOWN, Mode.REMOTE: _S.REMOTE, Mode.LOCAL: _S.LOCAL}
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
    """A time in ns since the Unix epoch as protobuf has it."""
    seconds, nanos = divmod(wall_ns, 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=nanos)


def joint_states(names: tuple[str, ...], joints: JointsReceived, wall_ns: int) -> JointStates:
    """Joint positions and velocities, dated when their unit was received."""
    if joints.velocities is None:
        rows = [
            JointState(name=name, position=position)
            for name, position in zip(names, joints.positions, strict=True)
        ]
    else:
        rows = [
            JointState(name=name, position=position, velocity=velocity)
            for name, position, velocity in zip(names, joints.positions, joints.velocities, strict=True)
        ]
    return JointStates(timestamp=timestamp(wall_ns), joints=rows)


def raw_record(record: UnknownReceived, wall_ns: int) -> schema.RawRecord:
    """A record that the driver has no meaning for, as it was received."""
    return schema.RawRecord(
        timestamp=timestamp(wall_ns), type=record.type, items=record.items, data=record.raw
    )


def controller_state(
    controller: Controller,
    stop: Stop | None,
    *,
    counters: LinkCounters,
    age_s: float | None,
    rate_hz: float,
    controller_time_s: float | None,
    now: Now,
) -> schema.ControllerState:
    """All that is known of the controller; what it does not tell is "unknown"."""
    status = controller.status
    state = schema.ControllerState(
        timestamp=timestamp(now.wall_ns),
        link=_LINKS[controller.link.state],
        link_text=_link_text(controller),
        mode=_MODES[status.mode],
        activity=_ACTIVITIES[status.activity],
        homed=_KNOWN[status.homed],
        trace=_KNOWN[status.trace],
        fault=controller.fault,
        read_only=bool(controller.read_only),
        last_unit_age_s=age_s,
        controller_time_s=controller_time_s,
        rate_hz=rate_hz,
        counters=schema.LinkCounters(
            units_received=counters.units_received,
            units_malformed=counters.units_malformed,
            units_sent=counters.units_sent,
            bytes_received=counters.bytes_received,
            bytes_sent=counters.bytes_sent,
            records_unknown=counters.records_unknown,
            connections=counters.connections,
            refusals=counters.refusals,
        ),
    )
    if stop is not None:
        state.stop.CopyFrom(
            schema.StopState(
                id=stop.id,
                since=timestamp(stop.since_ns),
                by=stop.by,
                reason=stop.reason,
                sent=stop.sent_s is not None,
            )
        )
    return state


def _link_text(controller: Controller) -> str:
    read_only = controller.read_only and f"read-only: {controller.read_only}"
    return "; ".join(filter(None, (controller.link.text, controller.positions_gone, read_only)))


def lease_state(authority: Authority, now: Now) -> schema.Lease:
    """Who controls, for everybody: never the secret."""
    message = schema.Lease(timestamp=timestamp(now.wall_ns))
    lease = authority.lease
    if lease is not None:
        message.holder = lease.holder
        message.since.CopyFrom(timestamp(lease.since_ns))
        message.until.CopyFrom(timestamp(lease.until_ns))
        message.offered_to = lease.offered_to
        message.motion = lease.motion is not None
    return message


def lease_answer(lease: Lease | None, now: Now) -> schema.LeaseAnswer:
    """The answer to the lease's holder, with its secret; without a lease, the gateway's clock alone."""
    message = schema.LeaseAnswer(now=timestamp(now.wall_ns))
    if lease is not None:
        message.lease = lease.secret
        message.holder = lease.holder
        message.since.CopyFrom(timestamp(lease.since_ns))
        message.until.CopyFrom(timestamp(lease.until_ns))
    return message


def audit_entry(entry: Entry) -> schema.AuditEntry:
    """An audit entry, as it stands in the log."""
    return schema.AuditEntry(
        timestamp=timestamp(entry.time_ns),
        number=entry.number,
        operator=entry.operator,
        source=entry.source,
        request=entry.request,
        values=entry.values,
        outcome=entry.outcome.value,
        text=entry.text,
        previous=bytes.fromhex(entry.previous),
        hash=bytes.fromhex(entry.hash),
    )
