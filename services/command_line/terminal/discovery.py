"""A session for one command, and robots by name."""

import asyncio
import getpass
import re
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any, NamedTuple, TypeVar

from robomesh.client.connection import connected
from robomesh.client.mesh import RobotNotFoundError, find_robot
from robomesh.wire.session import Session
from services.command_line.terminal.alarm_lists import gone_sites, lists
from services.command_line.terminal.connection_options import attachment, own_identity

T = TypeVar("T")


class RobotAddress(NamedTuple):
    """A robot on the mesh."""

    site: str
    name: str

    def __str__(self) -> str:
        return f"{self.site}/{self.name}"


def run(main: Coroutine[Any, Any, T]) -> T:
    """Run a command's coroutine."""
    return asyncio.run(main)


@asynccontextmanager
async def attached(router: str) -> AsyncIterator[Session]:
    """Open a session for one command, without waiting for a router.

    Raises:
        SessionError: If no router answers, or the router shows nothing to the certificate of `--keys`.
    """
    async with connected(attachment(router, wait_s=0.0)) as session:
        yield session


async def find(session: Session, text: str) -> RobotAddress:
    """Return the robot that `robot` or `site/robot` names.

    Raises:
        RobotNotFoundError: If there is none, or several sites have a robot of that name.
    """
    alive = await session.present()
    try:
        return RobotAddress(*find_robot(alive, text))
    except RobotNotFoundError as error:
        if not error.found:
            gone = gone_sites(await lists(session)).keys() - {key.site for key in alive}
            error.gone_sites = tuple(sorted(gone))
        raise


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
