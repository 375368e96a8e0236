"""The service: listens for Foxglove and Lichtblick."""

import asyncio
import logging
import ssl
from collections.abc import Callable

from robomesh.keys import check_chunk
from robomesh.linked_site import be_present
from robomesh.session import Session
from services.errors import ListenError
from services.foxglove.bridge import Bridge
from services.foxglove.commands import Commands
from services.foxglove.listener import Door, hidden_address
from services.foxglove.settings import Settings
from services.site_file.listen_address import check_reach, is_loopback, split_address

log = logging.getLogger(__name__)

SERVICE = "foxglove"
# Who comes and goes at the SDK, with or without a farewell, and on which hidden address, is nobody's news.
_SDK_LOG = "foxglove.websocket"


async def serve(
    session: Session, settings: Settings, *, on_ready: Callable[[str], None] | None = None
) -> None:
    """Serve until cancelled.

    Args:
        on_ready: Told the address, once clients can attach.

    Raises:
        ListenError: If it cannot listen there, or may not.
    """
    host, port = split_address(settings.listen)
    tls = _tls(settings)
    commanded = is_loopback(host)
    if not (commanded or tls or settings.insecure):
        raise ListenError(
            f"foxglove would listen on {host}, which others can reach, without TLS: give it --certificate "
            "PEM, listen on 127.0.0.1, or say --insecure"
        )
    if warning := check_reach("foxglove", host, secured=tls is not None, insecure=True):
        log.warning("%s", warning)
    if settings.operator:
        check_chunk(settings.operator)
        if not commanded:
            raise ListenError(
                f"foxglove would take commands on {host}, and knows no users: they are offered on loopback "
                "only; leave --operator away, or listen on 127.0.0.1"
            )
    bridge = Bridge(session, settings)
    commands = Commands(session, settings.operator, bridge.channels.watches) if commanded else None
    logging.getLogger(_SDK_LOG).setLevel(logging.CRITICAL)
    hidden = hidden_address()
    server = bridge.start(hidden, name=_name(settings, commanded=commanded), commands=commands)
    try:
        door = Door(hidden, server.port, settings.origins)
        session.measure("foxglove_clients", "Foxglove clients that are attached", lambda: door.inside)
        session.measure("foxglove_watched", "Channels that somebody watches", lambda: bridge.channels.watched)
        async with door.open(host, port, tls) as bound:
            shown = f"[{host}]" if ":" in host else host
            address = f"{'ws' if tls is None else 'wss'}://{shown}:{bound}"
            log.info("foxglove %s", address)
            if on_ready is not None:
                on_ready(address)
            async with asyncio.TaskGroup() as group:
                group.create_task(be_present(session, SERVICE, site=settings.site, metrics=settings.metrics))
                group.create_task(bridge.follow_presence())
                group.create_task(bridge.follow_descriptions())
    finally:
        if commands is not None:
            await commands.close()
        bridge.channels.close()
        await asyncio.to_thread(server.stop)


def _name(settings: Settings, *, commanded: bool) -> str:
    """What clients show of the server: what may be asked through it."""
    if not commanded:
        return "robomesh (read-only: commands are offered on loopback only)"
    if not settings.operator:
        return "robomesh (stop only: commands need --operator)"
    return f"robomesh (commands in the name of {settings.operator})"


def _tls(settings: Settings) -> ssl.SSLContext | None:
    """TLS as the settings have it; None: none.

    Raises:
        ListenError: If a file cannot be used.
    """
    if settings.certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(settings.certificate, settings.private_key)
    except (OSError, ssl.SSLError) as error:
        raise ListenError(
            f"foxglove: {settings.certificate} cannot be used as its certificate, with "
            f"{settings.private_key or 'the key in it'}: {error.strerror or error}"
        ) from None
    return context
