"""Presence of a program that belongs to no site: at a configured site, or at the first one that it finds."""

import asyncio

from robomesh.contract.keys import WHOLE_SITE
from robomesh.contract.topic_schema import PEOPLE
from robomesh.service.health import Served, present
from robomesh.service.metrics import serve_metrics
from robomesh.wire.presence import MONITOR
from robomesh.wire.session import Session


async def be_present(
    session: Session, service: str, *, site: str = "", metrics: tuple[str, int] | None = None
) -> None:
    """Announce the program until cancelled.

    Args:
        site: The site to be present at; empty: the first one found.
        metrics: Host and port of the Prometheus endpoint; None: no endpoint.

    Raises:
        SessionError: If the metrics cannot be served at their address.
    """
    at = site or await _first_site(session)
    if session.principal is not None and session.principal.role in PEOPLE:
        # An operator's or monitor's certificate may not publish health.
        session.declare_presence(at, WHOLE_SITE, MONITOR)
        if metrics is not None:
            serve_metrics(session, *metrics, {"service": service, "site": at, "id": session.identity})
        await asyncio.Event().wait()
    served = Served(service=service, present_for=((at, WHOLE_SITE),), metrics=metrics)
    async with present(session, served):
        await asyncio.Event().wait()


async def _first_site(session: Session) -> str:
    watch = session.watch_presence()
    try:
        async for who, alive in watch:
            if alive:
                return who.site
    finally:
        watch.close()
    raise asyncio.CancelledError  # the session ends
