"""Requests that are rejected before evaluation are in the audit log, and nothing is sent."""

import asyncio
import json
import math

from protocol_gateway.audit.log import read_entries, verify
from robomesh.contract.messages import JSON, PROTOBUF
from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.gateway_site import C, gateway, simulator, until

MOVE = {"command": "MOVE_ABSOLUTE", "lease": "x", "id": "1"}


def asked(site, topic, payload, encoding=JSON):
    """Send arbitrary bytes as a request; return the refusal."""
    replies = site.session.zenoh_session.get(site.key(topic), payload=payload, encoding=encoding)
    return [reply.err.payload.to_string() for reply in replies if reply.err is not None]


CASES = [
    ("command/li", json.dumps({**MOVE, "joint_positions": [0, "NaN"]}), "request.field_not_finite"),
    ("command/li", '{"lease": "x"}', "request.field_unset"),
    ("command/li", '{"command": "DANCE"}', "request.field_not_one_of"),
    ("command/li", '{"command"', "request.not_json"),
    ("lease/request/li", '{"action": "ACQUIRE", "ttl_s": "NaN"}', "request.field_not_finite"),
    ("lease/request/li", "{}", "request.field_unset"),
    ("command/*", json.dumps(MOVE), "request.wildcard"),
    ("lease/request/*", '{"action": "ACQUIRE"}', "request.wildcard"),
    ("command/stop", json.dumps(MOVE), "key.operator_reserved"),
    ("command/李\x1b[1m", json.dumps(MOVE), "key.chunk"),
    ("lease/request/" + "o" * 300, '{"action": "ACQUIRE"}', "key.chunk"),
]


async def test_a_request_rejected_before_evaluation_is_audited(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        for topic, payload, code in CASES:
            count = len(site.seen["audit"])
            (text,) = await asyncio.to_thread(asked, site, topic, payload.encode())
            (entry,) = await until(lambda count=count: site.seen["audit"][count:])
            reason = entry.reason.causes[0] if entry.reason.causes else entry.reason
            assert reason.code == code
            assert entry.request == ("LEASE" if topic.startswith("lease") else "COMMAND")
            assert entry.outcome == schema.AuditEntry.REFUSED
            assert entry.text == text
            assert entry.source == "mesh"
            assert len(entry.operator) <= 40
            assert entry.operator.isprintable()
            assert entry.operator.startswith(topic.rsplit("/", 1)[-1][:1])
        for message in (
            schema.CommandRequest(command=C.SPEED, speed_percent=math.inf),
            schema.CommandRequest(command=77),
        ):
            bytes_ = message.SerializeToString()
            assert await asyncio.to_thread(asked, site, "command/li", bytes_, PROTOBUF)
        assert await asyncio.to_thread(asked, site, "command/li", b"\xff\xff", PROTOBUF)
        every = len(CASES) + 3
        await until(lambda: sum(1 + entry.repeated_count for entry in site.seen["audit"]) == every)
        assert site.controller.counters.units_sent == 0
    assert verify(site.audit).ok


async def test_a_flood_of_unreadable_requests_is_counted(mesh, tmp_path):
    flood = 200
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        for _ in range(flood):
            await asyncio.to_thread(asked, site, "command/li", b"{")
    entries = [entry for entry in read_entries(site.audit) if entry.request == "COMMAND"]
    assert sum(1 + entry.repeated for entry in entries) == flood
    assert len(entries) < 40
