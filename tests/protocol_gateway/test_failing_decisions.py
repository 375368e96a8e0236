"""Each decision on an event fails in turn: what a stop and a command promise must still hold."""

import contextlib
import errno

import pytest

from controllers.unit.driver import UnitDriver
from protocol_gateway.authority.decisions import CheckVerdict, PlannedProgram
from protocol_gateway.authority.events import LeaseEnded, LinkLost, LinkRestored, MotionObserved
from protocol_gateway.authority.lease_rules import Authority
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.authority.robot_authority import RobotAuthority
from protocol_gateway.execution.control import Control, Performers
from protocol_gateway.link.link import LinkState, LinkStatus
from protocol_gateway.seam import Activity, Mode, StatusReceived
from protocol_gateway.seam.errors import AuditError, LinkDownError
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of

A, C = LeaseRequest.Action, CommandRequest.Command
JOINTS = joints_of(load("pt600"))
THERE = (0.4, 0.1, 0.0, 0.0, 0.0)
STOP_UNIT = b"1#COMMAND*stop@"
FULL = OSError(errno.ENOSPC, "No space left on device")
CUT = LinkDownError(codes.OTHER(detail="the cable is cut"))
FAULT = RuntimeError("a fault of the gateway")


class FailingPerformers:
    """Performers of a Control, also its checks; one of their calls fails.

    Attributes:
        calls: Name of each call, its text, and whether it succeeded.
        failing: Number of the call that fails.
    """

    problem = None
    why_cell_closed = None

    def __init__(self, send_error):
        self.calls = []
        self.failing = None
        self.send_error = send_error

    def call(self, name, error, text=""):
        succeeds = len(self.calls) != self.failing
        self.calls.append((name, text, succeeds))
        if not succeeds:
            raise error

    async def write_before(self, *entries):
        self.call("append", AuditError(codes.AUDIT_SLOW(seconds=1)))

    def write_later(self, entry):
        self.call("append later", FULL, entry.request)

    async def settle(self):
        pass

    def next_number(self, last, wall_ns):
        self.call("number", FULL)
        return last + 1

    def keep(self, stop, last_stop_id):
        self.call("latch file", FULL, "latched" if stop else "clear")

    def report(self, severity, code, text, **values):
        self.call("report", FAULT, code)

    def publish(self):
        self.call("publish", FAULT)

    def send(self, unit):
        self.call("send", self.send_error, unit)

    @contextlib.asynccontextmanager
    async def motion_lock(self, requests):
        self.call("cell", FAULT)
        yield

    async def check(self, requests):
        self.call("check", FAULT)
        return CheckVerdict()

    def why_changed(self, check_verdict):
        self.call("recheck", FAULT)

    def controller(self):
        return ControllerState(
            link=LinkStatus(LinkState.UP, codes.LINK_CONNECTED(where="there")),
            status=StatusReceived(activity=Activity.IDLE, mode=Mode.REMOTE, homed=True),
            positions=(0.0,) * 5,
        )

    def made(self, name, text=""):
        """Return the numbers of the calls of a name, failed or not."""
        return [at for at, each in enumerate(self.calls) if each[:2] == (name, text)]

    def succeeded(self, name, text=""):
        """Return the numbers of the calls of a name that did not fail."""
        return [at for at in self.made(name, text) if self.calls[at][2]]

    def units(self):
        """Return the number and bytes of each unit on the wire that is not a stop."""
        return [
            (at, text)
            for at, (name, text, succeeds) in enumerate(self.calls)
            if name == "send" and succeeds and text != STOP_UNIT
        ]


class Bench:
    """A Control whose ports fail."""

    def __init__(self, clock, send_error):
        self.clock = clock
        self.ports = FailingPerformers(send_error)
        encode = UnitDriver(JOINTS.types).prepare
        ports = Performers(
            audit_trail=self.ports,
            latch=self.ports,
            journal=self.ports,
            send=self.ports.send,
            controller=self.ports.controller,
            publish=self.ports.publish,
        )
        self.control = Control(RobotAuthority(Authority(), JOINTS, encode), ports, self.ports)
        self.secret = ""
        self.last_id = 0

    @property
    def authority(self):
        return self.control.authority

    async def lease(self, action, operator="li"):
        request = LeaseRequest(action=action, lease=self.secret, ttl_s=5.0, reason="fire")
        answer = await self.control.lease(request, operator=operator, source="test")
        self.secret = answer.lease

    async def command(self, command, **fields):
        self.last_id += 1
        request = CommandRequest(command=command, id=self.last_id, lease=self.secret, **fields)
        checked = PlannedProgram(name="p", targets=(THERE,)) if command == C.RUN_PROGRAM else None
        return await self.control.attempt([request], operator="li", source="test", program=checked)

    async def free(self):
        pass

    async def held(self):
        await self.lease(A.ACQUIRE)

    async def moving(self):
        await self.held()
        assert (await self.command(C.MOVE_ABSOLUTE, joint_positions=THERE)).accepted

    async def stopped(self):
        await self.held()
        self.stop()
        self.control.handle(MotionObserved(False))
        self.clock.advance(2.1)

    async def running(self):
        await self.held()
        assert (await self.command(C.RUN_PROGRAM, program="home")).accepted

    def stop(self):
        self.control.stop(by="wang", reason="smoke", source="test")


async def stop(bench):
    bench.stop()


def give(event):
    async def given(bench):
        bench.control.handle(event)

    return given


def lease(action, operator="li"):
    async def leased(bench):
        await bench.lease(action, operator)

    return leased


def command(kind, **fields):
    async def commanded(bench):
        await bench.command(kind, **fields)

    return commanded


async def step(bench):
    request = CommandRequest(command=C.MOVE_ABSOLUTE, lease=bench.secret, joint_positions=THERE)
    await bench.control.step(request, operator="li")


def a_stop_is_sent_first_and_latched(bench):
    ports = bench.ports
    assert ports.made("send", STOP_UNIT) == [0]
    a_stop_is_sent_and_latched(bench)


def a_stop_is_sent_and_latched(bench):
    ports, latched = bench.ports, bench.authority.stop
    assert ports.made("send", STOP_UNIT)
    assert latched is not None
    assert (latched.sent_s is not None) == bool(ports.succeeded("send", STOP_UNIT))
    assert ports.made("latch file", "latched")
    assert ports.made("append later", "STOP")
    assert bench.authority.motion is None


def a_written_take_over_stops_the_motion(bench):
    if bench.ports.succeeded("append"):
        a_stop_is_sent_and_latched(bench)
        assert bench.ports.made("append")[0] < bench.ports.made("send", STOP_UNIT)[0]
        assert bench.authority.lease.holder == "wang"
    else:
        assert bench.authority.lease.holder == "li"
        assert bench.authority.stop is None


def the_stop_is_sent_again(bench):
    assert bench.ports.made("send", STOP_UNIT) == [0]
    assert bench.authority.stop is not None
    assert bench.ports.made("append later", "STOP_AGAIN") or not bench.ports.succeeded("send", STOP_UNIT)


def a_repeated_stop_is_audited(bench):
    assert bench.ports.made("send", STOP_UNIT)
    assert bench.authority.stop is not None
    assert bench.ports.made("append later", "STOP_AGAIN")


def only_a_written_lease_is_granted(bench):
    assert (bench.authority.lease is not None) == bool(bench.ports.succeeded("append"))


def a_sent_motion_is_booked(bench):
    assert (bench.authority.motion is not None) == bool(bench.ports.units())


def a_sent_hold_is_booked(bench):
    assert bench.authority.motion.held == bool(bench.ports.units())


def a_stop_is_clear_only_after_its_reset_was_sent(bench):
    sent = bool(bench.ports.units())
    assert (bench.authority.stop is None) == sent
    assert bool(bench.ports.made("latch file", "clear")) == sent


def a_written_program_runs(bench):
    if bench.control.program is not None:
        assert bench.ports.succeeded("append")
    assert not bench.ports.units()


TABLE = [
    ("free", lease(A.ACQUIRE), only_a_written_lease_is_granted),
    ("moving", stop, a_stop_is_sent_first_and_latched),
    ("running", stop, a_stop_is_sent_first_and_latched),
    ("moving", give(LinkLost("the cable is cut")), a_stop_is_sent_first_and_latched),
    ("moving", give(LeaseEnded(codes.ENDED_GATEWAY())), a_stop_is_sent_first_and_latched),
    ("moving", lease(A.RELEASE), a_stop_is_sent_and_latched),
    ("moving", lease(A.TAKE, "wang"), a_written_take_over_stops_the_motion),
    ("stopped", give(LinkRestored()), the_stop_is_sent_again),
    ("stopped", give(MotionObserved(True)), a_repeated_stop_is_audited),
    ("stopped", command(C.RESET, stop_id=1), a_stop_is_clear_only_after_its_reset_was_sent),
    ("held", command(C.MOVE_ABSOLUTE, joint_positions=THERE), a_sent_motion_is_booked),
    ("held", command(C.RUN_PROGRAM, program="home"), a_written_program_runs),
    ("running", step, a_sent_motion_is_booked),
    ("moving", command(C.HOLD), a_sent_hold_is_booked),
]


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "happens", "promise"), TABLE)
@pytest.mark.parametrize("send_error", [CUT, FAULT], ids=["link", "fault"])
async def test_a_decision_that_fails_breaks_no_promise(clock, begin, happens, promise, send_error):
    async def one(failing):
        bench = Bench(clock, send_error)
        await getattr(bench, begin)()
        bench.ports.calls.clear()
        bench.ports.failing = failing
        with contextlib.suppress(RefusedError, RuntimeError):
            await happens(bench)
        written = bench.ports.succeeded("append")
        assert all(written and written[0] < at for at, _ in bench.ports.units())
        promise(bench)
        calls, bench.ports.failing = list(bench.ports.calls), None
        await bench.control.close()
        return calls

    calls = await one(None)
    assert calls
    for number, (name, text, _) in enumerate(calls):
        assert (await one(number))[number] == (name, text, False)
