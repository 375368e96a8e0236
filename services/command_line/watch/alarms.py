"""`robomesh alarms`: list, acknowledge and shelve the alarms of every site that the router reaches."""

import json
import re
from collections import defaultdict
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.enum_names import enum_name, enum_word
from robomesh.contract.keys import WHOLE_SITE, check_chunk, robot_key
from robomesh.contract.messages import to_json
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.terminal import discovery
from services.command_line.terminal.alarm_lists import lists
from services.command_line.terminal.local_time import time_text
from services.command_line.terminal.options import Connect, Json, command_group
from services.command_line.terminal.output import console, print_json, print_line, styled
from services.command_line.watch.listing_text import since
from services.errors import ServiceError

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.padding import Padding

app = command_group("alarms", "Alarms: list, acknowledge, shelve.")

_Ids = Annotated[list[str], typer.Argument(metavar="ID...", help="As `alarms list` or the page shows them.")]
_Operator = Annotated[str, typer.Option(help="The operator's name; else yours.")]
_Alarm, _Request = schema.Alarm, schema.AlarmRequest
_UNITS_S = {"s": 1.0, "m": 60.0, "h": 3600.0}
_STYLES = {
    _Alarm.LOW: "yellow",
    _Alarm.MEDIUM: "yellow",
    _Alarm.HIGH: "bold red",
    _Alarm.CRITICAL: "bold red",
}


class NoSuchAlarmError(ServiceError):
    """No alarm has the name, or several have it; or a duration is invalid."""


@app.command("list")
def list_(connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """List the alarms of every site, except those that are over and acknowledged, most urgent first."""

    async def collect() -> list[schema.AlarmList]:
        async with discovery.attached(connect) as session:
            return await lists(session)

    found = discovery.run(collect())
    if as_json:
        print_json({"alarms": [record(alarm) for each in found for alarm in each.alarms]})
        return
    _print(found)


@app.command()
def ack(
    ids: Annotated[
        list[str],
        typer.Argument(metavar="ID...", help="As `alarms list` or the page shows them; all: every alarm."),
    ],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Acknowledge alarms."""
    _ask(ids, _Request(action=_Request.ACKNOWLEDGE), connect, operator, as_json, "acknowledged")


@app.command()
def shelve(
    ids: _Ids,
    reason: Annotated[str, typer.Option(help="The reason, which every operator sees.")],
    for_: Annotated[str, typer.Option("--for", metavar="30m|8h", help="Duration; at most a day.")] = "1h",
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Shelve alarms for a while."""
    request = _Request(action=_Request.SHELVE, shelve_s=_seconds(for_), reason=reason)
    _ask(ids, request, connect, operator, as_json, "shelved")


@app.command()
def unshelve(
    ids: _Ids, connect: Connect = DEFAULT_ROUTER, operator: _Operator = "", as_json: Json = False
) -> None:
    """Take alarms back from the shelf."""
    _ask(ids, _Request(action=_Request.UNSHELVE), connect, operator, as_json, "unshelved")


def record(alarm: schema.Alarm) -> dict[str, Any]:
    """Return an alarm as JSON values; times are seconds since the Unix epoch."""
    values: dict[str, Any] = json.loads(to_json(alarm))
    for name in ("since", "last", "returned", "at", "shelved_until"):
        known = alarm.HasField(name)
        values[name] = getattr(alarm, name).ToNanoseconds() * 1e-9 if known else None
    return values


def _ask(
    ids: list[str], request: schema.AlarmRequest, router: str, operator: str, as_json: bool, done: str
) -> None:
    """Send a request about alarms, then print what was `done` to which alarms, and the remaining list."""
    by = check_chunk(operator or discovery.own_name())

    async def ask() -> tuple[list[str], list[schema.AlarmList]]:
        async with discovery.attached(router) as session:
            changed, answers = [], []
            for site, names in _by_site(ids, await lists(session)).items():
                request.ids[:] = names
                key = robot_key(site, WHOLE_SITE, f"alarms/request/{by}")
                answers.append(await session.ask(key, request))
                changed += [f"{site}/{name}" for name in names]
            return changed, [each for each in answers if isinstance(each, schema.AlarmList)]

    changed, answers = discovery.run(ask())
    if as_json:
        print_json({"alarms": [record(alarm) for each in answers for alarm in each.alarms]})
        return
    print_line(f"{done}: {', '.join(changed)}")
    _print(answers)


def _by_site(ids: Iterable[str], found: list[schema.AlarmList]) -> dict[str, list[str]]:
    """Return the ids of the named alarms, by the site that has them.

    Raises:
        NoSuchAlarmError: If no alarm has a name, or several have it.
    """
    there = [(each.site, alarm) for each in found for alarm in each.alarms]
    wanted: dict[str, list[str]] = defaultdict(list)
    for text in ids:
        meant = [(s, alarm) for s, alarm in there if text in ("all", alarm.id, f"{s}/{alarm.id}")]
        meant = meant or [(s, alarm) for s, alarm in there if text in _other_names(s, alarm)]
        if not meant:
            names = ", ".join(f"{alarm.id} ({_kind(alarm)})" for _, alarm in there[:20]) or "none"
            raise NoSuchAlarmError(f"no alarm {text!r}; there are: {names}")
        if len(meant) > 1 and text != "all":
            sides = ", ".join(f"{site}/{alarm.id}" for site, alarm in meant[:20])
            raise NoSuchAlarmError(f"{text!r} is the name of several alarms; say which: {sides}")
        for site, alarm in meant:
            wanted[site].append(alarm.id)
    return wanted


def _kind(alarm: schema.Alarm) -> str:
    """Return source and code, as the page shows them."""
    return f"{alarm.source} · {alarm.code}"


def _other_names(site: str, alarm: schema.Alarm) -> set[str]:
    """Return other names that an operator may have seen on the page."""
    names = (alarm.code, _kind(alarm), f"{alarm.robot}:{alarm.code}")
    return {*names, *(f"{site}/{name}" for name in names)}


def _seconds(text: str) -> float:
    """Return the seconds of a duration such as 30m.

    Raises:
        NoSuchAlarmError: If the text has no valid unit.
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([smh])", text.strip())
    if match is None:
        raise NoSuchAlarmError(f"--for {text}: must be a number with s, m or h, as in 30m or 8h")
    return float(match[1]) * _UNITS_S[match[2]]


def _print(found: list[schema.AlarmList]) -> None:
    if not found:
        print_line("no site here runs a watch, so there are no alarms (robomesh watch starts one)")
        return
    if not any(each.alarms for each in found):
        print_line(f"no alarms at {', '.join(each.site for each in found)}")
        return
    screen = console()
    for each in found:
        for alarm in each.alarms:
            head, name, rest = alarm_text(each.site, alarm)
            # Let the terminal wrap a long name, so that it can be copied whole.
            screen.print(head, soft_wrap=True)
            screen.print(name, soft_wrap=True)
            screen.print(rest)


def alarm_text(site: str, alarm: schema.Alarm) -> "tuple[RenderableType, RenderableType, Padding]":
    """Return an alarm's texts: priority, state and kind; its name; what happened and what to do."""
    from rich.console import Group
    from rich.padding import Padding

    quiet = alarm.state in (_Alarm.SHELVED, _Alarm.RETURNED)
    style = "dim" if quiet else _STYLES.get(alarm.priority, "")
    head = styled(enum_name(_Alarm.Priority, alarm.priority), style)
    state = enum_word(_Alarm.State, alarm.state)
    at = since(alarm.since.ToNanoseconds() * 1e-9)
    head.append_text(styled(f"  {state}  {at}  {_kind(alarm)}", "not bold"))
    rest = [styled(alarm.text), *(styled(line, "dim") for line in _more(alarm))]
    return head, styled(f"  {site}/{alarm.id}", "" if quiet else "bold"), Padding(Group(*rest), (0, 0, 0, 4))


def _more(alarm: schema.Alarm) -> list[str]:
    """Return the lines below an alarm: repetitions, operator, shelving, advice."""
    words = [f"{alarm.count} times"] if alarm.count > 1 else []
    if alarm.by:
        words.append(f"by {alarm.by}")
    if alarm.state == _Alarm.SHELVED:
        return [", ".join([*words, f"until {time_text(alarm.shelved_until, 'minutes')}: {alarm.reason}"])]
    return [line for line in (", ".join(words), alarm.advice) if line]
