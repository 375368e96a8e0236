"""`robomesh signals`: what a robot's controller reports in addition to joints, once or for each message."""

import asyncio
import contextlib
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import Annotated, Any

import typer

from robomesh.client.robot.samples import utc
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import is_replay, robot_key
from robomesh.publications.subscription import Sample
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import print_json, print_line
from services.errors import ServiceError

app = command_group()

# Signals that do not change are published once a second.
_FIRST_S = 3.0


class NoSignalsError(ServiceError):
    """No current signals arrive, or none has a requested name."""


@app.command()
def signals(
    robot: Robot,
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME...]", help='Start of names, also with *: "io.", "joint.*.current".'),
    ] = None,
    follow: Annotated[bool, typer.Option("--follow", help="Repeat with each message until Ctrl-C.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Print what a robot's controller reports in addition to joints: I/O, currents, program, modes."""
    with contextlib.suppress(KeyboardInterrupt):
        discovery.run(_print(robot, names or [], connect, as_json, follow))


async def _print(name: str, patterns: Sequence[str], router: str, as_json: bool, follow: bool) -> None:
    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        subscription = session.subscribe(robot_key(*robot, "signals"))
        limit_s: float | None = _FIRST_S
        while True:
            try:
                async with asyncio.timeout(limit_s):
                    sample = await _live(aiter(subscription))
            except TimeoutError:
                raise NoSignalsError(
                    f"{robot.site}/{robot.name} has no current signals: its controller reports none, or is "
                    "not connected"
                ) from None
            record = _record(sample, patterns)
            if not record["signals"]:
                raise NoSignalsError(
                    f"{robot.site}/{robot.name} has no signal {' or '.join(map(repr, patterns)) or 'now'}: "
                    "robomesh signals without a name lists all"
                )
            if as_json:
                print_json(record)
            else:
                for line in _lines(record):
                    print_line(line)
            if not follow:
                return
            limit_s = None


async def _live(samples: Any) -> Sample:
    """Return the next published message; the last one from before may be old."""
    while True:
        sample: Sample = await anext(samples)
        if sample.live:
            return sample


def _record(sample: Sample, patterns: Sequence[str]) -> dict[str, Any]:
    message = sample.message()
    assert isinstance(message, schema.Signals)
    shown = [
        each
        for each in message.signals
        if not patterns or any(fnmatchcase(each.name, f"{pattern}*") for pattern in patterns)
    ]
    return {
        "key": sample.key,
        "time": utc(sample.header.source_time_ns).astimezone().isoformat(),
        "live": not is_replay(sample.parsed.robot),
        "signals": {
            each.name: {
                "value": getattr(each, each.WhichOneof("value") or "text"),
                "unit": each.unit,
                "age_s": each.age_s,
            }
            for each in shown
        },
    }


def _lines(record: dict[str, Any]) -> list[str]:
    signals = record["signals"]
    width = max(map(len, signals))
    lines = [] if record["live"] else ["recorded:"]
    for name, signal in signals.items():
        value, unit = signal["value"], signal["unit"]
        if isinstance(value, bool):
            shown = "on" if value else "off"
        else:
            shown = f"{value:.6g}" if isinstance(value, float) else value
        age = f"  ({signal['age_s']:.1f} s old)" if signal["age_s"] >= 1.0 else ""
        lines.append(f"{name:<{width}}  {shown}{f' {unit}' if unit else ''}{age}")
    return lines
