"""Last values of a topic across the mesh: one query, a reply from each publisher."""

import asyncio

import zenoh
from google.protobuf.message import Message

from robomesh.contract import keys
from robomesh.contract.endpoints import wait_until_declared
from robomesh.contract.ignored import REPLY
from robomesh.contract.messages import decode
from robomesh.contract.topics import topic
from robomesh.errors import MessageError
from robomesh.requests.replies import query
from robomesh.wire.session import Session


async def last_values(session: Session, key_expr: str, *, timeout_s: float = 1.5) -> dict[str, Message]:
    """Return the last value of every publisher that answers, by key; the history message if there is one.

    Args:
        key_expr: Key expression of one topic, as in `robomesh/*/-/alarms`.
        timeout_s: Time to wait for publishers that do not answer; returns early when all have answered.
    """
    row = topic(keys.parse_expression(key_expr).topic)
    schema = row.history_schema or row.schema

    def read(reply: zenoh.Reply) -> tuple[str, bytes] | None:
        if reply.ok is None or session.ignored.key(REPLY, key := str(reply.ok.key_expr)) is None:
            return None
        return key, reply.ok.payload.to_bytes()

    await asyncio.to_thread(wait_until_declared, session.zenoh_session, row.priority)
    found = await query(session.zenoh_session, key_expr, read, priority=row.priority, timeout_s=timeout_s)
    values: dict[str, Message] = {}
    for key, payload in sorted(dict(found).items()):
        try:
            values[key] = decode(schema, payload)
        except MessageError:
            continue  # another program's invalid payload
    return values
