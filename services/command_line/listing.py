"""`robomesh list`: sites, robots, services, who controls, how old."""

import asyncio
from typing import Any

from bus.keys import WHOLE_SITE, robot_key
from bus.schemas import robomesh_pb2 as schema
from bus.session import Session
from services.command_line import find

_State = schema.ControllerState


def run(router: str, as_json: bool) -> None:
    """Print what is on the mesh."""
    found = find.run(_collect(router))
    if as_json:
        find.print_json(found)
        return
    if not found["services"]:
        print("nobody is on the mesh")
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD)
    for column in ("robot", "link", "mode", "age", "in control", "services"):
        table.add_column(column)
    for row in found["robots"]:
        name = f"{row['site']}/{row['robot']}"
        own = [
            s["service"] for s in found["services"] if (s["site"], s["robot"]) == (row["site"], row["robot"])
        ]
        age = "-" if row["age_s"] is None else f"{row['age_s']:.1f} s"
        table.add_row(name, row["link"], row["mode"], age, row["holder"] or "nobody", " ".join(own))
    for site in sorted({s["site"] for s in found["services"]}):
        own = [s["service"] for s in found["services"] if (s["site"], s["robot"]) == (site, WHOLE_SITE)]
        if own:
            table.add_row(site, "", "", "", "", " ".join(own))
    Console().print(table)


async def _collect(router: str) -> dict[str, Any]:
    async with find.attached(router) as session:
        alive = await session.present()
        robots = sorted({(key.site, key.robot) for key in alive if key.robot != WHOLE_SITE})
        rows = await asyncio.gather(*(_row(session, site, robot) for site, robot in robots))
        return {
            "robots": list(rows),
            "services": [
                {"site": key.site, "robot": key.robot, "service": key.service, "id": key.id} for key in alive
            ],
        }


async def _row(session: Session, site: str, robot: str) -> dict[str, Any]:
    state, lease = await asyncio.gather(
        session.last(robot_key(site, robot, "controller"), timeout_s=1.5),
        session.last(robot_key(site, robot, "lease"), timeout_s=1.5),
    )
    if not isinstance(state, _State):
        return {
            "site": site,
            "robot": robot,
            "link": "no gateway",
            "mode": "unknown",
            "age_s": None,
            "holder": "",
        }
    return {
        "site": site,
        "robot": robot,
        "link": _State.Link.Name(state.link).lower(),
        "mode": _State.Mode.Name(state.mode).lower().removeprefix("mode_"),
        "age_s": state.last_unit_age_s if state.HasField("last_unit_age_s") else None,
        "holder": lease.holder if isinstance(lease, schema.Lease) else "",
    }
