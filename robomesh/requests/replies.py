"""Replies to a Zenoh query as an asyncio future."""

import asyncio
from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar

import zenoh

from robomesh import reason_codes as codes
from robomesh.contract.endpoints import first_line
from robomesh.contract.topics import Priority
from robomesh.errors import NoAnswerError

Read = TypeVar("Read")
Handler: TypeAlias = "zenoh.handlers.Callback[zenoh.Reply]"


def collect(
    send: Callable[[Handler], object], read: Callable[[zenoh.Reply], Read | None]
) -> asyncio.Future[list[Read]]:
    """Send a query and return a future for its replies, set after the last one or the timeout.

    Args:
        send: Sends the query with the handler that it gets.
        read: Returns what the future contains for a reply; None: nothing. Called on Zenoh's thread.
    """
    loop = asyncio.get_running_loop()
    done: asyncio.Future[list[Read]] = loop.create_future()
    found: list[Read] = []

    def on_reply(reply: zenoh.Reply) -> None:
        if (value := read(reply)) is not None:
            found.append(value)

    def finish() -> None:
        if not done.done():
            done.set_result(found)

    def on_end() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(finish)

    send(zenoh.handlers.Callback(on_reply, on_end))
    return done


def query(
    session: zenoh.Session,
    selector: str,
    read: Callable[[zenoh.Reply], Read | None],
    *,
    priority: Priority,
    timeout_s: float,
    **options: Any,
) -> asyncio.Future[list[Read]]:
    """Query every owner of a key and return a future for their replies; see `collect`.

    Args:
        options: Further arguments of `zenoh.Session.get`.

    Raises:
        NoAnswerError: If the query cannot be sent.
    """

    def send(handler: Handler) -> None:
        session.get(
            selector,
            handler,
            # By default Zenoh would query only one queryable that declares itself complete.
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            # The default, BLOCK, would delay joint states on a full link.
            congestion_control=zenoh.CongestionControl.DROP,
            priority=getattr(zenoh.Priority, priority.value),
            timeout=timeout_s,
            **options,
        )

    try:
        return collect(send, read)
    except zenoh.ZError as error:
        key = selector.partition("?")[0]
        raise NoAnswerError(codes.NOT_ASKED(key=key, detail=first_line(error))) from None
