"""`robomesh list`: sites, robots, services, who watches, who controls, how old, how far away."""

import asyncio
import contextlib
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from robomesh.clock import Clock, Reading, read_clock
from robomesh.errors import NoAnswerError
from robomesh.keys import ROOT, WHOLE_SITE, PresenceKey, is_replay, robot_key
from robomesh.last_values import last_values
from robomesh.presence import SILENT
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from services.command_line import discovery
from services.command_line.alarm_lists import gone_sites, lists
from services.command_line.live.listing_text import picture
from services.command_line.live.monitor_text import replay_record

_State = schema.ControllerState
_Alarm = schema.Alarm
# The quickest of so many questions, as many at once.
_CLOCKS, _CLOCKS_AT_ONCE, _CLOCK_S = 3, 8, 0.7
_AGAIN_S = 2.0


@dataclass
class _Around:
    """What is kept from one look to the next."""

    clocks: dict[str, Clock] = field(default_factory=dict)


def run(router: str, as_json: bool, watch: bool = False) -> None:
    """Print what is on the mesh: once, or again and again until Ctrl-C."""
    with contextlib.suppress(KeyboardInterrupt):
        discovery.run(_watch(router, as_json) if watch else _once(router, as_json))


async def _once(router: str, as_json: bool) -> None:
    async with discovery.attached(router) as session:
        found = await _collect(session, _Around())
    if as_json:
        discovery.print_json(found)
        return
    if not found["services"]:
        print("nobody is on the mesh")
        return
    from rich.console import Console

    console = Console()
    console.print(picture(found, console.width))


async def _watch(router: str, as_json: bool) -> None:
    from rich.console import Console
    from rich.live import Live

    async with discovery.attached(router) as session:
        around = _Around()
        if as_json:
            while True:
                discovery.print_json(await _collect(session, around))
                await asyncio.sleep(_AGAIN_S)
        console = Console()
        while not console.is_terminal:  # Live draws on a screen alone, and a pipe has none
            console.print(picture(await _collect(session, around), console.width))
            await asyncio.sleep(_AGAIN_S)
        with Live(console=console, screen=False, auto_refresh=False, vertical_overflow="crop") as live:
            while True:
                live.update(picture(await _collect(session, around), console.width), refresh=True)
                await asyncio.sleep(_AGAIN_S)


async def _collect(session: Session, around: _Around) -> dict[str, Any]:
    alive = await session.present()
    robots = sorted({(key.site, key.robot) for key in alive if key.robot != WHOLE_SITE})
    rows, health, listed = await asyncio.gather(
        asyncio.gather(*(_row(session, site, robot) for site, robot in robots)),
        last_values(session, f"{ROOT}/*/{WHOLE_SITE}/health/*"),
        lists(session),
    )
    told = {each.id: each for each in health.values() if isinstance(each, schema.ServiceHealth)}
    processes = {key.id: key.site for key in alive if key.service not in SILENT and key.id in told}
    await _read_clocks(session, processes, around)
    return {
        "robots": list(rows),
        "services": [_service(key, told.get(key.id), around.clocks.get(key.id)) for key in alive],
        "sites": _sites(alive, listed),
    }


async def _read_clocks(session: Session, processes: dict[str, str], around: _Around) -> None:
    turns = asyncio.Semaphore(_CLOCKS_AT_ONCE)

    async def read(identity: str, site: str) -> None:
        clock = around.clocks.setdefault(identity, Clock())
        async with turns:
            for _ in range(_CLOCKS):
                try:
                    clock.readings.append(await read_clock(session, site, identity, timeout_s=_CLOCK_S))
                except NoAnswerError:
                    return

    around.clocks = {identity: clock for identity, clock in around.clocks.items() if identity in processes}
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
        "round_trip_s": None if best is None else best.round_trip_s,
        "clock_offset_s": None if best is None else best.offset_s,
    }


def _age_s(health: schema.ServiceHealth, best: Reading | None) -> float | None:
    """Of what a process told last, by its own clock; None: nobody knows what that says."""
    if best is None:
        return None
    told_s = health.timestamp.ToNanoseconds() * 1e-9 - best.offset_s
    return max(time.time() - told_s, 0.0)


def _sites(alive: list[PresenceKey], listed: list[schema.AlarmList]) -> list[dict[str, Any]]:
    """Those that are there, and those of which a watch says that they are gone."""
    found = {each.site: each for each in listed}
    there, gone = {key.site for key in alive}, gone_sites(listed)
    rows = []
    for site in sorted(there | gone.keys()):
        # A site that is gone cannot say what its alarms are.
        held = found[site].alarms if site in found and site in there else None
        states = None if held is None else Counter(_Alarm.State.Name(each.state).lower() for each in held)
        unseen = [each for each in held or () if each.state == _Alarm.UNACKNOWLEDGED]
        rows.append(
            {
                "site": site,
                "gone_since": None if site in there else gone[site].since.ToNanoseconds() * 1e-9,
                "alarms": None if states is None else dict(states),
                "most_urgent": {"id": unseen[0].id, "text": unseen[0].text} if unseen else None,
                "monitors": len({key.id for key in alive if key.site == site and key.service == "monitor"}),
            }
        )
    return rows


async def _row(session: Session, site: str, robot: str) -> dict[str, Any]:
    if is_replay(robot):
        # What its controller and holder were when it was recorded is not so now.
        return _nobody(site, robot, "replay") | {"replay": await _replayed(session, site, robot)}
    state, lease = await asyncio.gather(
        session.last(robot_key(site, robot, "controller"), timeout_s=1.5),
        session.last(robot_key(site, robot, "lease"), timeout_s=1.5),
    )
    if not isinstance(state, _State):
        return _nobody(site, robot, "no gateway")
    return {
        "site": site,
        "robot": robot,
        "link": _State.Link.Name(state.link).lower(),
        "mode": _State.Mode.Name(state.mode).lower().removeprefix("mode_"),
        "activity": _State.Activity.Name(state.activity).lower().removeprefix("activity_"),
        "stop_id": state.stop.id if state.HasField("stop") else None,
        "read_only": state.read_only,
        "rate_hz": state.rate_hz if state.HasField("rate_hz") else None,
        "age_s": state.last_unit_age_s if state.HasField("last_unit_age_s") else None,
        "holder": lease.holder if isinstance(lease, schema.Lease) else "",
        "replay": None,
    }


def _nobody(site: str, robot: str, link: str) -> dict[str, Any]:
    return {
        "site": site,
        "robot": robot,
        "link": link,
        "mode": "unknown",
        "activity": "unknown",
        "stop_id": None,
        "read_only": False,
        "rate_hz": None,
        "age_s": None,
        "holder": "",
        "replay": None,
    }


async def _replayed(session: Session, site: str, robot: str) -> dict[str, Any]:
    """What a replay plays, and where it is."""
    state = await session.last(robot_key(site, robot, "replay"), timeout_s=1.5)
    return replay_record(state if isinstance(state, schema.ReplayState) else schema.ReplayState())
