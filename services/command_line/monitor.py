"""`robomesh monitor`: a robot in the terminal, live: a table with bars, or a line of JSON a state."""

import asyncio
import contextlib
import math
import sys
import time
from datetime import datetime
from typing import TYPE_CHECKING, Any

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from bus.keys import robot_key
from bus.schemas import robomesh_pb2 as schema
from bus.session import Session
from bus.subscription import Sample, Subscription
from bus.topics import topic
from services.command_line import find

if TYPE_CHECKING:
    from rich.console import Group

_State = schema.ControllerState
_ROTARY = schema.Description.Joint.ROTARY
_REDRAW_HZ = 10
_BAR_CELLS = 40


def run(robot: str, router: str, as_json: bool, count: int | None) -> None:
    """Watch until Ctrl-C, or for `count` states."""
    with contextlib.suppress(KeyboardInterrupt):
        # A pipe has no screen to draw on.
        lines = as_json or not sys.stdout.isatty()
        find.run(_json(robot, router, count) if lines else _live(robot, router, count))


async def _json(name: str, router: str, count: int | None) -> None:
    async with find.attached(router) as session:
        robot = await find.find(session, name)
        states = session.subscribe(robot_key(*robot, "joints"), newest=1000)
        printed = 0
        async for sample in states:
            find.print_json(_record(sample, states))
            printed += 1
            if printed == count:
                return


def _record(sample: Sample, states: Subscription) -> dict[str, Any]:
    message = sample.message()
    assert isinstance(message, JointStates)
    return {
        "key": sample.key,
        "sequence": sample.header.sequence,
        "time": datetime.fromtimestamp(sample.header.source_time_ns * 1e-9).astimezone().isoformat(),
        "live": sample.live,
        "lost": states.lost(sample.key),
        "joints": {joint.name: joint.position for joint in message.joints},
    }


async def _live(name: str, router: str, count: int | None) -> None:
    from rich.live import Live

    async with find.attached(router) as session:
        robot = await find.find(session, name)
        newest = _Newest(session, robot)
        with Live(newest.picture(), refresh_per_second=_REDRAW_HZ, screen=False) as live:
            followers = [asyncio.create_task(newest.follow(each)) for each in newest.subscriptions.values()]
            try:
                while count is None or newest.states < count:
                    await asyncio.sleep(1 / _REDRAW_HZ)
                    live.update(newest.picture())
            finally:
                for follower in followers:
                    follower.cancel()


class _Newest:
    """The newest value of each topic that is shown."""

    def __init__(self, session: Session, robot: find.Robot) -> None:
        self.robot = robot
        self.states = 0
        self.subscriptions = {
            name: session.subscribe(robot_key(*robot, name))
            for name in ("joints", "controller", "lease", "description", "kinematics")
        }
        self._values: dict[str, Any] = {}

    async def follow(self, subscription: Subscription) -> None:
        async for sample in subscription:
            self._values[subscription.topic.name] = sample.message()
            self.states += subscription.topic.name == "joints"

    def age_s(self, name: str) -> float | None:
        """Age of a topic [s]: since its last number, plus what the gateway says of the controller."""
        own = self.subscriptions[name].age_s(robot_key(*self.robot, name))
        if own is None or name != "joints":
            return own
        state = self._values.get("controller")
        told = state.last_unit_age_s if state is not None and state.link != _State.UP else 0.0
        return max(own, told)

    def picture(self) -> "Group":
        from rich.console import Group
        from rich.text import Text

        age = self.age_s("joints")
        limit = topic("joints").stale_after_s or math.inf
        stale = age is None or age > limit
        head = Text(str(self.robot), style="bold")
        head.append("   ")
        if stale:
            words = "no live data yet" if age is None else f"STALE {age:.0f} s"
            head.append(f" {words} ", style="black on yellow")
        else:
            head.append("live", style="green")
        state, lease = self._values.get("controller"), self._values.get("lease")
        if state is not None:
            head.append(f"   link {_word(_State.Link, state.link)}")
            head.append(
                f"   {_word(_State.Activity, state.activity)}   mode {_word(_State.Mode, state.mode)}"
                f"   homed {_word(_State.Known, state.homed)}",
                style="" if state.link == _State.UP else "dim strike",
            )
            if state.HasField("stop"):
                head.append(f"   STOP REQUESTED by {state.stop.by}", style="bold red")
        if lease is not None:
            head.append(f"   control: {lease.holder or 'nobody'}")
        return Group(head, self._table(stale), self._foot())

    def _table(self, stale: bool) -> Any:
        from rich import box
        from rich.table import Table

        table = Table(box=box.SIMPLE_HEAD)
        for column, justify in (("joint", "left"), ("position", "right"), ("limits", "left"), ("", "left")):
            table.add_column(column, justify=justify)  # type: ignore[arg-type]
        description, states = self._values.get("description"), self._values.get("joints")
        limits = {joint.name: joint for joint in description.joints} if description is not None else {}
        for joint in states.joints if states is not None else ():
            row = limits.get(joint.name)
            if row is None:
                table.add_row(joint.name, f"{joint.position:.4f}", "", "")
                continue
            factor, unit = (180 / math.pi, "°") if row.type == _ROTARY else (1000.0, " mm")
            table.add_row(
                joint.name,
                f"{joint.position * factor:.2f}{unit}",
                _bar(joint.position, row.lower, row.upper),
                f"{row.lower * factor:.0f} .. {row.upper * factor:.0f}{unit}",
                style="dim strike" if stale else None,
            )
        return table

    def _foot(self) -> Any:
        from rich.text import Text

        kinematics = self._values.get("kinematics")
        joints = self.subscriptions["joints"]
        key = robot_key(*self.robot, "joints")
        words = f"lost {joints.lost(key)}   {time.strftime('%H:%M:%S')}   Ctrl-C ends"
        if kinematics is not None:
            x, y, z = (kinematics.tool_to_base[index] * 1000 for index in (3, 7, 11))
            words = f"tool {x:.1f} {y:.1f} {z:.1f} mm   " + words
        return Text(words, style="dim")


def _bar(position: float, lower: float, upper: float) -> str:
    span = upper - lower
    share = (position - lower) / span if span > 0 else 0.5
    cell = min(max(round(share * (_BAR_CELLS - 1)), 0), _BAR_CELLS - 1)
    return "─" * cell + "●" + "─" * (_BAR_CELLS - 1 - cell)


def _word(enum: Any, value: int) -> str:
    return str(enum.Name(value)).rsplit("_", 1)[-1].lower()
