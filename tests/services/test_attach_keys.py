"""Bridges with certificates: each has exactly the rights of its role."""

import asyncio
from contextlib import asynccontextmanager

import pytest
import zenoh
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.contract.endpoints import bundle, client_config, router_config
from robomesh.contract.topics import Role
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.presence import MONITOR
from robomesh.wire.session import SessionSettings, open_session
from services.pki import Folder, site_keys
from services.ros2.service import serve as serve_ros2
from services.ros2.settings import Settings as Ros2Settings
from services.router.router import read_access
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import until
from tests.services.foxglove_client import attached
from tests.services.test_foxglove import ARM, bridge, joints


@pytest.fixture(scope="module")
def secured(tmp_path_factory):
    """Return the keys and the router of a running site."""
    folder = Folder(tmp_path_factory.mktemp("site") / "keys")
    site_keys.prepare(folder, "hall", robots=["arm"], border="open", routers=[])
    site_keys.issue(folder, "mo", Role.MONITOR)
    site_keys.issue(folder, "li", Role.OPERATOR)
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with zenoh.open(router_config((endpoint,), (), folder.tls_of("router"), read_access(folder.access))):
        yield folder, endpoint


def mesh_of(endpoint, file):
    return SessionSettings(connect=(endpoint,), tls=bundle(file), wait_s=5.0)


@asynccontextmanager
async def hall(secured):
    """Run the site's gateway, with its certificate."""
    folder, endpoint = secured
    async with open_session(mesh_of(endpoint, folder.service("gateway"))) as session:
        session.declare_presence("hall", "arm", "gateway")
        yield session


async def test_a_monitors_certificate_reads_everything_and_commands_nothing(secured):
    folder, endpoint = secured
    mo = mesh_of(endpoint, folder.person("mo"))
    async with hall(secured) as robot, bridge(mo, operator="mo.hall") as address:
        states = robot.declare_publisher("hall", "arm", "joints")
        async with attached(address) as client:
            await client.subscribe(f"{ARM}/joints")
            await client.until(lambda: states.watched)
            states.put(joints(0.5))
            assert (await client.first(f"{ARM}/joints", JointStates)).joints[0].position == 0.5
            answer = await client.call(f"{ARM}/home")
            assert not answer["accepted"]
            assert answer["code"] == "request.no_right"
        who, _ = await robot.present_sessions()
        assert ("hall", MONITOR) in {(each.site, each.service) for each in who}


async def test_an_operators_certificate_requests_only_in_its_own_name(secured):
    folder, endpoint = secured
    li = mesh_of(endpoint, folder.person("li"))
    asked = []

    async def lease(request):
        asked.append(request.chunk)
        return schema.LeaseAnswer(lease="secret")

    async def command(request):
        return schema.CommandAnswer(accepted=True, text="on its way")

    async with hall(secured) as robot:
        robot.answer("hall", "arm", "lease/request/*", lease)
        robot.answer("hall", "arm", "command/*", command)
        for operator, accepted in (("wang.hall", False), ("li.hall", True)):
            async with bridge(li, operator=operator) as address, attached(address) as client:
                answer = await client.call(f"{ARM}/speed", speed_percent=10)
                assert answer["accepted"] is accepted, answer
                assert accepted or "another name" in answer["text"]
        assert set(asked) == {"li.hall"}


async def test_only_the_ros2_certificate_publishes_to_ros_nodes(secured, tmp_path):
    folder, endpoint = secured
    got, forged = [], "0/joint_states/forged"
    node = mesh_of(endpoint, folder.service("ros2"))
    with (
        zenoh.open(client_config((endpoint,), bundle(folder.service("ros2")))) as ros,
        zenoh.open(client_config((endpoint,), bundle(folder.person("mo")))) as monitor,
        ros.declare_subscriber("0/joint_states/**", lambda sample: got.append(str(sample.key_expr))),
    ):
        async with hall(secured) as robot, open_session(node) as session:
            settings = Ros2Settings(shapes=tmp_path)
            serving = asyncio.create_task(serve_ros2(session, settings))
            try:
                states = robot.declare_publisher("hall", "arm", "joints")
                await until(lambda: states.watched)
                while not got:
                    monitor.put(forged, b"forged")
                    states.put(joints(0.5))
                    await asyncio.sleep(0.05)
                states.put(joints(0.5))
                before = len(got)
                while len(got) <= before + 1:
                    monitor.put(forged, b"forged")
                    states.put(joints(0.5))
                    await asyncio.sleep(0.05)
                assert forged not in got
                assert not serving.done()
            finally:
                serving.cancel()
                await asyncio.gather(serving, return_exceptions=True)
