"""Test bench for Control of one robot: driver, audit log and rules are real, the socket is a list."""

from contextlib import asynccontextmanager

from controllers.unit.driver import UnitDriver
from protocol_gateway.audit.log import AuditLog, read_entries
from protocol_gateway.authority.lease_rules import Authority
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.authority.robot_authority import RobotAuthority
from protocol_gateway.execution.audit_trail import AuditTrail
from protocol_gateway.execution.control import Control, Performers
from protocol_gateway.link.link import LinkState, LinkStatus
from protocol_gateway.seam import Activity, Mode, StatusReceived
from protocol_gateway.seam.errors import LinkDownError
from protocol_gateway.telemetry.journal import Journal
from robomesh import reason_codes as codes
from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of


class ControlBench:
    """Control with its collaborators."""

    def __init__(self, folder):
        self.socket = []
        self.events = []
        self.changes = 0
        self.status = StatusReceived(activity=Activity.IDLE, mode=Mode.REMOTE, homed=False)
        self.positions = (0.0,) * 5
        self.known = None  # overrides the controller's state
        self.broken = False
        self.secret = ""
        self.joints = joints_of(load("pt600"))
        self.driver = UnitDriver(self.joints.types)
        self.log = AuditLog(folder / "arm.jsonl", on_written=lambda entry: None)
        journal = Journal(self, "arm")
        self.ports = Performers(
            audit_trail=AuditTrail(self.log, journal),
            latch=self.log.latch,
            journal=journal,
            send=self.send,
            controller=self.controller,
            publish=self.changed,
        )
        self.restart()

    def restart(self, orphan=""):
        """Begin with no lease and no stop, as after a start of the gateway."""
        self.robot_authority = RobotAuthority(Authority(), self.joints, self.driver.prepare, orphan=orphan)
        self.control = Control(self.robot_authority, self.ports)

    def changed(self):
        self.changes += 1

    def put(self, event):
        self.events.append(event)

    def send(self, unit):
        if self.broken:
            raise LinkDownError(codes.OTHER(detail="the cable is cut"))
        self.socket.append(unit)

    def controller(self):
        return self.known or ControllerState(
            link=LinkStatus(LinkState.UP, codes.LINK_CONNECTED(where="there")),
            status=self.status,
            positions=self.positions,
        )

    async def lease(self, action, operator="li", **fields):
        request = schema.LeaseRequest(action=action, **fields)
        answer = await self.control.lease(request, operator=operator, source="test")
        self.secret = answer.lease or self.secret
        return answer

    async def commands(self, *commands, first_id=1):
        requests = [
            schema.CommandRequest(lease=self.secret, id=first_id + number, command=command, **fields)
            for number, (command, fields) in enumerate(commands)
        ]
        return await self.control.commands(requests, operator="li", source="test")

    def entries(self):
        return [(entry.request, entry.outcome) for entry in read_entries(self.log.path)]


@asynccontextmanager
async def control_bench(folder):
    bench = ControlBench(folder)
    try:
        yield bench
    finally:
        await bench.control.close()
        await bench.log.close()
