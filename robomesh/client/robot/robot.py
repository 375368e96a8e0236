"""A robot of the mesh: its topics, stop, kinematics, and control."""

import asyncio
import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from math import radians
from pathlib import Path
from typing import Any, Literal, cast

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import Message

from robomesh import reason_codes as codes
from robomesh.client.robot.commands import StopResult, numbers, program_text, request_stop
from robomesh.client.robot.control import AsyncArm
from robomesh.client.robot.notes import Note, read_notes, withdraw_note, write_note
from robomesh.client.robot.samples import (
    ROTARY,
    Event,
    JointState,
    Sample,
    SignalState,
    event_of,
    in_degrees,
    joint_types,
    sample_fields,
)
from robomesh.client.robot.streams import AsyncStream, OnStale, SampleReader, check_options
from robomesh.contract.keys import check_chunk, check_name, robot_key
from robomesh.contract.topics import OF_ARM, stale_after_s, topic
from robomesh.errors import MessageError, NoAnswerError
from robomesh.publications.subscription import Sample as RawSample
from robomesh.publications.subscription import Subscription
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session

_EVENTS = 1000
# A check or a solution with restarts takes seconds on a busy machine.
_KINEMATICS_TIMEOUT_S = 30.0

Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class InverseResult:
    """Joint positions that bring the tool to a pose.

    Attributes:
        solutions: Joint positions [rad or m], the nearest first; empty: none, for the reason in `reason`.
        residual_m, residual_rad: Distance and angle of the tool from the pose.
        reason: Why there is no solution, for people; empty: there is one.
        analytic: Solved in closed form, so that all solutions are known.
    """

    solutions: tuple[tuple[float, ...], ...]
    residual_m: float
    residual_rad: float
    reason: str
    analytic: bool


@dataclass(frozen=True)
class Violation:
    """A place in a program that breaks a rule.

    Attributes:
        line: In the program's text, from 1.
        time_s, until_s: From the program's start [s].
        kind: "program", "limit", "speed", "singularity", "collision", "clearance" or "unreachable".
        pair: The two objects: "robot/link", a fixture's name, or "the floor".
        distance_m: Smallest distance of the pair [m]; 0: they touch; None: not a matter of distance.
        refuses: A gateway with `check = "require"` refuses the program for it.
        text: Sentence for people.
    """

    line: int
    time_s: float
    until_s: float
    kind: str
    pair: tuple[str, ...]
    distance_m: float | None
    refuses: bool
    text: str


@dataclass(frozen=True)
class CheckResult:
    """Result of the check of a program.

    Attributes:
        ok: Nothing that refuses it.
        duration_s: Planned duration [s].
        notes: Limits of the check, for people.
        alone: Checked only against the arm itself: no floor, no fixture, no other robot.
    """

    ok: bool
    duration_s: float
    violations: tuple[Violation, ...]
    notes: tuple[str, ...]
    alone: bool


class AsyncRobot:
    """A robot of the mesh, for asynchronous programs. Positions are in rad, of prismatic joints in m.

    Attributes:
        site, name: Its site and its name there.
    """

    def __init__(self, session: Session, site: str, name: str) -> None:
        self._session = session
        self.site, self.name = check_name(site, "site"), check_name(name, "robot")
        # Filled in when the description arrives; shared by all joint states.
        self._types: dict[str, str] = {}

    def __str__(self) -> str:
        return f"{self.site}/{self.name}"

    def __repr__(self) -> str:
        return f"<robot {self}>"

    # ----------------------------------------------------------------- topics

    def joints(
        self, *, slow: bool = False, buffer: int = 1, on_stale: OnStale = "raise"
    ) -> AsyncStream[JointState]:
        """Return the joint states, the newest first.

        Args:
            slow: The 10 Hz states for slow lines.
            buffer: Number of states kept for a slow program; older ones are skipped, and counted.
            on_stale: "raise": raise StaleError when no current state arrives in time. "yield": return the
                last state again, once, with `stale` true.
        """
        states = self.topic("joints/slow" if slow else "joints", buffer=buffer, on_stale=on_stale)
        return cast("AsyncStream[JointState]", states)

    def signals(self, *, buffer: int = 1, on_stale: OnStale = "raise") -> AsyncStream[SignalState]:
        """Return what the controller reports in addition to joints, the newest first.

        Args:
            buffer, on_stale: As for `joints`.
        """
        return cast("AsyncStream[SignalState]", self.topic("signals", buffer=buffer, on_stale=on_stale))

    def topic(self, name: str, *, buffer: int = 1, on_stale: OnStale = "raise") -> AsyncStream[Sample]:
        """Return the messages of a topic, the newest first: "controller", "kinematics", "lease", ...

        Args:
            buffer, on_stale: As for `joints`.

        Raises:
            UnknownTopicError: If there is no such topic.
        """
        subscription = self._subscribe(name, buffer, on_stale)
        of_joints = subscription.topic.schema is JointStates
        of_signals = subscription.topic.schema is schema.Signals

        def convert(sample: RawSample, stale: bool, skipped: int) -> Iterator[Sample]:
            fields = sample_fields(sample, sample.message(), stale=stale, skipped=skipped)
            if of_joints:
                yield JointState(**fields, types=self._types)
            else:
                yield SignalState(**fields) if of_signals else Sample(**fields)

        limit_s = stale_after_s(name, None)
        reader = SampleReader(subscription, convert, limit_s=limit_s, on_stale=on_stale)

        async def learn() -> None:
            """Learn the types of the joints, and the robot's own time for its joints."""
            with contextlib.suppress(NoAnswerError):
                # Without it, only degrees are not known.
                reader.set_limit(stale_after_s(name, await self.description()))

        return AsyncStream(reader, learn if name in OF_ARM else None)

    def events(self, *, history: bool = True) -> AsyncStream[Event]:
        """Return the events of the robot's gateway and of other services about it.

        Args:
            history: Begin with the last 100 of each service, oldest first.
        """
        return AsyncStream(events_of(self._session, f"robomesh/{self}/events/**", history=history))

    async def last(self, name: str) -> Sample | None:
        """Return the last message of a topic, of unknown age; None: no service has one.

        Raises:
            UnknownTopicError: If there is no such topic.
        """
        async with self.topic(name, on_stale="yield") as stream:
            await stream.prepare()
            return await first_of(stream)

    async def description(self) -> schema.Description:
        """Return the robot's description: joints with limits, links, frames, URDF.

        Raises:
            NoAnswerError: If no kinematics service publishes it.
        """
        message = await self._session.last(self._key("description"))
        if not isinstance(message, schema.Description):
            raise NoAnswerError(f"{self} has no description: start its kinematics service")
        self._types.clear()
        self._types.update(joint_types(message))
        return message

    # --------------------------------------------------------------- requests

    async def stop(self, reason: str = "") -> StopResult:
        """Request a stop; needs no control. It latches until an operator in control resets it.

        A stop request is not an emergency stop.

        Raises:
            NoAnswerError: If no gateway answered: the robot may still move.
        """
        return await request_stop(self._session, self.site, self.name, self._session.own_name, reason)

    async def note(
        self, text: str, begin: datetime | None = None, end: datetime | None = None, *, author: str = ""
    ) -> Note:
        """Write a note on a time of this robot; every page shows it, and running recordings contain it.

        Args:
            text: 1 to 500 characters.
            begin: The moment, or the range's begin; by default now. Without a zone: local time.
            end: The range's end.
            author: An operator's name; empty: the certificate's, or this program's id.

        Raises:
            RefusedError: If the text or a time is not possible, or the site has no space for it.
            NoAnswerError: If the site's store does not answer: the note is not kept.
        """
        place = self.site, self.name
        return await write_note(self._session, place, text, begin=begin, end=end, author=author)

    async def withdraw_note(self, note: str, *, author: str = "") -> Note:
        """Withdraw a note of the same author by its id; the note stays in the record, marked as withdrawn.

        Raises:
            RefusedError: If there is no such note, or it has another author.
            NoAnswerError: If the site's store does not answer.
        """
        return await withdraw_note(self._session, (self.site, self.name), note, author=author)

    async def notes(self, since: datetime | None = None, until: datetime | None = None) -> list[Note]:
        """Return the notes on a part of this robot's time, the newest 10,000, in its order.

        Args:
            since, until: Limits of the part; a range that reaches into it counts.

        Raises:
            NoAnswerError: If the site's store does not answer.
        """
        return await read_notes(self._session, (self.site, self.name), since=since, until=until)

    async def forward(self, positions: Sequence[float]) -> Mapping[str, Matrix]:
        """Return the placement of every link and named frame: 4 x 4, to the base frame [m].

        Args:
            positions: [rad or m]

        Raises:
            RefusedError: If the positions do not fit the robot.
            NoAnswerError: If no kinematics service answers.
        """
        request = schema.ForwardRequest(joint_positions=numbers(positions))
        answer = await self._ask("kinematics/forward", request)
        assert isinstance(answer, schema.ForwardAnswer)
        placements = {each.name: _matrix(each.placement_to_base) for each in answer.links}
        return {**placements, "tool": _matrix(answer.tool_to_base)}

    async def inverse(
        self,
        pose: Iterable[Any],
        *,
        task: Literal["5d", "6d"] | None = None,
        near: Sequence[float] = (),
        all_solutions: bool = False,
    ) -> InverseResult:
        """Return joint positions that bring the tool to a pose. The robot does not move.

        Args:
            pose: 4 x 4, tool to base, by rows [m]: nested sequences, a NumPy array, or 16 numbers.
            task: "6d": position and orientation; "5d": position and the tool's axis. None: "5d" for a robot
                with fewer than six joints.
            near: Joint positions that the solution should be near to [rad or m]; empty: no preference.

        Raises:
            RefusedError: If the pose is invalid.
            NoAnswerError: If no kinematics service answers.
        """
        if task is None:
            task = "5d" if len((await self.description()).joints) < 6 else "6d"
        tasks = {"5d": schema.InverseRequest.POSITION_AND_AXIS_5D, "6d": schema.InverseRequest.POSE_6D}
        if task not in tasks:
            raise ValueError(f"task={task!r}: must be '5d' or '6d'")
        request = schema.InverseRequest(
            pose=_flat(pose), task=tasks[task], near=numbers(near), all_solutions=all_solutions
        )
        answer = await self._ask("kinematics/inverse", request)
        assert isinstance(answer, schema.InverseAnswer)
        return InverseResult(
            tuple(tuple(each.joint_positions) for each in answer.solutions),
            answer.residual_m,
            answer.residual_rad,
            answer.reason,
            answer.analytic,
        )

    async def check(
        self, program: str | Path, *, start: Sequence[float] = (), exact: bool = False
    ) -> CheckResult:
        """Check a teach program: limits, speeds, collisions. The robot does not move.

        Args:
            program: The program's text, or the path of its file.
            start: Joint positions at the start [rad or m]; empty: the robot's current ones.
            exact: Check meshes instead of their convex hulls: slow.

        Raises:
            RefusedError: If the check is not possible.
            NoAnswerError: If no kinematics service answers.
        """
        request = schema.CheckRequest(program=program_text(program), start=numbers(start), exact=exact)
        answer = await self._ask(f"kinematics/check/{self._session.own_name}", request)
        assert isinstance(answer, schema.CheckAnswer)
        violations = (
            Violation(
                line=each.line,
                time_s=each.time_s,
                until_s=each.until_s,
                kind=each.kind,
                pair=tuple(each.pair),
                distance_m=each.distance if each.HasField("distance") else None,
                refuses=each.refuses,
                text=each.text,
            )
            for each in answer.violations
        )
        return CheckResult(answer.ok, answer.duration_s, tuple(violations), tuple(answer.notes), answer.alone)

    def control(self, operator: str = "", *, take: str = "") -> AsyncArm:
        """Return the robot's arm, controlled while `async with robot.control("ops") as arm` runs.

        Args:
            operator: Name that the robot's users see; empty: the certificate's, or this process's id. With a
                certificate only its own name is allowed.
            take: Reason to take control from another operator, which the operator sees; empty: do not.
        """
        name = check_chunk(operator or self._session.own_name)
        return AsyncArm(self._session, self.site, self.name, name, si=self.si, take=take)

    # ------------------------------------------------------------------ units

    async def si(self, values: Sequence[float]) -> tuple[float, ...]:
        """Return positions in rad and m for positions in degrees, and mm of prismatic joints.

        Raises:
            MessageError: If their number is not the robot's number of joints.
            NoAnswerError: If the robot has no description.
        """
        names, values = await self._named(values)
        return tuple(
            radians(value) if self._types[name] == ROTARY else value / 1000.0
            for name, value in zip(names, values, strict=True)
        )

    async def degrees(self, positions: Sequence[float]) -> tuple[float, ...]:
        """Return positions in degrees, of prismatic joints in mm, for positions in rad and m.

        Raises:
            MessageError: If their number is not the robot's number of joints.
            NoAnswerError: If the robot has no description.
        """
        names, positions = await self._named(positions)
        return in_degrees(names, positions, self._types, robot=str(self))

    async def _named(self, values: Sequence[float]) -> tuple[tuple[str, ...], tuple[float, ...]]:
        if not self._types:
            await self.description()
        names, values = tuple(self._types), tuple(numbers(values))
        if len(values) != len(names):
            given = {"count": len(values), "joints": len(names), "names": ", ".join(names)}
            raise MessageError(codes.JOINT_COUNT(**given))
        return names, values

    def _key(self, name: str) -> str:
        return robot_key(self.site, self.name, name)

    def _subscribe(self, name: str, buffer: int, on_stale: OnStale) -> Subscription:
        topic(name)  # names what is wrong with it
        check_options(buffer, on_stale)
        return self._session.subscribe(self._key(name), newest=buffer)

    async def _ask(self, name: str, request: Message) -> Message:
        return await self._session.ask(self._key(name), request, timeout_s=_KINEMATICS_TIMEOUT_S)


async def first_of(stream: AsyncStream[Sample]) -> Sample | None:
    """Return the first sample of a stream that arrives within the time of a query; None: there is none."""
    try:
        async with asyncio.timeout(2.0):
            return await anext(stream)
    except (TimeoutError, StopAsyncIteration):
        return None


def events_of(session: Session, key_expr: str, *, history: bool) -> SampleReader[Event]:
    """Return the reader of the events of a key expression."""

    def convert(sample: RawSample, stale: bool, skipped: int) -> Iterator[Event]:
        message, key = sample.message(), sample.parsed
        events: Iterable[schema.Event] = (message,) if isinstance(message, schema.Event) else ()
        if isinstance(message, schema.EventList):
            events = message.events
        for event in events:
            with contextlib.suppress(MessageError):  # one invalid event hides no other one
                yield event_of(key.site, key.robot, event)

    subscription = session.subscribe(key_expr, newest=_EVENTS, history=history)
    return SampleReader(subscription, convert, limit_s=None, on_stale="raise")


def _flat(pose: Iterable[Any]) -> list[float]:
    values: list[Any] = []
    for row in pose:
        values.extend(row if isinstance(row, Iterable) else (row,))
    return numbers(values)


def _matrix(values: Sequence[float]) -> Matrix:
    return tuple(tuple(values[row : row + 4]) for row in range(0, 16, 4))
