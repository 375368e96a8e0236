"""`doctor --security` on a running gateway: it finds wrong rules, and does no harm."""

import asyncio
import contextlib
import json

import pytest
import zenoh

from protocol_gateway import gateway
from protocol_gateway.audit.log import Outcome
from protocol_gateway.audit.search import Query, find
from robomesh.client.robot.robot import AsyncRobot
from robomesh.contract.endpoints import bundle, router_config
from robomesh.contract.topics import Role
from robomesh.wire.session import SessionSettings, open_session
from services.command_line.doctor import security
from services.pki import Folder, site_keys
from services.router.router import read_access
from tests.conftest import rest_is_long, run
from tests.ports import free_port

SITE, ARM = "hall", "robomesh/hall/arm"


@pytest.fixture
def folder(tmp_path):
    """Return the keys of a site with one robot, an operator and a monitor."""
    folder = Folder(tmp_path / "keys")
    site_keys.prepare(folder, SITE, robots=["arm"], border="open", routers=[], started=["lab"])
    site_keys.issue(folder, "li", Role.OPERATOR)
    site_keys.issue(folder, "mo", Role.MONITOR)
    return folder


def by_hand(folder):
    """Return rules with one wrong: a monitor may act as operator, and read the router's state."""
    sections = read_access(folder.access)
    rule = {
        "id": "by-hand",
        "permission": "allow",
        "flows": ["ingress", "egress"],
        "messages": ["query", "reply", "liveliness_token"],
        "key_exprs": [
            f"{ARM}/lease/request/li.hall",
            f"{ARM}/command/li.hall",
            f"{ARM}/alive/operator/li.hall.$*",
            "@/**",
        ],
    }
    sections["access_control"]["rules"].append(rule)
    sections["access_control"]["policies"].append({"subjects": ["mo.hall"], "rules": ["by-hand"]})
    return sections


def router_of(folder, sections):
    """Run a router with these rules, whose own state can be queried."""
    endpoint = f"tls/127.0.0.1:{free_port()}"
    config = router_config((endpoint,), (), folder.tls_of("router"), sections)
    config.insert_json5("adminspace", json.dumps({"enabled": True, "permissions": {"read": True}}))
    return endpoint, zenoh.open(config)


@contextlib.asynccontextmanager
async def gateway_of(folder, endpoint, audit_folder):
    robot = gateway.RobotSettings(
        name="arm", description="pt600", host="127.0.0.1", port=free_port(), stop_proven=True
    )
    settings = gateway.Settings(site=SITE, audit_folder=audit_folder, robots=(robot,))
    mesh = SessionSettings(connect=(endpoint,), tls=bundle(folder.service("gateway")), wait_s=20.0)
    async with open_session(mesh) as session:
        serving = asyncio.create_task(gateway.serve(session, settings))
        try:
            yield
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)


async def doctor_beside_control(folder, endpoint, audit_folder):
    """Return the doctor's exit status while an operator has and keeps control."""
    async with gateway_of(folder, endpoint, audit_folder):
        mesh = SessionSettings(connect=(endpoint,), tls=bundle(folder.person("li")), wait_s=20.0)
        async with open_session(mesh) as session, AsyncRobot(session, SITE, "arm").control("li.hall") as arm:
            probing = asyncio.create_task(asyncio.to_thread(security.run, folder, (endpoint,), False))
            while not probing.done():
                await arm.renew()
                await asyncio.wait((probing,), timeout=1.0)
            await arm.renew()
    return await probing


@pytest.mark.slow
@pytest.mark.parametrize("spoiled", rest_is_long(1, (False, True)), ids=["the rules", "a rule added by hand"])
def test_doctor_probes_leases_commands_tokens_and_router_keys_of_a_running_robot(
    folder, tmp_path, capsys, caplog, spoiled
):
    sections = by_hand(folder) if spoiled else read_access(folder.access)
    endpoint, router = router_of(folder, sections)
    with router:
        status = run(doctor_beside_control(folder, endpoint, tmp_path / "audit"), timeout_s=120.0)
    printed = capsys.readouterr().out
    wrong = [line for line in printed.splitlines() if line.startswith("WRONG")]
    expected = [
        f"WRONG: mo.hall can be present as {ARM}/alive/operator/li.hall.doctor-probe-mo-hall, and should not",
        "WRONG: mo.hall can ask @/**, and should not",
        f"WRONG: mo.hall can ask {ARM}/command/li.hall, and should not",
        f"WRONG: mo.hall can ask {ARM}/lease/request/li.hall, and should not",
    ]
    assert sorted(wrong) == (sorted(expected) if spoiled else [])
    assert status == int(spoiled)
    assert "without a running gateway: lab\n" in printed
    assert caplog.text == ""
    entries = find(tmp_path / "audit" / SITE / "arm.jsonl", Query(most=1000))
    assert {entry.request for entry in entries} == {"ACQUIRE", "RELEASE", "RENEW", "COMMAND"}
    probed = [entry for entry in entries if entry.request in ("RENEW", "COMMAND")]
    assert {entry.outcome for entry in probed} == {Outcome.REFUSED}
    assert {entry.operator for entry in probed} <= {"li.hall", "console.hall", "router.hall"}
