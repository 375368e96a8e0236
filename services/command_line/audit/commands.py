"""`robomesh audit`: what was asked of robots, by whom; and whether a log is whole."""

import asyncio
import math
import re
import sys
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import typer

from protocol_gateway.audit import search as audit_find
from protocol_gateway.audit.entry import audit_entry
from protocol_gateway.audit.log import Outcome
from protocol_gateway.audit.log import verify as verify_log
from protocol_gateway.state_messages import timestamp
from robomesh.errors import NoAnswerError
from robomesh.keys import WHOLE_SITE, robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from services.command_line import discovery
from services.command_line.discovery import print_json
from services.errors import ServiceError

# A gateway searches its whole log if need be, gently.
_PATIENCE_S = 30.0
_POSITIONS = "joint_positions"
_ROTARY = schema.Description.Joint.Type.ROTARY
_UNITS = {"s": "seconds", "m": "minutes", "h": "hours", "d": "days"}


class AuditFileError(ServiceError):
    """An audit log that cannot be read."""


class AuditQueryError(ServiceError):
    """A search that cannot be meant."""


class _Row(NamedTuple):
    robot: str
    entry: schema.AuditEntry
    joints: Sequence[schema.Description.Joint] = ()  # where they are known


# ---------------------------------------------------------------------- verify


def verify(file: Path, head: str, recording: Path | None, as_json: bool) -> None:
    """Print whether a log is whole; exit status 1 when it is not."""
    if recording is not None:
        if head:
            raise AuditQueryError("--head or --recording: either says which entry the log must hold")
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
        print(f"{file}: no entry at all: an emptied log looks like this")
    elif result.ok:
        taken = f"; entries 1 to {result.first - 1}, in older parts, are not here" if result.first > 1 else ""
        print(f"{file}: {result.entries} entries, whole and unchanged{taken}")
    else:
        print(f"{file}: {result.text}")
    if not result.ok or not result.entries:
        raise typer.Exit(1)


def _recorded_head(recording: Path) -> str:
    from mcap_files.files import describe_file

    described = describe_file(recording)
    if not described.HasField("audit_head"):
        raise AuditQueryError(
            f"{recording}: holds no audit head: nothing was in the log, or an old gateway's"
        )
    return described.audit_head.hash.hex()


# ------------------------------------------------------------------------ list


def list_(
    robot: str,
    router: str,
    *,
    operator: str,
    request: str,
    outcome: str,
    since: str,
    until: str,
    most: int,
    as_json: bool,
) -> None:
    """Print entries, oldest first."""
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
        else discovery.run(_of_mesh(robot, router, query))
    )
    rows = sorted(rows, key=lambda row: row.entry.timestamp.ToNanoseconds())[-most:]
    if as_json:
        for row in rows:
            print_json(_values(row))
    else:
        _print(rows, of_all=not robot)


def moment(text: str, now: datetime) -> int:
    """A time as people write it, in ns since the Unix epoch: RFC 3339, 15:04[:05] today, or 10m (ago).

    Raises:
        AuditQueryError: If it is none of them.
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
    if text and text.upper() not in Outcome.__members__:
        raise AuditQueryError(f"--outcome {text!r}: it can be accepted, refused or failed")
    return text.upper()


def _checked_most(most: int) -> int:
    if not 1 <= most <= audit_find.MOST:
        raise AuditQueryError(f"--most {most}: it can be 1 to {audit_find.MOST}")
    return most


def _of_file(file: Path, query: schema.AuditQuery) -> list[_Row]:
    try:
        found = audit_find.find(file, audit_find.query_of(query))
    except OSError as error:
        raise AuditFileError(f"{file}: cannot be read: {error.strerror}") from None
    return [_Row(file.stem, audit_entry(entry)) for entry in found]


async def _of_mesh(text: str, router: str, query: schema.AuditQuery) -> list[_Row]:
    async with discovery.attached(router) as session:
        if text:
            return await _ask(session, await discovery.find(session, text), query)
        alive = await session.present()
        robots = sorted({discovery.Robot(key.site, key.robot) for key in alive if key.robot != WHOLE_SITE})
        answers = await asyncio.gather(*(_ask_or_tell(session, robot, query) for robot in robots))
        return [row for answer in answers for row in answer]


async def _ask(session: Session, robot: discovery.Robot, query: schema.AuditQuery) -> list[_Row]:
    answer = await session.ask(robot_key(*robot, "audit/find"), query, timeout_s=_PATIENCE_S)
    assert isinstance(answer, schema.AuditList)
    description = None
    if any(_POSITIONS in entry.values for entry in answer.entries):
        description = await session.last(robot_key(*robot, "description"), timeout_s=1.0)
    joints = description.joints if isinstance(description, schema.Description) else ()
    return [_Row(str(robot), entry, joints) for entry in answer.entries]


async def _ask_or_tell(session: Session, robot: discovery.Robot, query: schema.AuditQuery) -> list[_Row]:
    """One robot without a gateway must not hide the others."""
    alive = {(key.site, key.robot) for key in await session.present() if key.service == "gateway"}
    try:
        if tuple(robot) in alive:
            return await _ask(session, robot, query)
    except NoAnswerError:
        pass
    print(f"robomesh: {robot}: no gateway answers; its log is on its gateway's disk", file=sys.stderr)
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
        "outcome": schema.AuditEntry.Outcome.Name(entry.outcome),
        "text": entry.text,
        "values": dict(entry.values),
        "repeated": entry.repeated_count,
        "hash": entry.hash.hex(),
    }


def _print(rows: Sequence[_Row], *, of_all: bool) -> None:
    if not rows:
        print("no entry is like that")
    width = max((len(row.robot) for row in rows), default=0)
    for row in rows:
        entry = row.entry
        asked = datetime.fromtimestamp(entry.timestamp.ToNanoseconds() * 1e-9).astimezone()
        outcome = schema.AuditEntry.Outcome.Name(entry.outcome)
        parts = (
            f"{asked:%Y-%m-%d %H:%M:%S}.{asked.microsecond // 1000:03d}",
            f"{row.robot:<{width}}" if of_all else "",
            f"{entry.number:>6}",
            f"{entry.operator:<12}",
            f"{entry.request:<13}",
            f"{outcome:<8}",
            f"x {entry.repeated_count}" if entry.repeated_count else "",
            entry.text,
            " ".join(f"{name}={_plain(row, name, value)}" for name, value in sorted(entry.values.items())),
        )
        line = "  ".join(filter(None, parts)).rstrip()
        # Colour where people look, none where programs read.
        typer.secho(line, fg=None if outcome == "ACCEPTED" else typer.colors.RED)


def _plain(row: _Row, name: str, value: str) -> str:
    """A value for people: joint positions in degrees and mm where the robot's joints are known."""
    if name != _POSITIONS:
        return value
    try:
        pairs = list(zip(map(float, value.split()), row.joints, strict=True))
    except ValueError:  # no joints, or others than the log's
        return f"{value} [rad, m]"
    return " ".join(
        f"{math.degrees(position):.2f}°" if joint.type == _ROTARY else f"{1000 * position:.2f}mm"
        for position, joint in pairs
    )
