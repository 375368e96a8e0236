"""The mesh for synchronous programs: the calls of the asynchronous classes, which wait.

A call has the parameters and the docstring of the asynchronous one: `_call` and `_stream` keep its type for
type checkers and editors. What returns another object of this module is written out.

All calls may be used from several threads; each stream and each arm from one thread at a time.
"""

import contextlib
import functools
import inspect
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Sequence
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, Self, TypeVar, get_args, get_origin

from robomesh.client.event_loop import EventLoopThread
from robomesh.client.mesh import AsyncMesh
from robomesh.client.recordings.descriptions import RecordingInfo
from robomesh.client.recordings.recording import AsyncRecording, RecordedSample
from robomesh.client.recordings.sources import DiskSource
from robomesh.client.robot.commands import Progress
from robomesh.client.robot.control import AsyncArm
from robomesh.client.robot.robot import AsyncRobot
from robomesh.client.robot.streams import AsyncStream, Stream
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.errors import ForkedError, SessionError

P = ParamSpec("P")
T = TypeVar("T")
Blocking = TypeVar("Blocking", bound=Callable[..., Any])

# A thread that waits shows this several times a second.
_ALIVE_S = 1.0


def _call(
    function: Callable[Concatenate[Any, P], Coroutine[Any, Any, T]],
) -> Callable[Concatenate[Any, P], T]:
    """Return the blocking form of an asynchronous method."""

    @_named_like(function)
    def call(self: Any, /, *arguments: P.args, **options: P.kwargs) -> T:
        result: T = self._run(function(self._own, *arguments, **options))
        return result

    return call


def _stream(
    function: Callable[Concatenate[Any, P], AsyncStream[T]],
) -> Callable[Concatenate[Any, P], Stream[T]]:
    """Return the blocking form of a method that returns a stream, which must begin on the event loop."""

    @_named_like(function)
    def begin(self: Any, /, *arguments: P.args, **options: P.kwargs) -> Stream[T]:
        loop: EventLoopThread = self._loop

        async def begun() -> AsyncStream[T]:
            stream = function(self._own, *arguments, **options)
            await stream.prepare()
            return stream

        return loop.run(begun()).blocking(loop)

    return begin


def _named_like(function: Callable[..., Any]) -> Callable[[Blocking], Blocking]:
    """Give a blocking form the name, the docstring and the signature of an asynchronous method."""
    signature = inspect.signature(function)
    if get_origin(signature.return_annotation) is AsyncStream:
        stream: Any = Stream
        signature = signature.replace(return_annotation=stream[get_args(signature.return_annotation)])

    def name(blocking: Blocking) -> Blocking:
        named: Any = functools.update_wrapper(blocking, function, assigned=("__name__", "__doc__"))
        named.__qualname__ = function.__qualname__.removeprefix("Async")
        named.__signature__ = signature
        return blocking

    return name


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
        self._loop, self._own = loop, arm
        self._waits_s = float("-inf")
        arm.progress = Progress(is_alive=lambda: time.monotonic() - self._waits_s < _ALIVE_S)

    def __enter__(self) -> Self:
        self._run(self._own.__aenter__())
        return self

    def __exit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        with contextlib.suppress(ForkedError):  # a forked process never had control
            self._run(self._own.leave(failed=error_type is not None))

    @property
    def operator(self) -> str:
        """Name that the robot's users see."""
        return self._own.operator

    home = _call(AsyncArm.home)
    move_joints = _call(AsyncArm.move_joints)
    move_joints_deg = _call(AsyncArm.move_joints_deg)
    move_joints_by = _call(AsyncArm.move_joints_by)
    move_joints_by_deg = _call(AsyncArm.move_joints_by_deg)
    run = _call(AsyncArm.run)
    resume = _call(AsyncArm.resume)
    jog = _call(AsyncArm.jog)
    wait = _call(AsyncArm.wait)
    hold = _call(AsyncArm.hold)
    speed = _call(AsyncArm.speed)
    trace = _call(AsyncArm.trace)
    reset = _call(AsyncArm.reset)
    recover = _call(AsyncArm.recover)
    stop = _call(AsyncArm.stop)
    renew = _call(AsyncArm.renew)

    def __repr__(self) -> str:
        return repr(self._own)

    def _run(self, coroutine: Coroutine[Any, Any, T]) -> T:
        stopped = self._own.stopped
        try:
            return self._loop.run(coroutine, waiting=self._show_alive)
        except KeyboardInterrupt as error:
            if (now := self._own.stopped) is not None and now is not stopped:
                latched = "; `arm.reset()` clears the stop" if now.id else ""
                error.add_note(f"{self._own}: {now.text}{latched}")
            raise

    def _show_alive(self) -> None:
        self._waits_s = time.monotonic()


class Robot:
    """A robot of the mesh. Positions are in rad, of prismatic joints in m.

    `next(robot.joints())` is the present joint state.

    Attributes:
        site, name: Its site and its name there.
    """

    def __init__(self, loop: EventLoopThread, robot: AsyncRobot) -> None:
        self._loop, self._run, self._own = loop, loop.run, robot
        self.site, self.name = robot.site, robot.name

    def __str__(self) -> str:
        return str(self._own)

    def __repr__(self) -> str:
        return repr(self._own)

    joints = _stream(AsyncRobot.joints)
    signals = _stream(AsyncRobot.signals)
    topic = _stream(AsyncRobot.topic)
    events = _stream(AsyncRobot.events)
    last = _call(AsyncRobot.last)
    description = _call(AsyncRobot.description)
    stop = _call(AsyncRobot.stop)
    note = _call(AsyncRobot.note)
    withdraw_note = _call(AsyncRobot.withdraw_note)
    notes = _call(AsyncRobot.notes)
    forward = _call(AsyncRobot.forward)
    inverse = _call(AsyncRobot.inverse)
    check = _call(AsyncRobot.check)
    si = _call(AsyncRobot.si)
    degrees = _call(AsyncRobot.degrees)

    def control(self, operator: str = "", *, take: str = "") -> Arm:
        """Return the robot's arm, controlled while `with robot.control("ops") as arm` runs.

        Args:
            operator: Name that the robot's users see; empty: the certificate's, or this process's id. With a
                certificate only its own name is allowed.
            take: Reason to take control from another operator, which the operator sees; empty: do not.
        """
        return Arm(self._loop, self._own.control(operator, take=take))


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
        self._own, self._run = recording, run
        self.info = recording.info

    def __repr__(self) -> str:
        return repr(self._own)

    @property
    def topic_names(self) -> tuple[str, ...]:
        """Names of the recorded topics; `info.topics` describes them."""
        return self._own.topic_names

    value_names = _call(AsyncRecording.value_names)
    joints = _call(AsyncRecording.joints)
    values = _call(AsyncRecording.values)
    events = _call(AsyncRecording.events)

    def messages(
        self, topic: str, *, start_s: float | None = None, end_s: float | None = None
    ) -> Iterator[RecordedSample]:
        """Yield the messages of a topic, in the order of their receive times."""
        pages = self._own.sample_pages(topic, start_s=start_s, end_s=end_s)
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
        self._own = AsyncMesh(router, keys=keys, timeout_s=timeout_s)
        self._loop = EventLoopThread()
        self._run = self._loop.run
        try:
            self._run(self._own.open())
        except BaseException:
            self._loop.close()
            raise
        self._loop.at_end(self._own.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return repr(self._own)

    def close(self) -> None:
        """Disconnect; all streams end."""
        self._loop.close()

    def robot(self, name: str) -> Robot:
        """Return the robot that "robot" or "site/robot" names.

        Raises:
            RobotNotFoundError: If there is none, or several sites have a robot of that name.
        """
        return Robot(self._loop, self._run(self._own.robot(name)))

    def robots(self) -> list[Robot]:
        """Return the robots of all sites that have a running service, by name."""
        return [Robot(self._loop, each) for each in self._run(self._own.robots())]

    services = _call(AsyncMesh.services)
    events = _stream(AsyncMesh.events)
    alarms = _call(AsyncMesh.alarms)
    recordings = _call(AsyncMesh.recordings)
    fetch_recording = _call(AsyncMesh.fetch_recording)
    change_recording = _call(AsyncMesh.change_recording)
    delete_recording = _call(AsyncMesh.delete_recording)

    def open_recording(self, recording: str | RecordingInfo) -> Recording:
        """Return a recording of a site, which is read through the mesh as it is needed.

        Args:
            recording: "name", "site/name" or "site/file", the newest of that name; or one of `recordings`.

        Raises:
            RecordingError: If no recording has the name; the text lists the newest ones.
        """
        return Recording(self._run(self._own.open_recording(recording)), self._run)


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
