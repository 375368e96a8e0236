"""`robomesh alarms`: listed, acknowledged, shelved; of every site that the router reaches."""

import json
import re
from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime
from typing import TYPE_CHECKING, Any

from google.protobuf.timestamp_pb2 import Timestamp

from robomesh.keys import WHOLE_SITE, check_chunk, robot_key
from robomesh.messages import to_json
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line import discovery
from services.command_line.alarms.lists import lists
from services.command_line.live.listing_text import since
from services.errors import ServiceError

if TYPE_CHECKING:
    from rich.padding import Padding
    from rich.text import Text

_Alarm, _Request = schema.Alarm, schema.AlarmRequest
_UNITS_S = {"s": 1.0, "m": 60.0, "h": 3600.0}
_STYLES = {
    _Alarm.LOW: "yellow",
    _Alarm.MEDIUM: "yellow",
    _Alarm.HIGH: "bold red",
    _Alarm.CRITICAL: "bold red",
}


class NoSuchAlarmError(ServiceError):
    """An alarm that no site has, or a name that several have; or a time that is none."""


def print_list(router: str, as_json: bool) -> None:
    """Print all alarms."""

    async def collect() -> list[schema.AlarmList]:
        async with discovery.attached(router) as session:
            return await lists(session)

    found = discovery.run(collect())
    if as_json:
        discovery.print_json({"alarms": [record(alarm) for each in found for alarm in each.alarms]})
        return
    _print(found)


def acknowledge(ids: list[str], router: str, operator: str, as_json: bool) -> None:
    """Say that they were seen."""
    _ask(ids, _Request(action=_Request.ACKNOWLEDGE), router, operator, as_json)


def shelve(ids: list[str], for_: str, reason: str, router: str, operator: str, as_json: bool) -> None:
    """Put them aside."""
    request = _Request(action=_Request.SHELVE, shelve_s=_seconds(for_), reason=reason)
    _ask(ids, request, router, operator, as_json)


def unshelve(ids: list[str], router: str, operator: str, as_json: bool) -> None:
    """Take them back."""
    _ask(ids, _Request(action=_Request.UNSHELVE), router, operator, as_json)


def record(alarm: schema.Alarm) -> dict[str, Any]:
    """An alarm for programs; times are seconds since the Unix epoch."""
    values: dict[str, Any] = json.loads(to_json(alarm))
    for name in ("since", "last", "returned", "at", "shelved_until"):
        told = alarm.HasField(name)
        values[name] = getattr(alarm, name).ToNanoseconds() * 1e-9 if told else None
    return values


def _ask(ids: list[str], request: schema.AlarmRequest, router: str, operator: str, as_json: bool) -> None:
    by = check_chunk(operator or discovery.own_name())

    async def ask() -> list[schema.AlarmList]:
        async with discovery.attached(router) as session:
            answers = []
            for site, names in _by_site(ids, await lists(session)).items():
                request.ids[:] = names
                key = robot_key(site, WHOLE_SITE, f"alarms/request/{by}")
                answers.append(await session.ask(key, request))
            return [each for each in answers if isinstance(each, schema.AlarmList)]

    answers = discovery.run(ask())
    if as_json:
        discovery.print_json({"alarms": [record(alarm) for each in answers for alarm in each.alarms]})
        return
    _print(answers)


def _by_site(ids: Iterable[str], found: list[schema.AlarmList]) -> dict[str, list[str]]:
    """The alarms that are meant, by the site that has them.

    Raises:
        NoSuchAlarmError: If one is nowhere, or there are several of that name.
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
    """As the page shows it."""
    return f"{alarm.source} · {alarm.code}"


def _other_names(site: str, alarm: schema.Alarm) -> set[str]:
    """What else a person may call it who has seen it on the page."""
    names = (alarm.code, _kind(alarm), f"{alarm.robot}:{alarm.code}")
    return {*names, *(f"{site}/{name}" for name in names)}


def _seconds(text: str) -> float:
    """A duration as people write it.

    Raises:
        NoSuchAlarmError: If it is none.
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([smh])", text.strip())
    if match is None:
        raise NoSuchAlarmError(f"--for {text}: a number with s, m or h is right, as in 30m or 8h")
    return float(match[1]) * _UNITS_S[match[2]]


def _print(found: list[schema.AlarmList]) -> None:
    if not found:
        print("no site has a watch here: nobody holds alarms (robomesh watch)")
        return
    if not any(each.alarms for each in found):
        print(f"no alarms at {', '.join(each.site for each in found)}")
        return
    from rich.console import Console

    console = Console()
    for each in found:
        for alarm in each.alarms:
            head, name, rest = picture(each.site, alarm)
            # A name that is longer than a line is broken by the terminal: it can be copied whole.
            console.print(head, soft_wrap=True)
            console.print(name, soft_wrap=True)
            console.print(rest)


def picture(site: str, alarm: schema.Alarm) -> "tuple[Text, Text, Padding]":
    """An alarm for people: how urgent it is and what kind, its name, and what to do in the lines below."""
    from rich.padding import Padding
    from rich.text import Text

    quiet = alarm.state in (_Alarm.SHELVED, _Alarm.RETURNED)
    style = "dim" if quiet else _STYLES.get(alarm.priority, "")
    head = Text(_Alarm.Priority.Name(alarm.priority), style=style)
    state = _Alarm.State.Name(alarm.state).lower()
    at = since(alarm.since.ToNanoseconds() * 1e-9)
    head.append(f"  {state}  {at}  {_kind(alarm)}", style="not bold")
    rest = Text(alarm.text)
    for line in _more(alarm):
        rest.append(f"\n{line}", style="dim")
    return head, Text(f"  {site}/{alarm.id}", style="" if quiet else "bold"), Padding(rest, (0, 0, 0, 4))


def _more(alarm: schema.Alarm) -> list[str]:
    """Who knows, and what to do."""
    words = [f"{alarm.count} times"] if alarm.count > 1 else []
    if alarm.by:
        words.append(f"by {alarm.by}")
    if alarm.state == _Alarm.SHELVED:
        return [", ".join([*words, f"until {_local(alarm.shelved_until):%H:%M}: {alarm.reason}"])]
    return [line for line in (", ".join(words), alarm.advice) if line]


def _local(at: Timestamp) -> datetime:
    return datetime.fromtimestamp(at.ToNanoseconds() * 1e-9).astimezone()
