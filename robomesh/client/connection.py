"""A program's connection to the mesh: addresses of routers, and its certificate."""

import asyncio
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

from robomesh.contract.certificate_identity import Identity, read_identity
from robomesh.contract.endpoints import DEFAULT_ROUTER, bundle
from robomesh.errors import NoAnswerError, SessionError
from robomesh.texts import split_commas
from robomesh.wire.session import Session, SessionSettings, open_session

# A router that has just started does not know itself yet.
_STARTING_S, _POLL_S = 1.0, 0.1


def own_identity(keys: Path | None) -> Identity | None:
    """Return the identity in a bundle of `robomesh keys`; None: no bundle.

    Raises:
        SessionError: If the file cannot be read, or is not a bundle.
    """
    if keys is None:
        return None
    identity = read_identity(keys)
    if identity is None:
        raise SessionError(f"{keys} names no owner: use a bundle that robomesh keys issue wrote")
    return identity


def connection_settings(
    routers: str | Sequence[str], keys: Path | None = None, *, wait_s: float | None = None
) -> SessionSettings:
    """Return session settings for a program.

    Args:
        routers: Addresses, also as one text with commas; the default address stands for the bundle's.
        keys: The program's bundle from `robomesh keys`: certificate and key.
        wait_s: How long to wait for a router [s]; None: forever.

    Raises:
        SessionError: If no router is named, the file is not a bundle, or a router is not reached by TLS.
    """
    named = split_commas(routers) if isinstance(routers, str) else tuple(routers)
    if not named:
        raise SessionError(f"no router is named: an address is {DEFAULT_ROUTER}")
    identity = own_identity(keys)
    if identity is None or keys is None:
        return SessionSettings(connect=named, wait_s=wait_s)
    if named == (DEFAULT_ROUTER,):
        named = identity.routers or (DEFAULT_ROUTER.replace("tcp/", "tls/"),)
    for each in named:
        if not each.startswith(("tls/", "quic/")):
            raise SessionError(f"{each}: a certificate needs TLS to the router: tls/HOST:PORT")
    return SessionSettings(connect=named, tls=bundle(keys), wait_s=wait_s)


@asynccontextmanager
async def connected(settings: SessionSettings) -> AsyncIterator[Session]:
    """Open a session whose certificate, if it has one, the router knows.

    Raises:
        SessionError: If no router answers, or the router shows nothing to the certificate.
    """
    async with open_session(settings) as session:
        # A router without rules for the name accepts the session and hides everything, itself too.
        if session.principal is not None:
            until_s = time.monotonic() + _STARTING_S
            try:
                while not await session.present():
                    if time.monotonic() > until_s:
                        raise SessionError(
                            f"the router shows {session.principal.name} nothing: its certificate was "
                            "revoked, or the router has not read this site's list yet (robomesh keys list)"
                        )
                    await asyncio.sleep(_POLL_S)
            except NoAnswerError as error:
                raise SessionError(f"the router closed the connection or is restarting: {error}") from None
        yield session
