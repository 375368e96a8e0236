"""`robomesh list`: sites, robots and services, with monitors, control, ages and round trips."""

import asyncio
import contextlib
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated, Any

import typer

from robomesh.contract.activity import activity_words
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.enum_names import enum_name, enum_word
from robomesh.contract.keys import ROOT, WHOLE_SITE, PresenceKey, is_replay, robot_key
from robomesh.contract.messages import received_reason
from robomesh.contract.topics import Role
from robomesh.errors import NoAnswerError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.clock import Clock, Reading, read_clock
from robomesh.wire.last_values import last_values
from robomesh.wire.presence import SILENT
from robomesh.wire.session import Session
from services.command_line.terminal import discovery
from services.command_line.terminal.alarm_lists import gone_sites, lists
from services.command_line.terminal.options import Connect, Json, command_group
from services.command_line.terminal.output import console, print_json, print_line
from services.command_line.watch.listing_text import listing_text
from services.command_line.watch.monitor_text import replay_record

app = command_group()

_State = schema.ControllerState
_Stops, _Command = schema.Capabilities.Stops, schema.CommandRequest.Command
_Recovery = schema.Recover.Recovery
_KNOWN = {_State.YES: True, _State.NO: False}
_Alarm = schema.Alarm
# Requests per process, of which the quickest counts; requests in parallel; timeout.
_CLOCKS, _CLOCKS_AT_ONCE, _CLOCK_S = 3, 8, 0.7
_AGAIN_S = 2.0
# Timeouts for the last values of a robot, and of one whose gateway is present.
_ANSWER_S, _LATE_S = 1.5, 8.0


@dataclass
class _Clocks:
    """Clock readings, kept from one collection to the next."""

    by_id: dict[str, Clock] = field(default_factory=dict)


@app.command("list")
def list_(
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
    watch: Annotated[bool, typer.Option("--watch", help="Repeat until Ctrl-C.")] = False,
) -> None:
    """List sites, robots and services, with monitors, control, ages and round trips."""
    with contextlib.suppress(KeyboardInterrupt):
        discovery.run(_watch(connect, as_json) if watch else _once(connect, as_json))


async def _once(router: str, as_json: bool) -> None:
    async with discovery.attached(router) as session:
        found = await _collect(session, _Clocks())
    if as_json:
        print_json(found)
        return
    if not found["services"]:
        print_line("no service is on the mesh")
        return
    screen = console()
    screen.print(listing_text(found, screen.width))


async def _watch(router: str, as_json: bool) -> None:
    from rich.live import Live

    async with discovery.attached(router) as session:
        clocks = _Clocks()
        if as_json:
            while True:
                print_json(await _collect(session, clocks))
                await asyncio.sleep(_AGAIN_S)
        screen = console()
        while not screen.is_terminal:  # Live needs a screen
            screen.print(listing_text(await _collect(session, clocks), screen.width))
            await asyncio.sleep(_AGAIN_S)
        with Live(console=screen, screen=False, auto_refresh=False, vertical_overflow="crop") as live:
            while True:
                live.update(listing_text(await _collect(session, clocks), screen.width), refresh=True)
                await asyncio.sleep(_AGAIN_S)


async def _collect(session: Session, clocks: _Clocks) -> dict[str, Any]:
    services = await session.present()
    sessions, complete = await session.present_sessions()
    alive = sorted(services + sessions)
    robots = sorted({(key.site, key.robot) for key in alive if key.robot != WHOLE_SITE})
    with_gateway = {(key.site, key.robot) for key in alive if key.service == Role.GATEWAY.value}
    rows, health, listed = await asyncio.gather(
        asyncio.gather(*(_row(session, *each, gateway=each in with_gateway) for each in robots)),
        last_values(session, f"{ROOT}/*/{WHOLE_SITE}/health/*"),
        lists(session),
    )
    by_process = {each.id: each for each in health.values() if isinstance(each, schema.ServiceHealth)}
    processes = {key.id: key.site for key in alive if key.service not in SILENT and key.id in by_process}
    await _read_clocks(session, processes, clocks)
    return {
        "robots": list(rows),
        "services": [_service(key, by_process.get(key.id), clocks.by_id.get(key.id)) for key in alive],
        "sites": _sites(alive, listed),
        "partial": not complete,
    }


async def _read_clocks(session: Session, processes: dict[str, str], clocks: _Clocks) -> None:
    slots = asyncio.Semaphore(_CLOCKS_AT_ONCE)

    async def read(identity: str, site: str) -> None:
        clock = clocks.by_id.setdefault(identity, Clock())
        async with slots:
            for _ in range(_CLOCKS):
                try:
                    clock.readings.append(await read_clock(session, site, identity, timeout_s=_CLOCK_S))
                except NoAnswerError:
                    return

    clocks.by_id = {identity: clock for identity, clock in clocks.by_id.items() if identity in processes}
    await asyncio.gather(*(read(identity, site) for identity, site in processes.items()))


def _service(key: PresenceKey, health: schema.ServiceHealth | None, clock: Clock | None) -> dict[str, Any]:
    best = None if clock is None else clock.best
    known: dict[str, Any] = dict.fromkeys(
        ("version", "host", "pid", "age_s", "cpu", "memory_bytes", "received", "lost")
    )
    if health is not None:
        for name in ("version", "host", "pid", "cpu", "memory_bytes", "received", "lost"):
            known[name] = getattr(health, name)
        known["age_s"] = _age_s(health, best)
    return {
        "site": key.site,
        "robot": key.robot,
        "service": key.service,
        "id": key.id,
        **known,
        "problems": [] if health is None else [str(received_reason(each)) for each in health.problems],
        "round_trip_s": None if best is None else best.round_trip_s,
        "clock_offset_s": None if best is None else best.offset_s,
    }


def _age_s(health: schema.ServiceHealth, best: Reading | None) -> float | None:
    """Return the age of the process's last report, by its own clock; None: its clock's offset is unknown."""
    if best is None:
        return None
    sent_s = health.timestamp.ToNanoseconds() * 1e-9 - best.offset_s
    return max(time.time() - sent_s, 0.0)


def _sites(alive: list[PresenceKey], listed: list[schema.AlarmList]) -> list[dict[str, Any]]:
    """Return the sites that are present, and those that a watch reports as gone."""
    found = {each.site: each for each in listed}
    present, gone = {key.site for key in alive}, gone_sites(listed)
    rows = []
    for site in sorted(present | gone.keys()):
        # The alarms of a site that is gone are unknown.
        held = found[site].alarms if site in found and site in present else None
        states = None if held is None else Counter(enum_word(_Alarm.State, each.state) for each in held)
        unseen = [each for each in held or () if each.state == _Alarm.UNACKNOWLEDGED]
        rows.append(
            {
                "site": site,
                "gone_since": None if site in present else gone[site].since.ToNanoseconds() * 1e-9,
                "alarms": None if states is None else dict(states),
                "most_urgent": {"id": unseen[0].id, "text": unseen[0].text} if unseen else None,
                "monitors": len({key.id for key in alive if key.site == site and key.service == "monitor"}),
            }
        )
    return rows


async def _row(session: Session, site: str, robot: str, *, gateway: bool) -> dict[str, Any]:
    if is_replay(robot):
        # Its recorded controller and holder are not current.
        return _row_without_gateway(site, robot, "replay") | {"replay": await _replayed(session, site, robot)}
    # One that is present may be far away, or its machine busy.
    timeout_s = _LATE_S if gateway else _ANSWER_S
    state, lease = await asyncio.gather(
        session.last(robot_key(site, robot, "controller"), timeout_s=timeout_s),
        session.last(robot_key(site, robot, "lease"), timeout_s=timeout_s),
    )
    if not isinstance(state, _State):
        return _row_without_gateway(site, robot, "no answer" if gateway else "no gateway")
    return {
        "site": site,
        "robot": robot,
        "link": enum_word(_State.Link, state.link),
        "mode": enum_word(_State.Mode, state.mode),
        "activity": enum_word(_State.Activity, state.activity),
        "state": activity_words(state),
        "stop_id": state.stop.id if state.HasField("stop") else None,
        "read_only": state.read_only,
        "joints_unproven": state.joints_unproven,
        "software": state.software,
        **_capabilities(state.capabilities if state.HasField("capabilities") else None),
        "rate_hz": state.rate_hz if state.HasField("rate_hz") else None,
        "age_s": state.last_unit_age_s if state.HasField("last_unit_age_s") else None,
        "holder": lease.holder if isinstance(lease, schema.Lease) else "",
        "replay": None,
    }


def _capabilities(found: schema.Capabilities | None) -> dict[str, Any]:
    """Return what the driver can do with its controller; None: not reported."""
    return {
        "stops": None if found is None else enum_word(_Stops, found.stops),
        "commands": [] if found is None else [enum_name(_Command, each) for each in found.commands],
        "absolute": None if found is None else found.absolute,
        "dies_with_link": None if found is None else _KNOWN.get(found.dies_with_link),
        "slow_hz": found.slow_hz if found is not None and found.HasField("slow_hz") else None,
        "recoveries": [] if found is None else [enum_word(_Recovery, each) for each in found.recoveries],
    }


def _row_without_gateway(site: str, robot: str, link: str) -> dict[str, Any]:
    return {
        "site": site,
        "robot": robot,
        "link": link,
        "mode": "unknown",
        "activity": "unknown",
        "state": "unknown",
        "stop_id": None,
        "read_only": False,
        "joints_unproven": False,
        "software": "",
        **_capabilities(None),
        "rate_hz": None,
        "age_s": None,
        "holder": "",
        "replay": None,
    }


async def _replayed(session: Session, site: str, robot: str) -> dict[str, Any]:
    """Return a replay's recording and position."""
    state = await session.last(robot_key(site, robot, "replay"), timeout_s=1.5)
    return replay_record(state if isinstance(state, schema.ReplayState) else schema.ReplayState())
