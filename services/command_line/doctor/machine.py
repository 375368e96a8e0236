"""`robomesh doctor`: checks of this machine, with fixes for what is missing."""

import asyncio
import http.client
import os
import shutil
import ssl
import sys
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from protocol_gateway.configuration.kinds import driver_maker, kind_of, own_kinds, part_of
from protocol_gateway.seam.errors import GatewaySettingsError
from protocol_gateway.seam.simulated import Simulated
from robomesh.errors import UnavailableError
from robomesh.extras import ADDED_IN_CHECKOUT, install_command, is_missing
from robomesh.listen_address import reachable, split_address
from services.command_line.service_settings.metrics_ports import first_address, ports
from services.command_line.service_settings.table import SERVICES
from services.command_line.terminal.output import print_json, print_line
from services.used_ports import check_free, is_absent

if TYPE_CHECKING:
    from services.site_file.site import Site

# Extra -> packages that it installs.
_EXTRAS = {
    **{name: row.packages for name, row in SERVICES.items() if name != "router"},
    "simulator": ("ruckig",),
    "keys": ("cryptography",),
    **{each.extra: each.packages for each in own_kinds().values() if each.extra},
    "foxglove": ("foxglove",),
    "ros2": ("rosbags",),
    "plots": ("matplotlib",),
    "step": ("cascadio",),
    "dxf": ("ezdxf",),
}
_FREE_BYTES = 1 << 30
_OTHER = "choose another address in the site file"
_END = f"end that program, or {_OTHER}"
# Timeout for a site that runs on this machine.
_ANSWER_S = 3.0


@dataclass(frozen=True)
class MachineCheck:
    """The result of one check; `fix` says what to do if it failed."""

    what: str
    ok: bool
    text: str
    fix: str = ""


def run(site_file: Path | None = None, as_json: bool = False) -> None:
    """Print every result; exit status 1 when something is missing.

    Args:
        site_file: The site whose addresses are checked; None: the built-in site.
    """
    from services.site_file.site import load

    site = load(site_file)
    checks = (_python, _extras, partial(_drivers, site), _open_gl, _page, partial(_addresses, site), _disk)
    results = [result for check in checks for result in check()]
    if as_json:
        rows = [{"what": each.what, "ok": each.ok, "text": each.text, "mend": each.fix} for each in results]
        print_json({"ok": all(each.ok for each in results), "findings": rows})
    for result in () if as_json else results:
        print_line(f"{'ok     ' if result.ok else 'MISSING'}  {result.what}: {result.text}")
        if not result.ok:
            print_line(f"         {result.fix}")
    if not all(result.ok for result in results):
        raise typer.Exit(1)


def _python() -> list[MachineCheck]:
    version = ".".join(map(str, sys.version_info[:3]))
    return [MachineCheck("Python", sys.version_info >= (3, 11), version, "install Python 3.11 or newer")]


def _extras() -> list[MachineCheck]:
    results = []
    for extra, packages in _EXTRAS.items():
        missing = [package for package in packages if is_missing(package)]
        fix, rare = install_command(extra), extra in ADDED_IN_CHECKOUT
        text = "its packages are installed" if not missing else f"no {', '.join(missing)}"
        if missing and rare:
            text = f"not installed; {fix} installs it"
        results.append(MachineCheck(f"{'part' if rare else 'role'} {extra}", rare or not missing, text, fix))
    return results


def _drivers(site: "Site") -> Iterator[MachineCheck]:
    """Yield whether the site's drivers of packages can be used."""
    for protocol in sorted({robot.protocol for robot in site.robot} - own_kinds().keys()):
        what, fix = f"protocol {protocol}", "correct the package, or install it again"
        try:
            kind = kind_of(protocol)
            if missing := [module for module in kind.packages if is_missing(module)]:
                install = install_command(kind.extra, kind.distribution)
                yield MachineCheck(what, False, f"no {', '.join(missing)}", install)
                continue
            driver_maker(protocol)
            part_of(protocol, "simulated", Simulated)
        except GatewaySettingsError as error:
            yield MachineCheck(what, False, str(error), fix)
        else:
            yield MachineCheck(what, True, f"the package {kind.distribution} is installed")


def _open_gl() -> list[MachineCheck]:
    fix = "apt-get install libegl1 libgl1; everything but the renderer runs without it"
    try:
        from renderer.drawing.opengl import device_name, device_names, open_context
        from renderer.errors import RendererError
    except ImportError as error:
        return [MachineCheck("OpenGL", False, f"its packages are missing: {error}", fix)]
    try:
        context = open_context()
    except RendererError as error:
        return [MachineCheck("OpenGL", False, str(error), fix)]
    name = device_name(context)
    context.release()
    devices = device_names()
    listed = "; ".join(f"device {number}: {each}" for number, each in enumerate(devices))
    return [
        MachineCheck("OpenGL", True, f"off screen, by {name}" + (f" ({listed})" if len(devices) > 1 else ""))
    ]


def _page() -> list[MachineCheck]:
    from services.console.app import PAGE

    built = (PAGE / "index.html").exists()
    return [MachineCheck("page", built, "built" if built else "not built", "./dev up builds it")]


def _addresses(site: "Site") -> Iterator[MachineCheck]:
    """Yield whether each address of the site can be listened on, or a running site uses it."""
    metered = first_address(site, "")
    uses: list[tuple[str, str, int, Callable[[], bool]]] = [
        (
            f"router's {each}",
            *split_address(each.partition("/")[2].partition("?")[0]),
            partial(_is_router, each),
        )
        for each in map(reachable, site.listened)
    ]
    console = partial(_serves, f"{site.console.url}health", b'"mesh"')
    uses.append(("console's address", *split_address(site.console.listen), console))
    if metered is not None:
        host, _ = metered
        uses += [
            (
                f"metrics of {name}",
                host,
                port,
                partial(_serves, f"http://{host}:{port}/metrics", b"robomesh_"),
            )
            for name, port in ports(metered).items()
        ]
    for what, host, port, is_ours in uses:
        if is_absent(host):
            text, fix = "is not this machine's address now", "bring its network up, or correct the site file"
            yield MachineCheck(what, False, f"{host}:{port} {text}", fix)
            continue
        try:
            check_free(what, host, port, _OTHER)
        except UnavailableError as error:
            ours = is_ours()
            yield MachineCheck(
                what,
                ours,
                f"{host}:{port} is used by a running site" if ours else str(error).partition(". End")[0],
                _END,
            )
        else:
            yield MachineCheck(what, True, f"{host}:{port} is free")


def _is_router(endpoint: str) -> bool:
    """Return whether a Zenoh router answers at the endpoint, by TCP or, with `--keys`, by TLS."""
    from robomesh.errors import RobomeshError
    from services.command_line.terminal import discovery

    async def answers() -> bool:
        async with asyncio.timeout(_ANSWER_S), discovery.attached(endpoint):
            return True

    try:
        return discovery.run(answers())
    except (RobomeshError, TimeoutError):
        return False


def _serves(url: str, mark: bytes) -> bool:
    """Return whether an answer with the mark comes from there."""
    # This looks who serves, not for whom its certificate is.
    context = ssl._create_unverified_context() if url.startswith("https") else None
    try:
        with urllib.request.urlopen(url, timeout=_ANSWER_S, context=context) as answer:
            return mark in answer.read(100_000)
    except (OSError, ValueError, http.client.HTTPException):
        return False


def _disk() -> list[MachineCheck]:
    free = shutil.disk_usage(".").free
    writable = os.access(".", os.W_OK)
    return [
        MachineCheck(
            "disk",
            writable and free > _FREE_BYTES,
            f"{free / 1e9:.1f} GB free here" + ("" if writable else ", and not writable"),
            "free space for recordings and the audit log: without audit no motion is allowed",
        )
    ]
