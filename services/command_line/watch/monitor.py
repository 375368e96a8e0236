"""`robomesh monitor`: a live table of a robot with bars, or a line of JSON for each state."""

import asyncio
import contextlib
import math
import sys
import time
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.contract.activity import activity_words
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.enum_names import enum_word
from robomesh.contract.keys import WHOLE_SITE, is_replay, robot_key
from robomesh.contract.topics import stale_after_s
from robomesh.publications.subscription import Sample, Subscription
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.presence import MONITOR
from robomesh.wire.session import Session
from services.command_line.terminal import discovery
from services.command_line.terminal.local_time import local_time
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import console, print_json, styled_line
from services.command_line.watch.monitor_text import (
    OLD,
    Words,
    alarm_words,
    check_words,
    clearance_record,
    near_words,
    program_record,
    program_words,
    replay_record,
    replay_words,
)

if TYPE_CHECKING:
    from rich.console import Group

app = command_group()

_State = schema.ControllerState
# Factor and unit of a joint's position.
_UNITS = {
    schema.Description.Joint.ROTARY: (180 / math.pi, "°"),
    schema.Description.Joint.PRISMATIC: (1000.0, " mm"),
}
_REDRAW_HZ = 10
_BAR_CELLS, _LEAST_BAR_CELLS, _OTHER_CELLS = 40, 5, 42
# Topics that a line of JSON adds to the joints.
_TOPICS = ("controller", "lease", "kinematics", "program")
# A replay's recorded controller and holder are not current.
_TOPICS_OF_REPLAY = ("replay", "kinematics", "program")
_FIRST_S = 1.0


@app.command()
def monitor(
    robot: Robot,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
    count: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="End after N live states. Without it, the first line may be the last value from before.",
        ),
    ] = None,
) -> None:
    """Watch a robot in the terminal."""
    with contextlib.suppress(KeyboardInterrupt):
        # The table needs a terminal.
        lines = as_json or not sys.stdout.isatty()
        discovery.run(_json(robot, connect, count) if lines else _live(robot, connect, count))


async def _json(name: str, router: str, count: int | None) -> None:
    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        session.declare_presence(robot.site, WHOLE_SITE, MONITOR)
        states = session.subscribe(robot_key(*robot, "joints"), newest=1000)
        newest = _Newest(session, robot, _TOPICS_OF_REPLAY if is_replay(robot.name) else _TOPICS)
        async with newest.following():
            await newest.wait_for_values()
            printed = 0
            async for sample in states:
                if count is not None and not sample.live:
                    continue
                print_json(_record(sample, states) | newest.record())
                printed += 1
                if printed == count:
                    return


def _record(sample: Sample, states: Subscription) -> dict[str, Any]:
    message = sample.message()
    assert isinstance(message, JointStates)
    return {
        "key": sample.key,
        "sequence": sample.header.sequence,
        "time": local_time(sample.header.source_time_ns * 1e-9).isoformat(),
        "live": sample.live and not is_replay(sample.parsed.robot),
        "lost": states.lost(sample.key),
        "joints": {joint.name: joint.position for joint in message.joints},
    }


async def _live(name: str, router: str, count: int | None) -> None:
    from rich.live import Live

    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        # Other clients list this monitor.
        session.declare_presence(robot.site, WHOLE_SITE, MONITOR)
        topics = _TOPICS_OF_REPLAY if is_replay(robot.name) else _TOPICS
        newest = _Newest(session, robot, {"joints", "description", "controller", *topics})
        # On the alternate screen, redrawn whole, so that a resized window keeps no old text.
        live = Live(console=console(), screen=True, auto_refresh=False)
        width = live.console.width
        try:
            with live:
                async with newest.following():
                    while count is None or newest.states < count:
                        width = live.console.width
                        live.update(newest.rendered(width), refresh=True)
                        await asyncio.sleep(1 / _REDRAW_HZ)
        finally:
            live.console.print(newest.rendered(width))


class _Newest:
    """The newest value of each displayed topic."""

    def __init__(self, session: Session, robot: discovery.RobotAddress, names: Iterable[str]) -> None:
        self.robot = robot
        self.replayed = is_replay(robot.name)
        self.states = 0
        self.subscriptions = {name: session.subscribe(robot_key(*robot, name)) for name in names}
        self._alarms = session.subscribe(robot_key(robot.site, WHOLE_SITE, "alarms"))
        self._values: dict[str, Any] = {}

    @asynccontextmanager
    async def following(self) -> AsyncIterator[None]:
        """Receive values while the block runs."""
        subscriptions = (*self.subscriptions.values(), self._alarms)
        followers = [asyncio.create_task(self._follow(each)) for each in subscriptions]
        try:
            yield
        finally:
            for follower in followers:
                follower.cancel()

    async def wait_for_values(self) -> None:
        """Wait for a value of each topic, up to a limit, because a service may be missing."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_FIRST_S):
                while len(self._values) < len(self.subscriptions):
                    await asyncio.sleep(0.02)

    def record(self) -> dict[str, Any]:
        """Return the values besides the joints; null: unknown or stale."""
        lease, kinematics, program = (
            None if name not in self.subscriptions or self._stale(name) else self._values.get(name)
            for name in ("lease", "kinematics", "program")
        )
        return {
            "replay": replay_record(self._values.get("replay")) if self.replayed else None,
            "control": None if lease is None else lease.holder,
            "clearance": clearance_record(kinematics, str(self.robot)),
            "program": program_record(program),
        }

    async def _follow(self, subscription: Subscription) -> None:
        async for sample in subscription:
            self._values[subscription.topic.name] = sample.message()
            self.states += sample.live and subscription.topic.name == "joints"

    def age_s(self, name: str) -> float | None:
        """Return a topic's age [s]; of joints at least the age reported by a gateway whose link is down."""
        own = self.subscriptions[name].age_s(robot_key(*self.robot, name))
        if own is None or name != "joints":
            return own
        state = self._values.get("controller")
        reported = state.last_unit_age_s if state is not None and state.link != _State.UP else 0.0
        return max(own, reported)

    def rendered(self, width: int) -> "Group":
        """Return the current display.

        Args:
            width: Width of the terminal, in characters.
        """
        from rich.console import Group

        age, stale = self.age_s("joints"), self._stale("joints")
        head: list[Words] = [(str(self.robot), "bold")]
        if stale:
            words = "no live data yet" if age is None else f"STALE {age:.0f} s"
            head.append((f" {words} ", "black on yellow"))
        elif not self.replayed:
            head.append(("live", "green"))
        if self.replayed:
            head.append((replay_words(self._values.get("replay")), "magenta"))
        else:
            head += self._of_gateway()
        lines = [head, *self._surroundings(), *self._alarm_lines(), *self._foot()]
        first, *rest = (styled_line(line) for line in lines if line)
        return Group(first, self._table(stale, width), *rest)

    def _of_gateway(self) -> Iterator[Words]:
        """Yield the state of the controller, and who is in control."""
        state, lease = self._values.get("controller"), self._values.get("lease")
        if state is not None:
            yield f"link {enum_word(_State.Link, state.link)}", ""
            if state.capabilities.HasField("slow_hz"):
                yield f"slow, joints at {state.capabilities.slow_hz:g} Hz", "yellow"
            mode, homed = enum_word(_State.Mode, state.mode), enum_word(_State.Known, state.homed)
            old = "" if state.link == _State.UP else OLD
            yield f"{activity_words(state)}   mode {mode}   homed {homed}", old
            if state.HasField("stop"):
                yield f"STOP REQUESTED by {state.stop.by}", "bold red"
        if lease is not None:
            yield f"control: {lease.holder or 'nobody'}", ""

    def _table(self, stale: bool, width: int) -> Any:
        from rich import box
        from rich.table import Table

        # The bar gets the width that name, position and limits leave.
        cells = min(max(width - _OTHER_CELLS, 0), _BAR_CELLS)
        table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for column, justify in (("joint", "left"), ("position", "right"), ("", "left"), ("limits", "left")):
            table.add_column(column, justify=justify, no_wrap=True)  # type: ignore[arg-type]
        description, states = self._values.get("description"), self._values.get("joints")
        limits = {joint.name: joint for joint in description.joints} if description is not None else {}
        for joint in states.joints if states is not None else ():
            row = limits.get(joint.name)
            if row is None or row.type not in _UNITS:
                table.add_row(joint.name, f"{joint.position:.4f}", "", "", style=OLD if stale else None)
                continue
            factor, unit = _UNITS[row.type]
            table.add_row(
                joint.name,
                f"{joint.position * factor:.2f}{unit}",
                _bar(joint.position, row.lower, row.upper, cells),
                f"{row.lower * factor:.0f} .. {row.upper * factor:.0f}{unit}",
                style=OLD if stale else None,
            )
        return table

    def _surroundings(self) -> list[list[Words]]:
        """Return a line with clearances, and one with the check mode and the program."""
        state, kinematics, program = (
            self._values.get(name) for name in ("controller", "kinematics", "program")
        )
        near = (
            []
            if kinematics is None
            else near_words(kinematics, self._values.get("description"), str(self.robot))
        )
        if self._stale("kinematics"):
            near = [(words, OLD) for words, _ in near]
        runs: list[Words | None] = []
        if state is not None and not self.replayed:
            runs.append(check_words(state))
        ran = None if program is None else program_words(program, stale=self._stale("program"))
        # The program ran when this was recorded.
        runs.append((f"then: {ran[0]}", OLD) if ran is not None and self.replayed else ran)
        return [near, [words for words in runs if words is not None]]

    def _alarm_lines(self) -> list[list[Words]]:
        """Return a line for each of the first alarms of the robot and its site that are not shelved."""
        listed = self._values.get("alarms")
        return [[each] for each in alarm_words(listed.alarms if listed is not None else (), self.robot.name)]

    def _stale(self, name: str) -> bool:
        age = self.age_s(name)
        limit_s = stale_after_s(name, self._values.get("description"))
        return age is None or (limit_s is not None and age > limit_s)

    def _foot(self) -> list[list[Words]]:
        kinematics, state = self._values.get("kinematics"), self._values.get("controller")
        joints = self.subscriptions["joints"]
        key = robot_key(*self.robot, "joints")
        values: list[Words] = []
        if kinematics is not None and len(kinematics.tool_to_base) == 16:
            x, y, z = (kinematics.tool_to_base[index] * 1000 for index in (3, 7, 11))
            values.append((f"tool {x:.1f} {y:.1f} {z:.1f} mm", "dim"))
        if state is not None and not self.replayed:
            values.append((f"controller: {link_words(state)}", "dim"))
        own = f"missed here: {joints.lost(key)}   {time.strftime('%H:%M:%S')}   Ctrl-C ends"
        return [values, [(own, "dim")]]


def link_words(state: schema.ControllerState) -> str:
    """Return the health of the controller's link: known values, and counters that are not 0."""
    health, counters = state.health, state.counters
    words = [f"{state.rate_hz:.0f} units/s"] if state.HasField("rate_hz") else []
    for name in ("jitter", "network_round_trip", "answer", "stamp_uncertainty"):
        if health.HasField(f"{name}_s"):
            seconds: float = getattr(health, f"{name}_s")
            words.append(f"{name.replace('_', ' ')} {1000 * seconds:.1f} ms")
    if state.HasField("last_unit_age_s") and state.link != _State.UP:
        words.append(f"{state.last_unit_age_s:.1f} s old")
    for count, what in (
        (counters.units_lost, "lost"),
        (counters.units_malformed, "malformed"),
        (counters.units_skipped, "skipped"),
    ):
        if count:
            words.append(f"{count} {what}")
    return ", ".join([*words, *(["FLOODING"] if health.flooding else [])])


def _bar(position: float, lower: float, upper: float, cells: int) -> str:
    """Draw a position within its limits; empty if the terminal is too narrow, or a number is not finite."""
    if cells < _LEAST_BAR_CELLS or not all(map(math.isfinite, (position, lower, upper))):
        return ""
    span = upper - lower
    share = min(max((position - lower) / span, 0.0), 1.0) if span > 0 else 0.5
    cell = round(share * (cells - 1))
    return "─" * cell + "●" + "─" * (cells - 1 - cell)
