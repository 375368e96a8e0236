"""A session for one command, robots by name, and JSON output."""

import asyncio
import getpass
import json
import re
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any, NamedTuple, TypeVar

from robomesh.errors import SessionError
from robomesh.keys import WHOLE_SITE
from robomesh.session import Session, open_session
from robomesh.texts import DIRECTION
from services.command_line.alarm_lists import gone_sites, lists
from services.command_line.connection_options import attachment, own_identity
from services.errors import ServiceError

T = TypeVar("T")

_ESCAPED = {ord(each): f"\\u{ord(each):04x}" for each in DIRECTION}


class Robot(NamedTuple):
    """A robot on the mesh."""

    site: str
    name: str

    def __str__(self) -> str:
        return f"{self.site}/{self.name}"


class NoSuchRobotError(ServiceError):
    """No robot on the mesh has the name, or several have it."""


def run(main: Coroutine[Any, Any, T]) -> T:
    """Run a command's coroutine."""
    return asyncio.run(main)


@asynccontextmanager
async def attached(router: str) -> AsyncIterator[Session]:
    """Open a session for one command, without waiting for a router.

    Raises:
        SessionError: If no router answers, or the router shows nothing to the certificate of `--keys`.
    """
    async with open_session(attachment(router, wait_s=0.0)) as session:
        # A router without rules for the name accepts the session and hides everything, itself too.
        if session.principal is not None and not await session.present():
            raise SessionError(
                f"the router shows {session.principal.name} nothing: its certificate was revoked, or the "
                "router has not read this site's list yet (robomesh keys list)"
            )
        yield session


async def find(session: Session, text: str) -> Robot:
    """Return the robot that `robot` or `site/robot` names.

    Raises:
        NoSuchRobotError: If there is none, or several sites have a robot of that name.
    """
    alive = await session.present()
    robots = sorted({Robot(key.site, key.robot) for key in alive if key.robot != WHOLE_SITE})
    found = [robot for robot in robots if text in (robot.name, str(robot))]
    if len(found) == 1:
        return found[0]
    known = ", ".join(map(str, robots)) or "none"
    if not found:
        gone = sorted(gone_sites(await lists(session)).keys() - {key.site for key in alive})
        lost = f"; gone, with all of its robots: site {', site '.join(gone)}" if gone else ""
        raise NoSuchRobotError(f"no robot {text!r} on the mesh; there are: {known}{lost}")
    raise NoSuchRobotError(f"{text!r} is at several sites; say which: {', '.join(map(str, found))}")


def print_json(value: Any) -> None:
    """Print one line of JSON, with direction characters escaped."""
    print(json_line(value), flush=True)


def json_line(value: Any) -> str:
    """Return a value as one line of JSON, with direction characters escaped."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False).translate(_ESCAPED)


def own_name() -> str:
    """Return the operator's name: the certificate's, else the account's with characters that a key allows."""
    identity = own_identity()
    if identity is not None:
        return identity.name
    try:
        account = getpass.getuser()
    except (KeyError, OSError):
        account = ""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", account).lstrip("_.-") or "operator"
