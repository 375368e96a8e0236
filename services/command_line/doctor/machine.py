"""`robomesh doctor`: what is missing on this machine, and how to mend it."""

import asyncio
import http.client
import importlib.util
import json
import os
import shutil
import socket
import sys
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass

import typer

from services.command_line.site.services import SERVICES

# Extra -> packages that it installs.
_EXTRAS = {
    **{name: row.packages for name, row in SERVICES.items() if row.packages},
    "simulator": ("ruckig",),
    "keys": ("cryptography",),
}
_FREE_BYTES = 1 << 30
# For a site that runs here to say so.
_ANSWER_S = 3.0


@dataclass(frozen=True)
class Finding:
    """One thing looked at; `mend` says what to do where it is not right."""

    what: str
    right: bool
    text: str
    mend: str = ""


def run(as_json: bool = False) -> None:
    """Print every finding; exit status 1 when something is missing."""
    findings = [finding for look in (_python, _roles, _open_gl, _page, _ports, _disk) for finding in look()]
    if as_json:
        rows = [
            {"what": each.what, "ok": each.right, "text": each.text, "mend": each.mend} for each in findings
        ]
        print(json.dumps({"ok": all(each.right for each in findings), "findings": rows}))
        findings_said: list[Finding] = []
    else:
        findings_said = findings
    for finding in findings_said:
        print(f"{'ok     ' if finding.right else 'MISSING'}  {finding.what}: {finding.text}")
        if not finding.right:
            print(f"         {finding.mend}")
    if not all(finding.right for finding in findings):
        raise typer.Exit(1)


def _python() -> list[Finding]:
    version = ".".join(map(str, sys.version_info[:3]))
    return [Finding("Python", sys.version_info >= (3, 11), version, "install Python 3.11 or newer")]


def _roles() -> list[Finding]:
    findings = []
    for role, packages in _EXTRAS.items():
        absent = [package for package in packages if importlib.util.find_spec(package) is None]
        findings.append(
            Finding(
                f"role {role}",
                not absent,
                "its packages are here" if not absent else f"no {', '.join(absent)}",
                f"pip install 'robomesh[{role}]', or ./dev up, which installs everything",
            )
        )
    return findings


def _open_gl() -> list[Finding]:
    mend = "apt-get install libegl1 libgl1; everything but the renderer runs without it"
    try:
        from renderer.errors import RendererError
        from renderer.opengl import open_context
    except ImportError as error:
        return [Finding("OpenGL", False, f"its packages are not here: {error}", mend)]
    try:
        context = open_context()
    except RendererError as error:
        return [Finding("OpenGL", False, str(error), mend)]
    name = context.info["GL_RENDERER"]
    context.release()
    return [Finding("OpenGL", True, f"off screen, by {name or 'a device without a name'}")]


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
        state = "is free" if free else "is a running site's" if ours else "is taken by another program"
        mend = "end that program, or name another port in the site file"
        findings.append(Finding(what, free or ours, f"127.0.0.1:{port} {state}", mend))
    return findings


def _is_router(port: int) -> bool:
    """Return whether a Zenoh router answers there, by TCP or, with this person's keys, by TLS."""
    from robomesh.errors import BusError
    from services.command_line import discovery

    async def answers() -> bool:
        async with asyncio.timeout(_ANSWER_S), discovery.attached(f"tcp/127.0.0.1:{port}"):
            return True

    try:
        return discovery.run(answers())
    except (BusError, TimeoutError):
        return False


def _is_console(port: int) -> bool:
    """Return whether a console's page answers there."""
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
            "recordings and the audit log need room: without audit no motion",
        )
    ]


def _succeeds(attempt: Callable[[], None]) -> bool:
    try:
        attempt()
    except OSError:
        return False
    return True
