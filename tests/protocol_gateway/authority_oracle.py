"""Two controls of one robot, the present one and the one before it, that are given the same events.

    python -m tests.protocol_gateway.authority_oracle 100000     number of sequences

Every sequence must give equal states, equal effects in equal order, and equal answers.
"""

import asyncio
import secrets
import sys
from collections import deque
from dataclasses import astuple, dataclass, replace
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from protocol_gateway.audit.entry import Outcome
from protocol_gateway.authority.lease_rules import MOTION_COMMANDS, Authority, Now, refused
from protocol_gateway.authority.lease_rules import Stop as LatchedStop
from protocol_gateway.authority.preconditions import Controller
from protocol_gateway.control import control as new_control
from protocol_gateway.control import robot_authority as new_authority
from protocol_gateway.control.effects import Finding, Program
from protocol_gateway.control.events import (
    LeaseEnded,
    LinkLost,
    LinkRestored,
    MotionObserved,
    ProgramEnded,
    SessionEnded,
    StatusChanged,
    StatusReported,
    TimePassed,
    UnitRefused,
)
from protocol_gateway.drivers.driver import Activity, Mode, StatusReceived
from protocol_gateway.drivers.unit import UnitDriver
from protocol_gateway.errors import AuditError, CheckError, LinkDownError
from protocol_gateway.link.link import LinkState, LinkStatus
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest
from robomesh.schemas.robomesh_pb2 import Event as EventMessage
from robots.description import load
from robots.joints import joints_of
from tests.protocol_gateway.old_authority import control as old_control
from tests.protocol_gateway.old_authority import stop_handler as old_stops
from tests.protocol_gateway.old_authority.entries import entry_of

A, C = LeaseRequest.Action, CommandRequest.Command
JOINTS = joints_of(load("pt600"))
HOME = tuple(JOINTS.home.tolist())
THERE = (0.4, 0.1, 0.0, 0.0, 0.0)
BAD = (99.0, 0.0, 0.0, 0.0, 0.0)
NAMES = ("li", "wang")
TURNS = 12  # of the event loop: enough for every task that can go on
CABLE = codes.OTHER(detail="the cable is cut")
LATCH = codes.OTHER(detail="the latch file cannot be written")
MOVED = codes.ROBOT_MOVED()
FINDINGS = {
    "free": Finding(),
    "close": Finding(warning=codes.CHECK_NO_POSITION()),
    "skipped": Finding(warning=codes.CHECK_NO_POSITION(), code="check.skipped"),
    "refused": Finding(refusal=refused(codes.CHECK_NO_POSITION(), what="Not sent")),
}


@dataclass
class Surroundings:
    """The environment of both controls; the sequence changes it."""

    now: Now
    link: LinkState = LinkState.UP
    activity: Activity | None = Activity.IDLE
    mode: Mode | None = Mode.REMOTE
    homed: bool | None = True
    positions: tuple[float, ...] | None = HOME
    read_only: bool = False
    broken: bool = False
    latch_broken: bool = False
    changed: bool = False
    secret: str = ""

    def controller(self) -> Controller:
        return Controller(
            link=LinkStatus(self.link, CABLE),
            status=StatusReceived(activity=self.activity, mode=self.mode, homed=self.homed),
            positions=self.positions,
            read_only=codes.NO_STOP_CODE() if self.read_only else None,
        )


class Side:
    """One control with its ports, which write all effects into `effects`."""

    def __init__(self, around: Surroundings) -> None:
        self.around = around
        self.effects: list[Any] = []
        self.writes: deque[asyncio.Future[bool]] = deque()
        self.checks: deque[asyncio.Future[str]] = deque()
        self.tasks: list[asyncio.Task[None]] = []
        self.motion_lock_held = asyncio.Lock()
        self.preparing: list[str] = []
        self.cancelled: list[Any] = []
        self.secrets: dict[str, str] = {}

    # Interface of AuditTrail, LatchFile, Journal and Checks.

    async def write_before(self, *entries: Any) -> None:
        self.effects.append(("append", *(replace(each, time_ns=0) for each in entries)))
        written: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
        self.writes.append(written)
        if not await written:
            raise AuditError(codes.AUDIT_SLOW(seconds=1))

    def write_later(self, entry: Any) -> None:
        self.effects.append(("append later", replace(entry, time_ns=0)))

    @property
    def problem(self) -> Any:
        return LATCH if self.around.latch_broken else None

    def next_number(self, last: int, wall_ns: int) -> int:
        return last + 1

    def keep(self, stop: LatchedStop | None, last_stop_id: int) -> None:
        self.effects.append(("latch", stop, last_stop_id))

    def report(self, severity: Any, code: str, text: str, *, why: Any = None, **values: Any) -> None:
        self.effects.append(("event", severity, code, text, why, values))

    def motion_lock(self, requests: Any) -> Any:
        moves = any(each.command in MOTION_COMMANDS for each in requests)
        return self.motion_lock_held if moves else new_control.contextlib.nullcontext()

    async def check(self, requests: Any) -> Finding:
        if not any(each.command in MOTION_COMMANDS - {C.RUN_PROGRAM} for each in requests):
            return Finding()
        self.effects.append(("check", [each.SerializeToString() for each in requests]))
        checked: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self.checks.append(checked)
        return FINDINGS[await checked]

    def changed(self, finding: Finding) -> Any:
        return MOVED if self.around.changed and finding.start else None

    def send(self, unit: bytes) -> None:
        if self.around.broken:
            self.effects.append(("not sent", unit))
            raise LinkDownError(CABLE)
        self.effects.append(("send", unit))

    def publish(self) -> None:
        self.effects.append(("publish", self.state()))

    # Steps of a sequence, on either side.

    def state(self) -> Any:
        program = self.program()
        return self.authority(), None if program is None else astuple(program), self.speed()

    def ask(self, name: str, work: Any) -> None:
        async def answered() -> None:
            try:
                answer = await work
            except RefusedError as error:
                answer = ("refused", str(error), error.reason)
            if getattr(answer, "lease", ""):
                self.secrets[name] = answer.lease
            self.effects.append(("answer", name, answer))

        self.tasks.append(asyncio.ensure_future(answered()))

    def lease(self, name: str, request: LeaseRequest) -> None:
        raise NotImplementedError

    def authority(self) -> Authority:
        raise NotImplementedError

    def program(self) -> Any:
        raise NotImplementedError

    def speed(self) -> float | None:
        raise NotImplementedError


class Old(Side):
    """The control before `RobotAuthority`."""

    def __init__(self, around: Surroundings) -> None:
        super().__init__(around)
        self.context = old_stops.ControlContext(
            authority=Authority(),
            driver=UnitDriver(JOINTS.types),
            audit_trail=self,
            latch=self,
            journal=self,
            send=self.send,
            controller=around.controller,
            on_change=self.publish,
            set_timer=lambda at_s: self.effects.append(("timer", at_s)),
            orphan="li",
        )
        self.control = old_control.Control(JOINTS, self.context, self)

    def authority(self) -> Authority:
        return replace(self.context.authority, speed_percent=None, reset_s=None)

    def program(self) -> Any:
        return self.context.program

    def speed(self) -> float | None:
        return self.control.speed_percent

    def lease(self, name: str, request: LeaseRequest) -> None:
        self.ask(name, self.control.leases.ask(request, operator=name, source="mesh"))

    def commands(self, name: str, requests: list[CommandRequest]) -> None:
        self.ask(name, self.control.attempt(requests, operator=name, source="mesh"))

    def run_program(self, name: str, request: CommandRequest, start: Any, refusal: Any) -> None:
        def begin() -> None:
            if start and self.around.changed:
                raise CheckError(codes.PROGRAM_MOVED())
            self.context.program = old_stops.RunningProgram("p", (THERE, HOME))
            self.effects.append(("start", "p"))

        begin_or_none = None if refusal else begin
        self.control.admit([request], name)
        self.ask(
            name,
            self.control.attempt(
                [request], operator=name, source="mesh", begin=begin_or_none, refused=refusal
            ),
        )

    def prepare(self) -> None:
        self.context.preparing.add(asyncio.get_running_loop().create_future())

    def prepared(self) -> None:
        self.context.preparing.clear()

    def cancelled_programs(self) -> list[str]:
        return sorted(each.result().text for each in self.context.preparing if each.done())

    def step(self, name: str, request: CommandRequest) -> None:
        async def step() -> Any:
            answer = await self.control.step(request, operator=name)
            running = self.context.program
            if answer.accepted and request.command in MOTION_COMMANDS and running is not None:
                self.context.program = replace(running, done=running.done + 1)
            return answer

        self.ask(name, step())

    def end_program(self, problem: Any) -> None:
        if self.context.program is None:
            return
        self.context.program = None
        outcome = codes.PROGRAM_DONE(program="p")
        if problem is not None:
            outcome = codes.PROGRAM_ENDED(problem, program="p", line=3)
        severity = EventMessage.Severity.INFO if problem is None else EventMessage.Severity.WARNING
        self.report(severity, outcome.code, outcome.text, why=outcome, program="p")
        self.write_later(
            entry_of(
                "PROGRAM_END",
                operator="li",
                source="program",
                outcome=Outcome.ACCEPTED if problem is None else Outcome.FAILED,
                text=outcome.text,
                why=outcome,
            )
        )
        self.publish()

    def stop(self, name: str, reason: str) -> None:
        self.effects.append(self.control.stop(by=name, reason=reason, source="mesh"))

    def poll(self) -> None:
        self.control.leases.expire()

    def end_session(self, session: str) -> None:
        self.control.leases.end_session(session)

    def end_lease(self) -> None:
        self.control.leases.end(codes.ENDED_GATEWAY())

    def link_lost(self) -> None:
        self.control.link_lost("the cable is cut")

    def link_restored(self) -> None:
        self.control.send_latched_stop()

    def status_changed(self) -> None:
        self.control.status_changed()

    def reported(self, activity: Activity | None, dated_s: float) -> None:
        self.control.reported(activity, dated_s)

    def unit_refused(self) -> None:
        self.control.refused()

    def observe(self, moving: bool) -> None:
        self.control.observe(moving=moving)


class _Control(new_control.Control):
    """Control that records its timer."""

    def __init__(self, side: "New", ports: new_control.Ports) -> None:
        super().__init__(side.robot_authority, ports, side)
        self._side = side

    def _set_timer(self, at_s: float | None) -> None:
        self._side.effects.append(("timer", at_s))


class New(Side):
    """The present control."""

    def __init__(self, around: Surroundings) -> None:
        super().__init__(around)
        encode = UnitDriver(JOINTS.types).encode
        self.robot_authority = new_authority.RobotAuthority(Authority(), JOINTS, encode, orphan="li")
        ports = new_control.Ports(
            audit_trail=self,
            latch=self,
            journal=self,
            send=self.send,
            controller=around.controller,
            publish=self.publish,
        )
        self.control = _Control(self, ports)
        self.entered = new_control.contextlib.ExitStack()

    def authority(self) -> Authority:
        return replace(self.robot_authority.authority, speed_percent=None, reset_s=None)

    def program(self) -> Any:
        running = self.robot_authority.program
        if running is None:
            return None
        name, targets = running.program.name, running.program.targets
        return old_stops.RunningProgram(name, targets, running.done, running.held, running.given_up)

    def speed(self) -> float | None:
        return self.robot_authority.authority.speed_percent

    def lease(self, name: str, request: LeaseRequest) -> None:
        self.ask(name, self.control.lease(request, operator=name, source="mesh"))

    def commands(self, name: str, requests: list[CommandRequest]) -> None:
        self.ask(name, self.control.attempt(requests, operator=name, source="mesh"))

    def run_program(self, name: str, request: CommandRequest, start: Any, refusal: Any) -> None:
        program = None if refusal else Program(name="p", targets=(THERE, HOME), start=start)
        self.control.admit(request, name)

        async def run() -> Any:
            answer = await self.control.attempt(
                [request], operator=name, source="mesh", program=program, refused=refusal
            )
            running = self.robot_authority.program
            if program is not None and running is not None and running.program is program:
                self.effects.append(("start", "p"))
            return answer

        self.ask(name, run())

    def prepare(self) -> None:
        self.cancelled.append(self.entered.enter_context(self.control.preparing_program()))

    def prepared(self) -> None:
        self.entered.close()
        self.cancelled.clear()

    def cancelled_programs(self) -> list[str]:
        return sorted(each.result().text for each in self.cancelled if each.done())

    def step(self, name: str, request: CommandRequest) -> None:
        self.ask(name, self.control.step(request, operator=name))

    def end_program(self, problem: Any) -> None:
        if self.robot_authority.program is not None:
            self.control.handle(ProgramEnded("p", "li", 3, problem))

    def stop(self, name: str, reason: str) -> None:
        self.effects.append(self.control.stop(by=name, reason=reason, source="mesh"))

    def poll(self) -> None:
        self.control.handle(TimePassed())

    def end_session(self, session: str) -> None:
        self.control.handle(SessionEnded(session))

    def end_lease(self) -> None:
        self.control.handle(LeaseEnded(codes.ENDED_GATEWAY()))

    def link_lost(self) -> None:
        self.control.handle(LinkLost("the cable is cut"))

    def link_restored(self) -> None:
        self.control.handle(LinkRestored())

    def status_changed(self) -> None:
        self.control.handle(StatusChanged())

    def reported(self, activity: Activity | None, dated_s: float) -> None:
        self.control.handle(StatusReported(activity, dated_s))

    def unit_refused(self) -> None:
        self.control.handle(UnitRefused())

    def observe(self, moving: bool) -> None:
        self.control.handle(MotionObserved(moving))


# ---------------------------------------------------------------- sequences

# "holder" is the lease's holder at that time, so that most requests are not rejected early.
names = st.sampled_from(["holder", "holder", "holder", *NAMES])
moves = st.sampled_from([(C.MOVE_ABSOLUTE, THERE), (C.HOME, HOME), (C.MOVE_ABSOLUTE, HOME)])
others = st.tuples(
    st.sampled_from([C.HOLD, C.RESUME, C.RESET, C.SPEED, C.MOVE_RELATIVE, C.MOVE_ABSOLUTE, C.TRACE_ON]),
    st.sampled_from([THERE, HOME, BAD, (0.1,)]),
)
command = st.one_of(moves, others, others)
# The check and the audit entry of a continued request complete immediately.
carried = st.sampled_from([True, True, False])
TTLS = [0.0, 0.5, 5.0]


def always(*values: Any) -> Any:
    """Return a strategy of one event."""
    return st.tuples(*map(st.just, values))


def lease(who: Any, *actions: Any, reasons: Any = ("fire",), carried: Any = carried) -> Any:
    """Return a strategy of lease requests."""
    drawn = (st.sampled_from(each) for each in (actions, reasons, TTLS))
    return st.tuples(st.just("lease"), who, *drawn, carried)


def commands(
    who: Any,
    those: Any,
    *,
    offsets: Any = (1,),
    late: Any = (None,),
    back: Any = (0,),
    carried: Any = carried,
) -> Any:
    """Return a strategy of commands."""
    drawn = (st.sampled_from(each) for each in (offsets, late, back))
    return st.tuples(st.just("commands"), who, those, *drawn, carried)


holder = st.just("holder")
requests = st.one_of(
    lease(names, A.ACQUIRE, A.RENEW, A.RELEASE, A.OFFER, A.ACCEPT, A.TAKE, A.ASK, reasons=("", "fire")),
    lease(st.just("li"), A.ACQUIRE, carried=st.just(True)),
    commands(
        names,
        st.lists(command, min_size=1, max_size=2),
        offsets=(1, 1, 1, 1, 0, -1),
        late=(None, None, None, 0.3, -1.0),
        back=(0, 0, 1),
    ),
    commands(holder, st.lists(moves, min_size=1, max_size=1)),
    commands(holder, st.lists(others, min_size=1, max_size=1)),
    commands(holder, st.just([(C.RESET, HOME)]), carried=st.just(True)),
    st.tuples(st.just("run_program"), names, st.booleans(), st.sampled_from([False, False, True]), carried),
    st.tuples(st.just("step"), names, command, carried),
    st.tuples(st.just("step"), holder, moves, st.just(True)),
    st.tuples(st.just("stop"), st.sampled_from(NAMES), st.sampled_from(["", "smoke"])),
)
seen = st.one_of(
    st.tuples(st.just("positions"), st.sampled_from([HOME, THERE])),
    st.tuples(st.just("activity"), st.sampled_from([Activity.IDLE, Activity.MOVING, None])),
    st.tuples(st.just("activity"), st.sampled_from([*Activity, None])),
    st.tuples(st.just("link"), st.sampled_from(LinkState)),
    st.tuples(st.just("mode"), st.sampled_from([Mode.REMOTE, Mode.LOCAL, None])),
    st.tuples(st.just("homed"), st.sampled_from([True, True, False, None])),
    st.tuples(st.just("positions"), st.none()),
    st.tuples(st.sampled_from(["broken", "latch_broken", "changed", "read_only"]), st.booleans()),
)
SECONDS = [0.01, 0.05, 0.2, 0.6, 1.1, 2.1, 6.0, 31.0]
happenings = st.one_of(
    st.tuples(st.just("written"), st.sampled_from([True, True, True, False])),
    st.tuples(st.just("checked"), st.sampled_from([*FINDINGS, "free", "free"])),
    st.tuples(st.just("pass"), st.sampled_from(SECONDS), st.booleans()),
    st.tuples(st.just("observe"), st.booleans()),
    st.tuples(
        st.just("reported"),
        st.sampled_from([Activity.IDLE, Activity.IDLE, Activity.MOVING, None]),
        st.sampled_from([0.0, 0.3]),
    ),
    st.tuples(st.just("see"), seen),
    always("see", ("activity", Activity.IDLE)),
    always("see", ("link", LinkState.UP)),
    st.tuples(
        st.sampled_from(
            ["prepare", "prepared", "poll", "link_lost", "link_restored", "status_changed", "unit_refused"]
        )
    ),
    always("unit_refused"),
    st.sampled_from([("end_lease",), ("end_session", "li"), ("end_program", True), ("end_program", False)]),
    st.tuples(st.just("cancel"), st.integers(0, 3)),
)
READY = [("lease", "li", A.ACQUIRE, "", 5.0, True)]


def given_command(kind: Any, *, carried: bool = True) -> tuple[Any, ...]:
    """Return the event of one command of the holder."""
    return ("commands", "holder", [(kind, THERE)], 1, None, 0, carried)


IDLE, STOPPED = ("see", ("activity", Activity.IDLE)), ("see", ("activity", Activity.STOPPED))
ARRIVED, HELD = ("see", ("positions", THERE)), ("see", ("activity", Activity.HOLDING))
MOVE, STOP = given_command(C.MOVE_ABSOLUTE), ("stop", "wang", "smoke")
REST, MOVING = ("observe", False), ("observe", True)
RUN, STEP = ("run_program", "holder", False, False, True), ("step", "holder", (C.MOVE_ABSOLUTE, THERE), True)
LATER, SOON = ("pass", 2.1, False), ("pass", 0.2, False)
# Sequences that random events reach too rarely; a sequence omits some events of each.
EPISODES = [
    [
        REST,
        MOVE,
        MOVING,
        SOON,
        ARRIVED,
        ("reported", Activity.IDLE, 0.0),
        ("reported", Activity.IDLE, 0.0),
        REST,
    ],
    [MOVE, MOVING, ("link_lost",), ("link_restored",), LATER, MOVING, LATER, MOVING],
    [STOP, SOON, ("link_restored",), LATER, MOVING, ("pass", 1.1, False), MOVING, LATER, MOVING],
    [STOP, STOPPED, REST, given_command(C.RESET), MOVE, ("status_changed",), MOVE, ("pass", 0.6, True), MOVE],
    [MOVE, given_command(C.SPEED), ("unit_refused",), LATER, ("pass", 31.0, False), MOVE, ("unit_refused",)],
    [RUN, STEP, given_command(C.HOLD), HELD, given_command(C.RESET), STEP, ("end_program", False), IDLE],
    [RUN, STEP, MOVING, given_command(C.HOLD), given_command(C.RESUME), STEP, STEP, ("end_program", True)],
    [("prepare",), given_command(C.HOLD), ("prepared",), ("prepare",), STOP, ("prepared",)],
    [
        given_command(C.MOVE_ABSOLUTE, carried=False),
        given_command(C.HOLD),
        ("checked", "free"),
        ("written", True),
    ],
    [given_command(C.MOVE_ABSOLUTE, carried=False), ("checked", "free"), STOP, ("written", True)],
    [("lease", "holder", A.OFFER, "", 5.0, True), ("lease", "wang", A.ACCEPT, "", 5.0, True), MOVE],
    [MOVE, MOVING, ("lease", "wang", A.TAKE, "fire", 5.0, True), MOVING, MOVE],
    [MOVING, LATER, REST, *READY, MOVING, ("pass", 0.6, True), REST, MOVING],
]


def partly(episode: list[Any]) -> Any:
    """Return a strategy of an episode with some of its events left out."""
    return st.tuples(*(st.sampled_from([[each], [each], [each], []]) for each in episode)).map(joined)


def joined(parts: Any) -> list[Any]:
    """Return the events of all parts."""
    return [event for part in parts for event in part]


single = st.one_of(requests, happenings).map(lambda event: [event])
parts = st.lists(st.one_of(single, single, single, *map(partly, EPISODES)), max_size=12)
sequences = st.tuples(st.sampled_from([READY, READY, READY, []]), parts.map(joined)).map(joined)


class Pair:
    """Both sides, and the sequence's knowledge about them."""

    def __init__(self) -> None:
        self.around = Surroundings(Now(1000.0, 1_700_000_000_000_000_000))
        self.sides = (Old(self.around), New(self.around))
        self.last_id = 0

    async def give(self, number: int, event: tuple[Any, ...]) -> None:
        """Give an event to both sides, let their tasks go on, and compare."""
        kind, *values = event
        self.around.secret = f"secret {number}"
        if kind == "see":
            setattr(self.around, *values[0])
        elif kind == "pass":
            seconds, polled = values
            now = self.around.now
            self.around.now = Now(now.monotonic_s + seconds, now.wall_ns + round(seconds * 1e9))
            kind = "poll" if polled else ""
            values = []
        if kind in ("commands", "run_program"):
            self.last_id += 1
        carry = kind in ("lease", "commands", "run_program", "step") and values.pop()
        if values and values[0] == "holder":
            lease = self.sides[0].authority().lease
            values[0] = "li" if lease is None else lease.holder
        for side in self.sides:
            if kind and kind != "see":
                getattr(self, f"_{kind}", self._call(kind))(side, *values)
        await self._settle(event)
        for _ in range(2 if carry else 0):
            for side in self.sides:
                self._checked(side, "free")
            await self._settle(event)
            for side in self.sides:
                self._written(side, well=True)
            await self._settle(event)

    async def _settle(self, event: object) -> None:
        for _ in range(TURNS):
            await asyncio.sleep(0)
        self.compare(event)

    def compare(self, event: object) -> None:
        old, new = self.sides
        assert old.effects == new.effects, event
        assert old.state() == new.state(), event
        assert old.cancelled_programs() == new.cancelled_programs(), event
        assert len(old.writes) == len(new.writes)
        assert len(old.checks) == len(new.checks)

    def _call(self, kind: str) -> Any:
        return lambda side, *values: getattr(side, kind)(*values)

    def _lease(self, side: Any, name: str, action: Any, reason: str, ttl_s: float) -> None:
        request = LeaseRequest(
            action=action,
            lease=side.secrets.get(name, ""),
            ttl_s=ttl_s,
            to="wang",
            reason=reason,
            session=f"session of {name}",
        )
        side.lease(name, request)

    def _request(
        self, side: Any, name: str, command: Any, positions: Any, stop_back: int = 0
    ) -> CommandRequest:
        request = CommandRequest(lease=side.secrets.get(name, ""), command=command)
        if command in (C.MOVE_ABSOLUTE, C.MOVE_RELATIVE):
            request.joint_positions.extend(positions)
        if command == C.SPEED:
            request.speed_percent = 50.0
        if command == C.RESET:
            request.stop_id = max(0, side.authority().last_stop_id - stop_back)
        return request

    def _commands(
        self, side: Any, name: str, commands: Any, offset: int, late_s: float | None, stop_back: int
    ) -> None:
        requests = []
        for number, (kind, positions) in enumerate(commands):
            request = self._request(side, name, kind, positions, stop_back)
            request.id = max(0, 2 * self.last_id + offset + number)
            if late_s is not None:
                request.not_after.FromNanoseconds(self.around.now.wall_ns + round(late_s * 1e9))
            requests.append(request)
        side.commands(name, requests)

    def _run_program(self, side: Any, name: str, must_rest: bool, refuse: bool) -> None:
        request = CommandRequest(
            lease=side.secrets.get(name, ""), command=C.RUN_PROGRAM, id=2 * self.last_id + 1, program="home"
        )
        refusal = refused(codes.CHECK_NO_POSITION(), what="Not run") if refuse else None
        side.run_program(name, request, HOME if must_rest else None, refusal)

    def _step(self, side: Any, name: str, command: Any) -> None:
        side.step(name, self._request(side, name, *command))

    def _written(self, side: Any, well: bool) -> None:
        while side.writes:
            written = side.writes.popleft()
            if not written.done():
                written.set_result(well)
                return

    def _checked(self, side: Any, finding: str) -> None:
        while side.checks:
            checked = side.checks.popleft()
            if not checked.done():
                checked.set_result(finding)
                return

    def _reported(self, side: Any, activity: Any, age_s: float) -> None:
        side.reported(activity, self.around.now.monotonic_s - age_s)

    def _end_session(self, side: Any, name: str) -> None:
        side.end_session(f"session of {name}")

    def _end_program(self, side: Any, well: bool) -> None:
        side.end_program(None if well else codes.PROGRAM_GIVEN_UP())

    def _cancel(self, side: Any, number: int) -> None:
        waiting = [task for task in side.tasks if not task.done()]
        if number < len(waiting):
            waiting[number].cancel()

    async def close(self) -> None:
        for side in self.sides:
            for task in side.tasks:
                task.cancel()
            await asyncio.gather(*side.tasks, return_exceptions=True)


async def compare_sequence(sequence: list[tuple[Any, ...]]) -> None:
    """Give a sequence to both sides and compare them after each event."""
    pair = Pair()
    saved = old_stops.read_clocks, old_control.read_clocks, new_control.read_clocks, secrets.token_urlsafe
    from tests.protocol_gateway.old_authority import leases as old_leases

    def read_clocks() -> Now:
        return pair.around.now

    for module in (old_stops, old_control, old_leases, new_control):
        module.read_clocks = read_clocks
    secrets.token_urlsafe = lambda size=None: pair.around.secret
    try:
        for number, event in enumerate(sequence):
            await pair.give(number, event)
    finally:
        old_stops.read_clocks, old_control.read_clocks, new_control.read_clocks, secrets.token_urlsafe = saved
        old_leases.read_clocks = saved[0]
        await pair.close()


def compare(count: int, start: int | None = None, *, shrink: bool = True) -> None:
    """Compare generated sequences.

    Args:
        start: Seed of the generator; None: hypothesis chooses.
        shrink: Find a short sequence that shows the same difference.
    """
    loop = asyncio.new_event_loop()

    @settings(
        max_examples=count,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        database=None,
        phases=[Phase.generate, Phase.shrink] if shrink else [Phase.generate],
    )
    @given(sequences)
    def one(sequence: list[tuple[Any, ...]]) -> None:
        loop.run_until_complete(compare_sequence(sequence))

    try:
        (one if start is None else seed(start)(one))()
    finally:
        loop.close()


if __name__ == "__main__":
    compare(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else None)
    print(f"{sys.argv[1]} sequences: equal states, effects and answers")
