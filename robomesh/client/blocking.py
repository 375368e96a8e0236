"""The mesh for synchronous programs: the same calls as of the asynchronous classes, which wait.

All calls may be used from several threads; each stream and each arm from one thread at a time.
"""

import contextlib
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

from robomesh.client.event_loop import EventLoopThread
from robomesh.client.mesh import AsyncMesh, Service
from robomesh.client.recordings.arrays import RecordedJoints, RecordedValues
from robomesh.client.recordings.descriptions import RecordingInfo
from robomesh.client.recordings.recording import AsyncRecording, RecordedSample
from robomesh.client.recordings.sources import DiskSource
from robomesh.client.robot.commands import CommandResult, JogResult, Progress, StopResult
from robomesh.client.robot.control import AsyncArm
from robomesh.client.robot.notes import Note
from robomesh.client.robot.robot import AsyncRobot, CheckResult, InverseResult, Matrix
from robomesh.client.robot.samples import Alarm, Event, JointState, Sample, SignalState
from robomesh.client.robot.streams import AsyncStream, OnStale, Stream
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.errors import ForkedError, SessionError
from robomesh.schemas import robomesh_pb2 as schema

T = TypeVar("T")

# A thread that waits shows this several times a second.
_ALIVE_S = 1.0


class Arm:
    """A controlled arm; a context manager.

    Every motion call waits for the end of the motion, unless `wait=False`. If it is interrupted (Ctrl-C), or
    the block ends with an error while a motion runs, the robot is stopped. Control lasts while calls wait,
    and 5 s after the last one.

    Raises:
        RefusedError: Of every call: the gateway refused it, with the reason's code.
        MotionError: Of a motion call: the motion ended before its target, with the reason's code.
        NoAnswerError: The gateway did not answer, or fell silent.
    """

    def __init__(self, loop: EventLoopThread, arm: AsyncArm) -> None:
        self._loop, self._arm = loop, arm
        self._waits_s = float("-inf")
        arm.progress = Progress(is_alive=lambda: time.monotonic() - self._waits_s < _ALIVE_S)

    def __enter__(self) -> Self:
        self._run(self._arm.__aenter__())
        return self

    def __exit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        with contextlib.suppress(ForkedError):  # a forked process never had control
            self._run(self._arm.leave(failed=error_type is not None))

    @property
    def operator(self) -> str:
        """Name that the robot's users see."""
        return self._arm.operator

    def home(self, *, wait: bool = True) -> CommandResult:
        """Home the robot."""
        return self._run(self._arm.home(wait=wait))

    def move_joints(self, positions: Sequence[float], *, wait: bool = True) -> CommandResult:
        """Move to joint positions [rad], of prismatic joints [m]."""
        return self._run(self._arm.move_joints(positions, wait=wait))

    def move_joints_deg(self, positions: Sequence[float], *, wait: bool = True) -> CommandResult:
        """Move to joint positions in degrees, of prismatic joints in mm."""
        return self._run(self._arm.move_joints_deg(positions, wait=wait))

    def move_joints_by(self, distances: Sequence[float], *, wait: bool = True) -> CommandResult:
        """Move every joint by a distance [rad], prismatic joints [m]."""
        return self._run(self._arm.move_joints_by(distances, wait=wait))

    def move_joints_by_deg(self, distances: Sequence[float], *, wait: bool = True) -> CommandResult:
        """Move every joint by a distance in degrees, prismatic joints in mm."""
        return self._run(self._arm.move_joints_by_deg(distances, wait=wait))

    def run(self, program: str | Path, *, name: str = "", wait: bool = True) -> CommandResult:
        """Run a teach program: its text, or the path of its file."""
        return self._run(self._arm.run(program, name=name, wait=wait))

    def resume(self, *, wait: bool = True) -> CommandResult:
        """Resume the motion that `hold` paused."""
        return self._run(self._arm.resume(wait=wait))

    def jog(
        self, axis: str | int, speed: float, *, held: Callable[[], bool], frame: str = "base"
    ) -> JogResult:
        """Jog while `held` returns true, called 25 times a second on another thread; see `AsyncArm.jog`.

        Args:
            axis: "x", "y", "z", "roll", "pitch" or "yaw" (about x, y, z); or a joint's number, from 1.
            speed: The greatest speed [m/s] or [rad/s]; negative: in the other direction.
            held: Returns quickly whether the operator still holds the button down.
            frame: "tool", "base" or "site"; not used for a joint.
        """
        return self._run(self._arm.jog(axis, speed, held=held, frame=frame))

    def wait(self) -> None:
        """Wait for the end of the motion or program that a call with `wait=False` started."""
        self._run(self._arm.wait())

    def hold(self) -> CommandResult:
        """Pause the motion."""
        return self._run(self._arm.hold())

    def speed(self, percent: float) -> CommandResult:
        """Set the speed of motions, 1 to 100 %."""
        return self._run(self._arm.speed(percent))

    def trace(self, on: bool) -> CommandResult:
        """Start or end the controller's trace, which the recorder records."""
        return self._run(self._arm.trace(on))

    def reset(self, stop_id: int | None = None) -> CommandResult:
        """Clear a latched stop, after its cause was removed; by default the one that is latched now."""
        return self._run(self._arm.reset(stop_id))

    def recover(self, recovery: str, *, reason: str, looked: bool) -> CommandResult:
        """Bring the controller back after its own stop or fault; see `AsyncArm.recover`.

        Args:
            recovery: "unlock_protective_stop", "power_on", "brake_release", ...
            reason: Reason for the audit log and the event.
            looked: A person at the robot has looked, and found the cause.
        """
        return self._run(self._arm.recover(recovery, reason=reason, looked=looked))

    def stop(self, reason: str = "") -> StopResult:
        """Request a stop, which latches. A stop request is not an emergency stop."""
        return self._run(self._arm.stop(reason))

    def renew(self) -> None:
        """Keep control for another 5 s."""
        self._run(self._arm.renew())

    def __repr__(self) -> str:
        return repr(self._arm)

    def _run(self, coroutine: Coroutine[Any, Any, T]) -> T:
        stopped = self._arm.stopped
        try:
            return self._loop.run(coroutine, waiting=self._show_alive)
        except KeyboardInterrupt as error:
            if (now := self._arm.stopped) is not None and now is not stopped:
                latched = "; `arm.reset()` clears the stop" if now.id else ""
                error.add_note(f"{self._arm}: {now.text}{latched}")
            raise

    def _show_alive(self) -> None:
        self._waits_s = time.monotonic()


class Robot:
    """A robot of the mesh. Positions are in rad, of prismatic joints in m.

    Attributes:
        site, name: Its site and its name there.
    """

    def __init__(self, loop: EventLoopThread, robot: AsyncRobot) -> None:
        self._loop, self._robot = loop, robot
        self.site, self.name = robot.site, robot.name

    def __str__(self) -> str:
        return str(self._robot)

    def __repr__(self) -> str:
        return repr(self._robot)

    def joints(
        self, *, slow: bool = False, buffer: int = 1, on_stale: OnStale = "raise"
    ) -> Stream[JointState]:
        """Return the joint states, the newest first; `next(robot.joints())` is the present one.

        Args:
            slow: The 10 Hz states for slow lines.
            buffer: Number of states kept for a slow program; older ones are skipped, and counted.
            on_stale: "raise": raise StaleError when no current state arrives in time. "yield": return the
                last state again, once, with `stale` true.
        """
        return self._stream(self._robot.joints, slow=slow, buffer=buffer, on_stale=on_stale)

    def signals(self, *, buffer: int = 1, on_stale: OnStale = "raise") -> Stream[SignalState]:
        """Return what the controller reports in addition to joints; `next(robot.signals())` is present.

        Args:
            buffer, on_stale: As for `joints`.
        """
        return self._stream(self._robot.signals, buffer=buffer, on_stale=on_stale)

    def topic(self, name: str, *, buffer: int = 1, on_stale: OnStale = "raise") -> Stream[Sample]:
        """Return the messages of a topic, the newest first: "controller", "kinematics", "lease", ...

        Args:
            buffer, on_stale: As for `joints`.

        Raises:
            UnknownTopicError: If there is no such topic.
        """
        return self._stream(self._robot.topic, name, buffer=buffer, on_stale=on_stale)

    def events(self, *, history: bool = True) -> Stream[Event]:
        """Return the events of the robot, by default beginning with the last 100 of each service."""
        return self._stream(self._robot.events, history=history)

    def last(self, name: str) -> Sample | None:
        """Return the last message of a topic, of unknown age; None: no service has one."""
        return self._loop.run(self._robot.last(name))

    def description(self) -> schema.Description:
        """Return the robot's description: joints with limits, links, frames, URDF."""
        return self._loop.run(self._robot.description())

    def stop(self, reason: str = "") -> StopResult:
        """Request a stop; needs no control. It latches until an operator in control resets it.

        A stop request is not an emergency stop.

        Raises:
            NoAnswerError: If no gateway answered: the robot may still move.
        """
        return self._loop.run(self._robot.stop(reason))

    def note(
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
        return self._loop.run(self._robot.note(text, begin, end, author=author))

    def withdraw_note(self, note: str, *, author: str = "") -> Note:
        """Withdraw a note of the same author by its id; the note stays in the record, marked as withdrawn."""
        return self._loop.run(self._robot.withdraw_note(note, author=author))

    def notes(self, since: datetime | None = None, until: datetime | None = None) -> list[Note]:
        """Return the notes on a part of this robot's time, the newest 10,000, in its order."""
        return self._loop.run(self._robot.notes(since, until))

    def forward(self, positions: Sequence[float]) -> Mapping[str, Matrix]:
        """Return the placement of every link and named frame: 4 x 4, to the base frame [m].

        Args:
            positions: [rad], of prismatic joints [m]; `si` converts degrees.
        """
        return self._loop.run(self._robot.forward(positions))

    def inverse(
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
        """
        return self._loop.run(self._robot.inverse(pose, task=task, near=near, all_solutions=all_solutions))

    def check(self, program: str | Path, *, start: Sequence[float] = (), exact: bool = False) -> CheckResult:
        """Check a teach program: limits, speeds, collisions. The robot does not move.

        Args:
            program: The program's text, or the `Path` of its file.
            start: Joint positions at the start [rad or m]; empty: the robot's current ones.
            exact: Check meshes instead of their convex hulls: slow.
        """
        return self._loop.run(self._robot.check(program, start=start, exact=exact))

    def control(self, operator: str = "", *, take: str = "") -> Arm:
        """Return the robot's arm, controlled while `with robot.control("ops") as arm` runs.

        Args:
            operator: Name that the robot's users see; empty: the certificate's, or this process's id. With a
                certificate only its own name is allowed.
            take: Reason to take control from another operator, which the operator sees; empty: do not.
        """
        return Arm(self._loop, self._robot.control(operator, take=take))

    def si(self, values: Sequence[float]) -> tuple[float, ...]:
        """Return positions in rad and m for positions in degrees, and mm of prismatic joints."""
        return self._loop.run(self._robot.si(values))

    def degrees(self, positions: Sequence[float]) -> tuple[float, ...]:
        """Return positions in degrees, of prismatic joints in mm, for positions in rad and m."""
        return self._loop.run(self._robot.degrees(positions))

    def _stream(self, begin: Any, *arguments: Any, **options: Any) -> Stream[Any]:
        return blocking_stream(self._loop, lambda: begin(*arguments, **options))


class Recording:
    """A recording.

    `start_s` and `end_s` of its functions limit the time since the recording's start, on the recorder's
    clock [s], both included; None: its start or end. Messages that cannot be decoded are left out, with a
    warning in the log.

    Raises:
        RecordingError: Of every function: the file is damaged, changed, or lacks what was requested.
        RobomeshError: Of every function, over the mesh: the recorder refuses or does not answer.

    Attributes:
        info: Description of the recording.
    """

    def __init__(self, recording: AsyncRecording, run: Callable[[Coroutine[Any, Any, Any]], Any]) -> None:
        self._recording, self._run = recording, run
        self.info = recording.info

    def __repr__(self) -> str:
        return repr(self._recording)

    @property
    def topic_names(self) -> tuple[str, ...]:
        """Names of the recorded topics; `info.topics` describes them."""
        return self._recording.topic_names

    def value_names(self) -> list[str]:
        """Return the names of the recorded values, as `values` takes them: "kinematics/tool/x"."""
        names: list[str] = self._run(self._recording.value_names())
        return names

    def joints(
        self, topic: str = "joints", *, start_s: float | None = None, end_s: float | None = None
    ) -> RecordedJoints:
        """Return the joint states of a topic, with the schema foxglove.JointStates."""
        joints: RecordedJoints = self._run(self._recording.joints(topic, start_s=start_s, end_s=end_s))
        return joints

    def values(
        self, *names: str, start_s: float | None = None, end_s: float | None = None
    ) -> dict[str, RecordedValues]:
        """Return values over time, at the full rate of their topics, by name."""
        values: dict[str, RecordedValues]
        values = self._run(self._recording.values(*names, start_s=start_s, end_s=end_s))
        return values

    def events(self, *, start_s: float | None = None, end_s: float | None = None) -> list[Event]:
        """Return the events of all services, in the order of their times."""
        events: list[Event] = self._run(self._recording.events(start_s=start_s, end_s=end_s))
        return events

    def messages(
        self, topic: str, *, start_s: float | None = None, end_s: float | None = None
    ) -> Iterator[RecordedSample]:
        """Yield the messages of a topic, in the order of their receive times."""
        pages = self._recording.sample_pages(topic, start_s=start_s, end_s=end_s)
        try:
            while (samples := self._run(_next_of(pages))) is not None:
                yield from samples
        finally:
            with contextlib.suppress(SessionError):  # a closed connection has ended them
                self._run(pages.aclose())


def open_recording(path: str | Path) -> Recording:
    """Return the recording in a file of this machine; also of one that is still being written.

    Raises:
        RecordingError: If no part of it can be read.
    """
    return Recording(AsyncRecording(DiskSource(Path(path))), _run_now)


class Mesh:
    """A connection to the mesh; a context manager. It is closed at the latest when the program ends.

    Args:
        router: Address of a router, or of several to try in order: "tcp/HOST:PORT", "tls/HOST:PORT".
        keys: Bundle from `robomesh keys`, for a mesh with certificates.
        timeout_s: How long to wait for a router [s]; None: forever.

    Raises:
        SessionError: If no router answers, or it does not accept the certificate.
    """

    def __init__(
        self,
        router: str | Sequence[str] = DEFAULT_ROUTER,
        *,
        keys: str | Path | None = None,
        timeout_s: float | None = 2.0,
    ) -> None:
        self._mesh = AsyncMesh(router, keys=keys, timeout_s=timeout_s)
        self._loop = EventLoopThread()
        try:
            self._loop.run(self._mesh.open())
        except BaseException:
            self._loop.close()
            raise
        self._loop.at_end(self._mesh.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return repr(self._mesh)

    def close(self) -> None:
        """Disconnect; all streams end."""
        self._loop.close()

    def robot(self, name: str) -> Robot:
        """Return the robot that "robot" or "site/robot" names.

        Raises:
            RobotNotFoundError: If there is none, or several sites have a robot of that name.
        """
        return Robot(self._loop, self._loop.run(self._mesh.robot(name)))

    def robots(self) -> list[Robot]:
        """Return the robots of all sites that have a running service, by name."""
        return [Robot(self._loop, each) for each in self._loop.run(self._mesh.robots())]

    def services(self) -> list[Service]:
        """Return the running services of all sites, by name."""
        return self._loop.run(self._mesh.services())

    def events(self, *, history: bool = True) -> Stream[Event]:
        """Return the events of all robots, by default beginning with the last 100 of each service."""
        return blocking_stream(self._loop, lambda: self._mesh.events(history=history))

    def alarms(self) -> list[Alarm]:
        """Return the alarms of all sites: all except ended and acknowledged ones, most urgent first."""
        return self._loop.run(self._mesh.alarms())

    def recordings(self) -> list[RecordingInfo]:
        """Return the recordings of all sites, newest first, without those of recorders that do not answer."""
        return self._loop.run(self._mesh.recordings())

    def open_recording(self, recording: str | RecordingInfo) -> Recording:
        """Return a recording of a site, which is read through the mesh as it is needed.

        Args:
            recording: "name", "site/name" or "site/file", the newest of that name; or one of `recordings`.

        Raises:
            RecordingError: If no recording has the name; the text lists the newest ones.
        """
        return Recording(self._loop.run(self._mesh.open_recording(recording)), self._loop.run)

    def fetch_recording(self, recording: str | RecordingInfo, out: str | Path = ".") -> Path:
        """Copy a recording's file to this machine, and return its path; an interrupted copy is resumed.

        Args:
            recording: As for `open_recording`.
            out: Path of the copy, or a folder.
        """
        return self._loop.run(self._mesh.fetch_recording(recording, out))

    def change_recording(
        self,
        recording: str | RecordingInfo,
        *,
        name: str | None = None,
        note: str | None = None,
        tags: Sequence[str] | None = None,
    ) -> RecordingInfo:
        """Set a recording's name, note or tags, and return its description; its file stays as recorded.

        Args:
            recording: As for `open_recording`; a name must be that of one recording only.
            name: At most 60 characters, which a file's name may have.
            note: At most 2000 characters; empty: none.
            tags: All tags from then on, at most 20.
        """
        return self._loop.run(self._mesh.change_recording(recording, name=name, note=note, tags=tags))

    def delete_recording(self, recording: str | RecordingInfo, *, reason: str) -> RecordingInfo:
        """Delete a recording's file for good, and return its last description.

        Args:
            recording: As for `change_recording`.
            reason: Every operator sees it.
        """
        return self._loop.run(self._mesh.delete_recording(recording, reason=reason))


async def _next_of(pages: AsyncIterator[T]) -> T | None:
    return await anext(pages, None)


def _run_now(coroutine: Coroutine[Any, Any, T]) -> T:
    """Return the result of a coroutine that never waits."""
    try:
        coroutine.send(None)
    except StopIteration as end:
        result: T = end.value
        return result
    raise RuntimeError("a coroutine that reads a file waited")


def blocking_stream(loop: EventLoopThread, begin: Any) -> Stream[Any]:
    """Return the blocking form of a stream that must begin on the event loop."""

    async def begun() -> AsyncStream[Any]:
        stream: AsyncStream[Any] = begin()
        await stream.prepare()
        return stream

    return loop.run(begun()).blocking(loop)
