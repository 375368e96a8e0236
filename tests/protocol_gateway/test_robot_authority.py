"""Order of the decisions of a robot's authority, without sockets or disk."""

import asyncio
from dataclasses import replace

import pytest

from controllers.unit.driver import UnitDriver
from protocol_gateway.authority import decisions, events
from protocol_gateway.authority.decisions import CheckVerdict, PlannedProgram, Snapshot
from protocol_gateway.authority.lease_rules import Authority, Now
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.authority.robot_authority import RobotAuthority
from protocol_gateway.execution.control import Control, Performers
from protocol_gateway.link.link import LinkState, LinkStatus
from protocol_gateway.seam import Activity, Mode, StatusReceived
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from tests.protocol_gateway.conftest import later
from tests.protocol_gateway.control_bench import control_bench

A, C = LeaseRequest.Action, CommandRequest.Command
JOINTS = joints_of(load("pt600"))
THERE = (0.4, 0.1, 0.0, 0.0, 0.0)
BROKEN = codes.OTHER(detail="the cable is cut")
NOW = Now(100.0, 1_700_000_000_000_000_000, 1_600_000_000_000_000_000)
SEEN = Snapshot(
    now=NOW,
    controller=ControllerState(
        link=LinkStatus(LinkState.UP, codes.LINK_CONNECTED(where="there")),
        status=StatusReceived(activity=Activity.IDLE, mode=Mode.REMOTE, homed=True),
        positions=(0.0,) * 5,
    ),
)
STOP_UNIT = decisions.Send(b"1#COMMAND*stop@", urgent=True)
STOP = events.StopRequested(by="li", reason="smoke", source="test")


class Bench:
    """A robot's authority whose decisions are recorded and not performed.

    Attributes:
        performed: Names of the decisions since the last `clear`; "Stop" is the stop unit on the wire.
        during: Events that are handed over while the decision of a name is performed.
    """

    def __init__(self):
        self.robot_authority = RobotAuthority(Authority(), JOINTS, UnitDriver(JOINTS.types).prepare)
        self.seen = SEEN
        self.performed = []
        self.during = {}
        self.check_verdict = CheckVerdict()
        self.link = self.disk = self.changed = None
        self.cancelled = False

    def give(self, event):
        """Hand over an event and perform its decisions; return its result."""
        handled, result = self.robot_authority.handle(event, self.seen), None
        while True:
            try:
                decision = handled.send(result)
            except StopIteration as done:
                return done.value
            name = "Stop" if decision == STOP_UNIT else type(decision).__name__
            self.performed.append(name)
            if name in self.during:
                self.give(self.during.pop(name))
            result = {
                "Stop": self.link,
                "Send": self.link,
                "Append": (self.disk, self.seen),
                "CheckMotion": self.check_verdict,
                "Recheck": self.changed,
                "EnterCell": self.seen,
                "NumberStop": self.robot_authority.authority.last_stop_id + 1,
                "CancelPrograms": self.cancelled,
            }.get(name)

    def lease(self, action, operator="li", secret="secret", **fields):
        request = LeaseRequest(action=action, lease=secret, ttl_s=5.0, **fields)
        return self.give(
            events.LeaseRequested(request=request, operator=operator, source="test", secret=secret)
        )

    def command(self, command, number=1, checked=None, **fields):
        request = CommandRequest(command=command, id=number, lease="secret", **fields)
        return self.give(
            events.CommandsRequested(
                requests=(request,), operator="li", source="test", arrived=self.seen.now, program=checked
            )
        )

    def in_control(self):
        self.lease(A.ACQUIRE)
        self.performed.clear()
        return self

    def moving(self):
        self.in_control().command(C.MOVE_ABSOLUTE, joint_positions=THERE)
        self.performed.clear()
        return self


STOPPED = ["Stop", "NumberStop", "KeepLatch", "CancelPrograms", "PublishState", "PublishEvent", "AppendLater"]
APPLIED = ["SetTimer", "Controlled", "PublishState"]
CHECKED = ["EnterCell", "CheckMotion", "Append", "Recheck"]


@pytest.mark.parametrize(
    ("begin", "event", "order"),
    [
        ("in_control", STOP, STOPPED),
        ("in_control", events.LeaseEnded(codes.ENDED_GATEWAY()), [*APPLIED, "PublishEvent", "AppendLater"]),
        (
            "moving",
            events.LeaseEnded(codes.ENDED_GATEWAY()),
            [*STOPPED, *APPLIED, "PublishEvent", "AppendLater"],
        ),
        ("moving", events.LinkLost("the cable is cut"), STOPPED),
        ("in_control", events.LinkLost("the cable is cut"), []),
        ("in_control", events.LinkRestored(), []),
        ("in_control", events.SessionEnded("another"), []),
        ("moving", events.UnitRefused(), ["PublishState"]),
        (
            "in_control",
            events.MotionObserved(True),
            ["PublishEvent", *APPLIED, "PublishEvent", "AppendLater"],
        ),
    ],
)
def test_order_of_decisions_that_wait_for_nothing(begin, event, order):
    bench = getattr(Bench(), begin)()
    bench.give(event)
    assert bench.performed == order


@pytest.mark.parametrize(
    ("command", "fields", "order"),
    [
        (C.MOVE_ABSOLUTE, {"joint_positions": THERE}, [*CHECKED, "Send", "PublishState"]),
        (C.SPEED, {"speed_percent": 50.0}, [*CHECKED, "Send", "PublishState"]),
        (C.HOLD, {}, ["CancelPrograms", *CHECKED, "Send", "PublishState"]),
        (C.RUN_PROGRAM, {"program": "home"}, ["EnterCell", "Append", "Recheck"]),
    ],
)
def test_a_command_reaches_the_wire_only_after_its_audit_entry(command, fields, order):
    bench = Bench().in_control()
    checked = PlannedProgram(name="p", targets=(THERE,)) if command == C.RUN_PROGRAM else None
    assert bench.command(command, checked=checked, **fields).accepted
    assert bench.performed == order


@pytest.mark.parametrize(
    ("fault", "order", "code"),
    [
        ({"disk": BROKEN}, ["EnterCell", "CheckMotion", "Append"], "command.not_written"),
        ({"link": BROKEN}, [*CHECKED, "Send", "AppendLater"], "other"),
        ({"changed": BROKEN}, [*CHECKED, "AppendLater"], "command.changed"),
        (
            {"during": {"Append": STOP}},
            ["EnterCell", "CheckMotion", "Append", *STOPPED, "AppendLater"],
            "stop.latched",
        ),
        (
            {"during": {"Append": events.LeaseEnded(codes.ENDED_GATEWAY())}},
            ["EnterCell", "CheckMotion", "Append", *APPLIED, "PublishEvent", "AppendLater", "AppendLater"],
            "command.control_ended_meanwhile",
        ),
    ],
    ids=["disk", "link", "cell", "stop", "end of control"],
)
def test_nothing_is_sent_if_something_comes_between(fault, order, code):
    bench = Bench().in_control()
    vars(bench).update(fault)
    answer = bench.command(C.MOVE_ABSOLUTE, joint_positions=THERE)
    assert (answer.accepted, answer.reason.code) == (False, code)
    assert bench.performed == order
    assert bench.robot_authority.authority.lease is None or not bench.robot_authority.authority.lease.motion


def test_a_stop_never_waits():
    """Check that a stop at any point of a command yields no decision that must be awaited."""
    for name in ("EnterCell", "CheckMotion", "Append", "Recheck", "Send"):
        bench = Bench().in_control()
        bench.during = {name: STOP}
        bench.command(C.MOVE_ABSOLUTE, joint_positions=THERE)
        at = bench.performed.index(name) + 1
        assert bench.performed[at : at + len(STOPPED)] == STOPPED
        assert bench.robot_authority.authority.stop.by == "li"


def test_a_failed_stop_unit_is_latched_and_sent_when_the_link_is_back():
    bench = Bench().in_control()
    bench.link = BROKEN
    assert not bench.give(STOP).sent
    assert bench.performed == STOPPED
    bench.performed.clear()
    bench.link = None
    bench.give(events.LinkRestored())
    assert bench.performed == ["Stop", "PublishState", "PublishEvent", "AppendLater"]


def test_an_awaited_decision_of_an_event_that_must_not_wait_is_an_error():
    class Waits:
        def handle(self, event, seen):
            yield decisions.Append(())

    ports = Performers(
        audit_trail=None,
        latch=type("Latch", (), {"problem": None}),
        journal=None,
        send=None,
        controller=lambda: SEEN.controller,
        publish=None,
    )
    with pytest.raises(TypeError, match="Append cannot be performed without waiting"):
        Control(Waits(), ports).handle(STOP)


def test_a_publication_that_fails_hides_no_stop(tmp_path, caplog):
    async def main():
        async with control_bench(tmp_path) as bench:
            await bench.lease(A.ACQUIRE)
            await bench.commands((C.HOME, {}))

            def fail():
                raise RuntimeError("the mesh has gone")

            bench.ports.publish = fail
            bench.control.handle(events.LeaseEnded(codes.ENDED_GATEWAY()))
            assert bench.socket[-1] == b"1#COMMAND*stop@"
            assert bench.control.authority.stop.reason == "dead-man: the gateway is shutting down"
        assert [name for name, _ in bench.entries()][-2:] == ["STOP", "REVOKE"]

    asyncio.run(main())
    assert "PublishState failed" in caplog.text


def test_a_lease_that_cannot_be_recorded_is_not_granted():
    bench = Bench()
    bench.disk = BROKEN
    assert bench.lease(A.ACQUIRE).answer.reason.code == "lease.not_written"
    assert bench.performed == ["Append"]
    assert bench.robot_authority.authority.lease is None


def test_a_release_waits_for_no_disk_and_stops_motion():
    bench = Bench().moving()
    assert bench.lease(A.RELEASE).answer.accepted
    assert bench.performed == ["AppendLater", *STOPPED, *APPLIED, "PublishEvent"]


def test_expired_control_ends_before_a_command_is_evaluated():
    bench = Bench().moving()
    bench.seen = replace(SEEN, now=later(NOW, 6.0))
    assert bench.command(C.HOME, 2).reason.code == "lease.none"
    assert bench.performed[: len(STOPPED) + len(APPLIED)] == [*STOPPED, *APPLIED]


def test_a_request_for_control_expires_after_the_lease():
    bench = Bench().in_control()
    bench.lease(A.ASK, "wang")
    bench.lease(A.RELEASE)
    bench.performed.clear()
    bench.seen = replace(SEEN, now=later(NOW, 31.0))
    bench.give(events.TimePassed())
    assert bench.performed == ["SetTimer", "PublishState"]
    assert bench.robot_authority.authority.asked_by == ()


def test_the_speed_of_one_operator_is_not_that_of_the_next():
    bench = Bench()
    capabilities = replace(SEEN.controller.capabilities, first_speed_percent=25.0)
    bench.seen = replace(SEEN, controller=replace(SEEN.controller, capabilities=capabilities))

    def speed():
        return bench.robot_authority.authority.speed_percent

    bench.in_control()
    assert speed() == 25.0
    bench.command(C.SPEED, speed_percent=80.0)
    bench.performed.clear()
    bench.lease(A.RENEW)
    # The driver is not told again of the same control.
    assert (speed(), bench.performed) == (80.0, ["SetTimer", "PublishState"])
    bench.lease(A.TAKE, "wang", secret="another", reason="shift")
    assert speed() == 25.0
    assert "Controlled" in bench.performed


def test_a_speed_that_stays_in_the_controller_stays_over_a_change_of_control():
    bench = Bench().in_control()
    bench.command(C.SPEED, speed_percent=80.0)
    bench.lease(A.RELEASE)
    assert bench.robot_authority.authority.speed_percent == 80.0


@pytest.mark.parametrize("runs", [False, True])
def test_hold_at_rest_is_sent_only_if_a_program_runs(runs):
    bench = Bench().in_control()
    bench.give(events.MotionObserved(False))
    if runs:
        bench.command(C.RUN_PROGRAM, program="home", checked=PlannedProgram(name="p", targets=(THERE,)))
    bench.cancelled = True
    bench.performed.clear()
    assert bench.command(C.HOLD, 2).accepted
    assert ("Send" in bench.performed) == runs


def test_nothing_is_sent_again_to_a_robot_that_has_become_read_only():
    bench = Bench()
    bench.give(STOP)
    other = codes.STOP_OTHER_SOFTWARE(before="5.12", now="5.21")
    bench.seen = replace(SEEN, now=later(NOW, 10.0), controller=replace(SEEN.controller, read_only=other))
    bench.performed.clear()
    bench.give(events.MotionObserved(True))
    bench.give(events.LinkRestored())
    assert "Stop" not in bench.performed
    bench.seen = replace(bench.seen, controller=SEEN.controller)
    bench.give(events.MotionObserved(True))
    assert "Stop" in bench.performed
