"""What is on the mesh: robots by name, services, states; a session for one command."""

import asyncio
import getpass
import json
import re
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any, NamedTuple, TypeVar

from bus.keys import WHOLE_SITE
from bus.session import Session, SessionSettings, open_session
from services.errors import ServiceError

T = TypeVar("T")


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
    """A session for one command: it does not wait for a router."""
    async with open_session(SessionSettings(connect=(router,), wait_s=0.0)) as session:
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
        raise NoSuchRobotError(f"no robot {text!r} on the mesh; there are: {there}")
    raise NoSuchRobotError(f"{text!r} is at several sites; say which: {', '.join(map(str, found))}")


def print_json(value: Any) -> None:
    """One line of JSON."""
    print(json.dumps(value, ensure_ascii=False, allow_nan=False), flush=True)


def own_name() -> str:
    """The name under which this person asks: the account's, as a key can hold it."""
    try:
        account = getpass.getuser()
    except (KeyError, OSError):
        account = ""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", account).lstrip("_.-") or "operator"
