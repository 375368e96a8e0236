"""What is on the mesh: robots by name, services, states; a session for one command."""

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
    """A robot somewhere on the mesh."""

    site: str
    name: str

    def __str__(self) -> str:
        return f"{self.site}/{self.name}"


class NoSuchRobotError(ServiceError):
    """A robot that is not on the mesh, or a name that several have."""


def run(main: Coroutine[Any, Any, T]) -> T:
    """Run a command's coroutine."""
    return asyncio.run(main)


@asynccontextmanager
async def attached(router: str) -> AsyncIterator[Session]:
    """A session for one command: it does not wait for a router.

    Raises:
        SessionError: If none is there, or it shows nothing to the certificate that was given.
    """
    async with open_session(attachment(router, wait_s=0.0)) as session:
        # A router that was told of no such name lets it in and keeps everything from it, itself too.
        if session.principal is not None and not await session.present():
            raise SessionError(
                f"the router shows {session.principal.name} nothing: its certificate was revoked, or the "
                "router does not follow this site's list yet (robomesh keys list)"
            )
        yield session


async def find(session: Session, text: str) -> Robot:
    """The robot that `robot` or `site/robot` means.

    Raises:
        NoSuchRobotError: If there is none, or `robot` stands at several sites.
    """
    alive = await session.present()
    robots = sorted({Robot(key.site, key.robot) for key in alive if key.robot != WHOLE_SITE})
    found = [robot for robot in robots if text in (robot.name, str(robot))]
    if len(found) == 1:
        return found[0]
    there = ", ".join(map(str, robots)) or "none"
    if not found:
        gone = sorted(gone_sites(await lists(session)).keys() - {key.site for key in alive})
        lost = f"; gone, with all of its robots: site {', site '.join(gone)}" if gone else ""
        raise NoSuchRobotError(f"no robot {text!r} on the mesh; there are: {there}{lost}")
    raise NoSuchRobotError(f"{text!r} is at several sites; say which: {', '.join(map(str, found))}")


def print_json(value: Any) -> None:
    """Print one line of JSON; control characters of direction are escaped, so that they act nowhere."""
    line = json.dumps(value, ensure_ascii=False, allow_nan=False)
    print(line.translate(_ESCAPED), flush=True)


def own_name() -> str:
    """The name under which this person asks: the certificate's, or the account's as a key can hold it."""
    identity = own_identity()
    if identity is not None:
        return identity.name
    try:
        account = getpass.getuser()
    except (KeyError, OSError):
        account = ""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", account).lstrip("_.-") or "operator"
