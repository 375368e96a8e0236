"""A refusal has the same code in the reply, the audit log, the events and the state."""

import json

import pytest

from protocol_gateway.audit.log import read_entries
from robomesh.errors import RefusedError
from tests.protocol_gateway.gateway_site import A, C, gateway, simulator, until


async def held_code(site, command, **values):
    """Return the reason of a refusal; acquire the lease again if it expired on a busy machine."""
    await site.lease(A.ACQUIRE, lease=site.secret)
    return await code(site.command(command, **values))


async def code(awaitable):
    """Return the reason of a refusal."""
    with pytest.raises(RefusedError) as refused:
        await awaitable
    return refused.value.reason


async def test_reply_audit_entry_event_and_state_have_the_same_code(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        linked = await until(lambda: site.events("link.up"))
        assert linked[0].reason.code == "link.connected"
        assert (await code(site.command(C.HOME))).code == "lease.none"
        assert (await code(site.lease(A.RENEW))).code == "lease.none"
        await site.home()
        await site.lease(A.ACQUIRE, lease=site.secret)
        found = await code(site.lease(A.ACQUIRE, operator="wang"))
        assert (found.code, found.values) == ("lease.held", {"holder": "li"})

        found = await held_code(site, C.MOVE_ABSOLUTE, joint_positions=[9.0, 0, 0, 0, 0])
        assert (found.code, found.causes[0].code) == ("joints.outside", "joints.limit")
        assert found.causes[0].values == {"name": "waist", "value": "515.66°", "limit": "150.00°"}
        assert found.text.startswith("Not sent: joint waist at 515.66°")
        assert (await held_code(site, C.MOVE_ABSOLUTE)).values["joints"] == "5"
        assert (await held_code(site, C.SPEED, speed_percent=101)).values == {"value": "101"}

        stopped = await site.stop(by="chen", reason="smoke")
        assert (stopped.reason.code, stopped.reason.values["id"]) == ("stop.sent", str(stopped.stop_id))
        found = await held_code(site, C.HOME)
        assert (found.code, found.values["reason"]) == ("stop.latched", "smoke")

        await site.lease(A.ACQUIRE, lease=site.secret)
        await site.lease(A.RELEASE, reason="lunch")
        ended = await until(lambda: site.seen["lease"][-1].ended_reason.code and site.seen["lease"][-1])
        assert ended.ended_reason.code == "lease.ended.released_why"
        assert dict(ended.ended_reason.values) == {"name": "li", "reason": "lunch"}
        await until(lambda: ended.ended_reason in [each.reason for each in site.events("lease.ended")])

        entries = list(read_entries(site.audit))
        refused = [each.reason.code for each in entries if each.outcome == "REFUSED"]
        assert refused == [
            *("lease.none", "lease.none", "lease.held", "joints.outside", "joints.count"),
            *("speed.outside", "stop.latched"),
        ]
        await until(lambda: len(site.seen["audit"]) == len(entries))
        assert [each.reason.code for each in site.seen["audit"]] == [
            "" if each.reason is None else each.reason.code for each in entries
        ]
        lines = [json.loads(line) for line in site.audit.read_text().splitlines()]
        assert [each["why"]["code"] for each in lines if each["outcome"] == "REFUSED"] == refused


async def test_the_state_has_nested_reasons(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port, stop_proven=False) as site:
        await until(lambda: site.controller.read_only)
        connected, why = site.controller.link_reasons
        assert (connected.code, connected.values["where"]) == ("link.connected", f"127.0.0.1:{port}")
        assert (why.code, why.causes[0].code) == ("robot.is_read_only", "robot.stop_not_proven")
        found = await code(site.lease(A.ACQUIRE))
        assert (found.code, found.causes[0].code) == ("robot.read_only", "robot.stop_not_proven")
