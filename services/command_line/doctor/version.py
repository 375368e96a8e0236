"""`robomesh version`: the versions that a report of a fault needs."""

import asyncio
import importlib.metadata
import platform
import re
from collections import Counter
from typing import Annotated, Any

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from services.command_line.terminal.options import Connect, Json, command_group
from services.command_line.terminal.output import print_json, print_line

app = command_group()

_ANSWER_S = 3.0


@app.command()
def version(
    everything: Annotated[
        bool, typer.Option("--all", help="Also of Python, of each package, and of the services on the mesh.")
    ] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Print the version of robomesh; --all: all that a report of a fault needs."""
    from robomesh.errors import RobomeshError
    from services.command_line.terminal import discovery

    found: dict[str, Any] = {"robomesh": installed("robomesh")}
    if everything:
        found |= {
            "python": f"{platform.python_version()} ({platform.python_implementation()})",
            "platform": platform.platform(),
            "packages": _packages(),
            "services": None,
        }
        try:
            found["services"] = discovery.run(_services(connect))
        except (RobomeshError, TimeoutError) as error:
            found["problem"] = str(error) or f"no answer in {_ANSWER_S:g} s"
    if as_json:
        print_json(found)
    else:
        for line in _lines(found):
            print_line(line)


def installed(package: str) -> str | None:
    """Return the version of a package; None: it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _packages() -> dict[str, str | None]:
    """Return the versions of the packages that robomesh and its extras name."""
    names = {
        re.split(r"[^\w.-]", each, maxsplit=1)[0] for each in importlib.metadata.requires("robomesh") or ()
    }
    return {name: installed(name) for name in sorted(names - {"robomesh"})}


async def _services(router: str) -> list[dict[str, Any]]:
    """Return the versions of the processes on the mesh, with their number, from their health reports.

    Raises:
        RobomeshError: If no router answers.
        TimeoutError: If the router does not answer in time.
    """
    from robomesh.contract.keys import ROOT, WHOLE_SITE
    from robomesh.schemas.robomesh_pb2 import ServiceHealth
    from robomesh.wire.last_values import last_values
    from services.command_line.terminal import discovery

    async with asyncio.timeout(_ANSWER_S), discovery.attached(router) as session:
        alive, health = await asyncio.gather(
            session.present(), last_values(session, f"{ROOT}/*/{WHOLE_SITE}/health/*")
        )
    versions = {each.id: each.version for each in health.values() if isinstance(each, ServiceHealth)}
    processes = {(key.site, key.service, key.id) for key in alive}
    counted = Counter((site, service, versions.get(id_)) for site, service, id_ in processes)
    return [
        {"site": site, "service": service, "version": version, "processes": count}
        for (site, service, version), count in sorted(counted.items(), key=str)
    ]


def _lines(found: dict[str, Any]) -> list[str]:
    lines = [f"robomesh {found['robomesh'] or 'not installed as a package'}"]
    if "python" not in found:
        return lines
    lines += [f"Python {found['python']}", found["platform"]]
    packages = found["packages"]
    lines.append(", ".join(f"{name} {number}" for name, number in packages.items() if number))
    if absent := [name for name, number in packages.items() if number is None]:
        lines.append(f"not installed: {', '.join(absent)}")
    if found["services"] is None:
        return [*lines, f"services: unknown: {found['problem']}"]
    for row in found["services"]:
        several = f" ({row['processes']} processes)" if row["processes"] > 1 else ""
        lines.append(f"{row['site']} {row['service']} {row['version'] or 'unknown'}{several}")
    return lines if found["services"] else [*lines, "services: none on the mesh"]
