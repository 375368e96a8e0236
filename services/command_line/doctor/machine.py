"""`robomesh doctor`: checks of this machine, with fixes for what is missing."""

import asyncio
import http.client
import json
import os
import shutil
import socket
import sys
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass

import typer

from robomesh.extras import ADDED_IN_CHECKOUT, install_command, is_missing
from services.command_line.output import print_json, print_line
from services.command_line.site.services import SERVICES

# Extra -> packages that it installs.
_EXTRAS = {
    **{name: row.packages for name, row in SERVICES.items() if name != "router"},
    "simulator": ("ruckig",),
    "keys": ("cryptography",),
    "opcua": ("asyncua",),
    "foxglove": ("foxglove",),
    "ros2": ("rosbags",),
    "plots": ("matplotlib",),
    "step": ("cascadio",),
}
_FREE_BYTES = 1 << 30
# Timeout for a site that runs on this machine.
_ANSWER_S = 3.0


@dataclass(frozen=True)
class Finding:
    """The result of one check; `fix` says what to do if it failed."""

    what: str
    ok: bool
    text: str
    fix: str = ""


def run(as_json: bool = False) -> None:
    """Print every finding; exit status 1 when something is missing."""
    findings = [
        finding for check in (_python, _extras, _open_gl, _page, _ports, _disk) for finding in check()
    ]
    if as_json:
        rows = [{"what": each.what, "ok": each.ok, "text": each.text, "mend": each.fix} for each in findings]
        print_json({"ok": all(each.ok for each in findings), "findings": rows})
    for finding in () if as_json else findings:
        print_line(f"{'ok     ' if finding.ok else 'MISSING'}  {finding.what}: {finding.text}")
        if not finding.ok:
            print_line(f"         {finding.fix}")
    if not all(finding.ok for finding in findings):
        raise typer.Exit(1)


def _python() -> list[Finding]:
    version = ".".join(map(str, sys.version_info[:3]))
    return [Finding("Python", sys.version_info >= (3, 11), version, "install Python 3.11 or newer")]


def _extras() -> list[Finding]:
    findings = []
    for extra, packages in _EXTRAS.items():
        missing = [package for package in packages if is_missing(package)]
        fix, rare = install_command(extra), extra in ADDED_IN_CHECKOUT
        text = "its packages are installed" if not missing else f"no {', '.join(missing)}"
        if missing and rare:
            text = f"not installed; {fix} installs it"
        findings.append(Finding(f"{'part' if rare else 'role'} {extra}", rare or not missing, text, fix))
    return findings


def _open_gl() -> list[Finding]:
    fix = "apt-get install libegl1 libgl1; everything but the renderer runs without it"
    try:
        from renderer.errors import RendererError
        from renderer.opengl import device_name, device_names, open_context
    except ImportError as error:
        return [Finding("OpenGL", False, f"its packages are missing: {error}", fix)]
    try:
        context = open_context()
    except RendererError as error:
        return [Finding("OpenGL", False, str(error), fix)]
    name = device_name(context)
    context.release()
    devices = device_names()
    listed = "; ".join(f"device {number}: {each}" for number, each in enumerate(devices))
    return [Finding("OpenGL", True, f"off screen, by {name}" + (f" ({listed})" if len(devices) > 1 else ""))]


def _page() -> list[Finding]:
    from services.console.app import PAGE

    built = (PAGE / "index.html").exists()
    return [Finding("page", built, "built" if built else "not built", "./dev up builds it")]


def _ports() -> list[Finding]:
    findings = []
    for what, port in (("router's port", 7447), ("console's port", 8080)):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            free = _succeeds(lambda probe=probe, port=port: probe.bind(("127.0.0.1", port)))  # type: ignore[misc]
        ours = not free and (_is_router(port) if port == 7447 else _is_console(port))
        state = "is free" if free else "is used by a running site" if ours else "is taken by another program"
        fix = "end that program, or name another port in the site file"
        findings.append(Finding(what, free or ours, f"127.0.0.1:{port} {state}", fix))
    return findings


def _is_router(port: int) -> bool:
    """Return whether a Zenoh router answers on the port, by TCP or, with `--keys`, by TLS."""
    from robomesh.errors import RobomeshError
    from services.command_line import discovery

    async def answers() -> bool:
        async with asyncio.timeout(_ANSWER_S), discovery.attached(f"tcp/127.0.0.1:{port}"):
            return True

    try:
        return discovery.run(answers())
    except (RobomeshError, TimeoutError):
        return False


def _is_console(port: int) -> bool:
    """Return whether a console answers on the port."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=_ANSWER_S) as answer:
            return isinstance(json.loads(answer.read(100_000)), dict)
    except (OSError, ValueError, http.client.HTTPException):
        return False


def _disk() -> list[Finding]:
    free = shutil.disk_usage(".").free
    writable = os.access(".", os.W_OK)
    return [
        Finding(
            "disk",
            writable and free > _FREE_BYTES,
            f"{free / 1e9:.1f} GB free here" + ("" if writable else ", and not writable"),
            "free space for recordings and the audit log: without audit no motion is allowed",
        )
    ]


def _succeeds(attempt: Callable[[], None]) -> bool:
    try:
        attempt()
    except OSError:
        return False
    return True
