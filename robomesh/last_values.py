"""Last values of a topic across the mesh: one query, a reply from each publisher."""

import asyncio

import zenoh
from google.protobuf.message import Message

from robomesh import keys
from robomesh.endpoints import settle
from robomesh.errors import MessageError
from robomesh.ignored import REPLY
from robomesh.messages import decode
from robomesh.session import Session
from robomesh.topics import topic


async def last_values(session: Session, key_expr: str, *, timeout_s: float = 1.5) -> dict[str, Message]:
    """Return the last value of every publisher that answers, by key; the history message if there is one.

    Args:
        key_expr: Key expression of one topic, as in `robomesh/*/-/alarms`.
        timeout_s: Time to wait for publishers that do not answer; returns early when all have answered.
    """
    row = topic(keys.parse_expression(key_expr).topic)
    schema = row.history_schema or row.schema
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()
    found: dict[str, bytes] = {}

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None and session.ignored.key(REPLY, key := str(reply.ok.key_expr)) is not None:
            found[key] = reply.ok.payload.to_bytes()

    def finish() -> None:
        if not done.done():
            done.set_result(None)

    def on_end() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(finish)

    await asyncio.to_thread(settle, session.zenoh_session, row.priority)
    session.zenoh_session.get(
        key_expr,
        zenoh.handlers.Callback(on_reply, on_end),
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        congestion_control=zenoh.CongestionControl.DROP,
        priority=getattr(zenoh.Priority, row.priority.value),
        timeout=timeout_s,
    )
    await done
    values: dict[str, Message] = {}
    for key, payload in sorted(found.items()):
        try:
            values[key] = decode(schema, payload)
        except MessageError:
            continue  # another program's invalid payload
    return values
