"""`robomesh audit`: search the audit logs of gateways, and verify a log.

A command imports the reader of logs when it runs: with the gateway's modules it takes half a second.
"""

import asyncio
import math
import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.enum_names import enum_name
from robomesh.contract.keys import WHOLE_SITE, robot_key
from robomesh.errors import NoAnswerError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.command_line.terminal import discovery
from services.command_line.terminal.local_time import time_text
from services.command_line.terminal.options import Connect, Json, command_group
from services.command_line.terminal.output import print_json, print_line
from services.errors import ServiceError

app = command_group("audit", "The gateway's audit log.")

# A gateway may search its whole log, at low priority.
_TIMEOUT_S = 30.0
_POSITIONS = "joint_positions"
_ACCEPTED = schema.AuditEntry.Outcome.ACCEPTED
_ROTARY = schema.Description.Joint.Type.ROTARY
_UNITS = {"s": "seconds", "m": "minutes", "h": "hours", "d": "days"}


class AuditFileError(ServiceError):
    """An audit log cannot be read."""


class AuditQueryError(ServiceError):
    """An option value of a search is invalid."""


class _Row(NamedTuple):
    """An entry of a robot's log; `joints` is empty where the robot's description is unknown."""

    robot: str
    entry: schema.AuditEntry
    joints: Sequence[schema.Description.Joint] = ()


# ---------------------------------------------------------------------- verify


@app.command()
def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    head: Annotated[str, typer.Option(metavar="HASH", help="The last entry's hash, if known.")] = "",
    recording: Annotated[
        Path | None, typer.Option(metavar="REC.mcap", help="A recording that holds the hash, instead.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Check that an audit log, with its older parts, is complete and unchanged; exit status 1 if not."""
    from protocol_gateway.audit.log import verify as verify_log

    if recording is not None:
        if head:
            raise AuditQueryError(
                "--head and --recording both name the entry that the log must hold: give one"
            )
        head = _recorded_head(recording)
    try:
        result = verify_log(file, head.lower() or None)
    except OSError as error:
        raise AuditFileError(f"{file}: cannot be read: {error.strerror}") from None
    if as_json:
        print_json(
            {
                "ok": result.ok and result.entries > 0,
                "entries": result.entries,
                "first_break": result.first_break,
                "first_entry": result.first,
                "head": {"number": result.first + result.entries - 1, "hash": result.last_hash},
            }
        )
    elif not result.entries and result.ok:
        print_line(f"{file}: has no entries, as an emptied log would")
    elif result.ok:
        taken = f"; entries 1 to {result.first - 1}, in older parts, are not here" if result.first > 1 else ""
        print_line(f"{file}: {result.entries} entries, complete and unchanged{taken}")
    else:
        print_line(f"{file}: {result.text}")
    if not result.ok or not result.entries:
        raise typer.Exit(1)


def _recorded_head(recording: Path) -> str:
    from robomesh.recordings.files import describe_file

    described = describe_file(recording)
    if not described.HasField("audit_head"):
        raise AuditQueryError(
            f"{recording}: holds no audit head: the log was empty, or the gateway was an earlier version"
        )
    return described.audit_head.hash.hex()


# ------------------------------------------------------------------------ list


@app.command("list")
def list_(
    robot: Annotated[
        str, typer.Argument(metavar="[ROBOT]", help="Else all robots; or FILE.jsonl, a log.")
    ] = "",
    operator: Annotated[str, typer.Option(help="The operator of the request.")] = "",
    request: Annotated[str, typer.Option(help="stop, acquire, home, move_absolute, ...")] = "",
    outcome: Annotated[str, typer.Option(help="accepted, refused, failed")] = "",
    since: Annotated[str, typer.Option(metavar="TIME", help="RFC 3339, 15:04, or 10m (ago)")] = "",
    until: Annotated[str, typer.Option(metavar="TIME", help="the same")] = "",
    most: Annotated[int, typer.Option(metavar="N", help="Only the newest N.")] = 100,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """List requests to robots, with operator and outcome, oldest first."""
    from protocol_gateway.telemetry.state_messages import timestamp

    now = datetime.now().astimezone()
    query = schema.AuditQuery(
        operator=operator,
        request=request.upper(),
        outcome=_outcome(outcome) or None,
        most=_checked_most(most),
    )
    if since:
        query.since.CopyFrom(timestamp(moment(since, now)))
    if until:
        query.until.CopyFrom(timestamp(moment(until, now)))
    rows = (
        _of_file(Path(robot), query)
        if robot.endswith(".jsonl")
        else discovery.run(_of_mesh(robot, connect, query))
    )
    rows = sorted(rows, key=lambda row: row.entry.timestamp.ToNanoseconds())[-most:]
    if as_json:
        for row in rows:
            print_json(_values(row))
    else:
        _print(rows, of_all=not robot)


def moment(text: str, now: datetime) -> int:
    """Parse a time to ns since the Unix epoch: RFC 3339, 15:04[:05] today, or 10m (ago).

    Raises:
        AuditQueryError: If the text has none of these forms.
    """
    ago = re.fullmatch(r"(\d{1,6})([smhd])( ago)?", text.strip())
    try:
        if ago is not None:
            when = now - timedelta(**{_UNITS[ago[2]]: int(ago[1])})
        elif re.fullmatch(r"\d\d?:\d\d(:\d\d)?", text.strip()):
            day = now.strftime("%Y-%m-%d")
            when = datetime.fromisoformat(f"{day}T{text.strip():0>5}").astimezone()
        else:
            when = datetime.fromisoformat(text.strip()).astimezone()
        return int(when.replace(microsecond=0).timestamp()) * 1_000_000_000 + when.microsecond * 1000
    except (ValueError, OverflowError):
        raise AuditQueryError(
            f"{text!r} is no time: write 2026-11-21T15:04:05Z, 15:04 (today), or 10m (ago; s, m, h, d)"
        ) from None


def _outcome(text: str) -> str:
    from protocol_gateway.audit.log import Outcome

    if text and text.upper() not in Outcome.__members__:
        raise AuditQueryError(f"--outcome {text!r}: it can be accepted, refused or failed")
    return text.upper()


def _checked_most(most: int) -> int:
    from protocol_gateway.audit import search

    if not 1 <= most <= search.MOST:
        raise AuditQueryError(f"--most {most}: it can be 1 to {search.MOST}")
    return most


def _of_file(file: Path, query: schema.AuditQuery) -> list[_Row]:
    from protocol_gateway.audit import search
    from protocol_gateway.authority.audit_entry import entry_message

    try:
        found = search.find(file, search.query_of(query))
    except OSError as error:
        raise AuditFileError(f"{file}: cannot be read: {error.strerror}") from None
    return [_Row(file.stem, entry_message(entry)) for entry in found]


async def _of_mesh(text: str, router: str, query: schema.AuditQuery) -> list[_Row]:
    async with discovery.attached(router) as session:
        if text:
            return await _ask(session, await discovery.find(session, text), query)
        alive = await session.present()
        robots = sorted(
            {discovery.RobotAddress(key.site, key.robot) for key in alive if key.robot != WHOLE_SITE}
        )
        answers = await asyncio.gather(*(_ask_or_warn(session, robot, query) for robot in robots))
        return [row for answer in answers for row in answer]


async def _ask(session: Session, robot: discovery.RobotAddress, query: schema.AuditQuery) -> list[_Row]:
    answer = await session.ask(robot_key(*robot, "audit/find"), query, timeout_s=_TIMEOUT_S)
    assert isinstance(answer, schema.AuditList)
    description = None
    if any(_POSITIONS in entry.values for entry in answer.entries):
        description = await session.last(robot_key(*robot, "description"), timeout_s=1.0)
    joints = description.joints if isinstance(description, schema.Description) else ()
    return [_Row(str(robot), entry, joints) for entry in answer.entries]


async def _ask_or_warn(
    session: Session, robot: discovery.RobotAddress, query: schema.AuditQuery
) -> list[_Row]:
    """Return no rows for a robot without a gateway, so that it does not hide the others."""
    alive = {(key.site, key.robot) for key in await session.present() if key.service == "gateway"}
    try:
        if tuple(robot) in alive:
            return await _ask(session, robot, query)
    except NoAnswerError:
        pass
    print_line(f"robomesh: {robot}: no gateway answers, and the log is on the gateway's disk", err=True)
    return []


def _values(row: _Row) -> dict[str, Any]:
    entry = row.entry
    return {
        "robot": row.robot,
        "number": entry.number,
        "time": entry.timestamp.ToJsonString(),
        "operator": entry.operator,
        "source": entry.source,
        "request": entry.request,
        "outcome": enum_name(schema.AuditEntry.Outcome, entry.outcome),
        "text": entry.text,
        "values": dict(entry.values),
        "repeated": entry.repeated_count,
        "hash": entry.hash.hex(),
    }


def _print(rows: Sequence[_Row], *, of_all: bool) -> None:
    if not rows:
        print_line("no entry matches")
    width = max((len(row.robot) for row in rows), default=0)
    for row in rows:
        entry = row.entry
        outcome = enum_name(schema.AuditEntry.Outcome, entry.outcome)
        parts = (
            time_text(entry.timestamp, "milliseconds"),
            f"{row.robot:<{width}}" if of_all else "",
            f"{entry.number:>6}",
            f"{entry.operator:<12}",
            f"{entry.request:<13}",
            f"{outcome:<8}",
            f"x {entry.repeated_count}" if entry.repeated_count else "",
            entry.text,
            " ".join(f"{name}={_plain(row, name, value)}" for name, value in sorted(entry.values.items())),
        )
        print_line("  ".join(filter(None, parts)).rstrip(), red=entry.outcome != _ACCEPTED)


def _plain(row: _Row, name: str, value: str) -> str:
    """Format a value; joint positions in degrees and mm if the robot's joints are known."""
    if name != _POSITIONS:
        return value
    try:
        pairs = list(zip(map(float, value.split()), row.joints, strict=True))
    except ValueError:  # the joints are unknown, or differ from the log's
        return f"{value} [rad, m]"
    return " ".join(
        f"{math.degrees(position):.2f}°" if joint.type == _ROTARY else f"{1000 * position:.2f}mm"
        for position, joint in pairs
    )
