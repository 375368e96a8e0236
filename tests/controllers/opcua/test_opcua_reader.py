"""The process that reads OPC UA, against a server made from the OPC Foundation's nodeset of OPC 40010-1."""

import ast
import asyncio
import contextlib
import os
import signal
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import psutil
import pytest

import controllers.opcua.reader as reader
from controllers.opcua.certificate import make
from controllers.opcua.driver import OPCUA, OpcUaDriver
from controllers.opcua.facts import ItemsFound, Values, decode
from controllers.opcua.reader import process
from controllers.opcua.reader.problems import ReadingError, in_words
from controllers.opcua.reader.security import endpoints_of, offers_of
from controllers.opcua.reader.session import ALLOWED, ReadOnlyGuard
from controllers.opcua.settings import OpcUaJoint, OpcUaSettings, OpcUaSignal, to_text
from protocol_gateway.seam import JointsReceived
from robots.kinematics.joints import JointType
from tests.conftest import run
from tests.controllers.opcua.companion_server import companion_server
from tests.protocol_gateway.gateway_site import until

ROTARY = (JointType.ROTARY,)
CHANNEL = {"OpenSecureChannelRequest", "CloseSecureChannelRequest"}


@contextlib.asynccontextmanager
async def reading(port, **settings):
    """Read a server in this process; yield the decoded facts, and the task."""
    facts = []
    settings = OpcUaSettings(**{"path": "/cell", "security": "none", **settings})
    task = asyncio.create_task(
        process.read("127.0.0.1", port, settings, lambda line: facts.append(decode(line)))
    )
    try:
        yield facts, task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def ending(port, **settings):
    """Return why a server cannot be read."""
    async with reading(port, **settings) as (_, task):
        async with asyncio.timeout(30):
            await asyncio.wait([task])
        return in_words(task.exception())


def values_of(facts):
    """Return the last value of each item by its kind and name, None if it is not good."""
    (found,) = (each for each in facts if isinstance(each, ItemsFound))
    last = {}
    for fact in facts:
        for each in fact.readings if isinstance(fact, Values) else ():
            item = found.items[each.item]
            last[item.kind, item.name] = each.value if each.good else None
    return last


GATEWAY = """
import os, subprocess, sys, time
module = "controllers.opcua.reader.process"
child = subprocess.Popen([sys.executable, "-P", "-m", module, str(os.getpid()), *sys.argv[1:]],
                         stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
child.stdout.readline()
print(child.pid, flush=True)
time.sleep(600)
"""


async def killed_gateway(server):
    """Kill -9 a process with a reading process; wait until that has ended too, and closed its session."""
    closed = server.counts["CloseSessionRequest"]
    gateway = await asyncio.create_subprocess_exec(
        *(
            sys.executable,
            "-c",
            GATEWAY,
            "127.0.0.1",
            str(server.port),
            to_text(OpcUaSettings(path="cell", security="none")),
        ),
        stdout=asyncio.subprocess.PIPE,
    )
    child = psutil.Process(int(await gateway.stdout.readline()))
    gateway.send_signal(signal.SIGKILL)
    await gateway.wait()

    def ended():
        try:
            return child.status() == psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return True

    await until(ended)
    await until(lambda: server.counts["CloseSessionRequest"] > closed)


async def joints_of_driver(server):
    """Return the joints that a driver makes of the server."""
    driver = OpcUaDriver(ROTARY * 2, {}, options=OpcUaSettings())
    driver.opened(OPCUA, 0.0)
    events = []

    def write(line):
        for report in driver.received(OPCUA, line, asyncio.get_running_loop().time()):
            events.extend(report.events)

    task = asyncio.create_task(process.read("127.0.0.1", server.port, OpcUaSettings(security="none"), write))
    await until(lambda: task.done() or any(isinstance(each, JointsReceived) for each in events))
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    return next(each.positions for each in events if isinstance(each, JointsReceived))


@pytest.mark.slow
def test_motion_device_of_the_companion_specification_is_read_and_nothing_is_written(tmp_path):
    own, _ = own_certificate(tmp_path)

    async def scenario():
        async with companion_server(axes=2, speeds=True) as server:
            settings = {"security": "sign_and_encrypt", "server_certificate": "0" * 64, "certificate": own}
            refused = await ending(server.port, **settings)
            assert "offers no SignAndEncrypt with Basic256Sha256 or a newer policy" in refused
            async with reading(server.port) as (facts, task):
                await until(lambda: task.done() or len(facts) > 2)
                await server.set_positions((10.0, -20.0))
                await server.set("emergency_stop", True)
                await until(lambda: values_of(facts).get(("position", "Axis_2")) == -20.0)
                await until(lambda: values_of(facts)["emergency_stop", ""] is True)
                # A value that is not Good is unknown, Uncertain too.
                for status in (0x40000000, 0x80000000):
                    await server.set("position.1", 11.0, status=status)
                    await until(lambda: values_of(facts)["position", "Axis_1"] is None)
                    await server.set("position.1", 12.0)
                    await until(lambda: values_of(facts)["position", "Axis_1"] == 12.0)
                # Without any change, keep-alives go on.
                silent = len(facts)
                await until(lambda: len(facts) > silent + 2)
                assert not any(each.readings for each in facts[-2:])
            await server.set_positions((90.0, 45.0))
            assert await joints_of_driver(server) == (pytest.approx(1.5707963), pytest.approx(0.7853982))
            await killed_gateway(server)
            found = facts[0]
            items = {(each.kind, each.name): (each.unit.number, each.profile) for each in found.items}
            assert items["position", "Axis_1"] == (17476, 1)
            assert items["speed", "Axis_2"] == (4536630, 1)
            assert items["mass", ""] == (4933453, 0)
            last = values_of(facts)
            assert last["mode", ""] == 4.0
            assert last["program", ""] == "Weld"
            assert last["override", ""] == 80.0
            assert (last["manufacturer", ""], last["serial", ""]) == ("Somebody", "17")
            return server.counts

    counts = run(scenario())
    # Counted at the server: every service that was called.
    assert set(counts) <= ALLOWED | CHANNEL
    assert {"BrowseRequest", "ReadRequest", "PublishRequest"} <= set(counts)
    assert counts["CreateSessionRequest"] == counts["CloseSessionRequest"] == 3


@pytest.mark.slow
async def test_nodes_of_the_site_file_and_several_devices():
    async with companion_server(axes=1, devices=("Left", "Right")) as server:
        port = server.port
        assert "write device, one of Left, Right" in await ending(port)
        assert "no motion device 'Middle'; it has Left, Right" in await ending(port, device="Middle")
        node = server.nodes["position.1"].nodeid
        mapped = f"nsu=http://opcfoundation.org/UA/Robotics/;i={node.Identifier}"
        wrong = [OpcUaJoint(node="nsu=urn:absent;i=1", unit="deg")]
        assert "no namespace urn:absent" in await ending(port, device="Left", joints=wrong)
        absent = [OpcUaSignal(name="cell.absent", node="i=999999")]
        signals = [*absent, OpcUaSignal(name="cell.position", node=mapped)]
        joints = [OpcUaJoint(node=mapped, unit="deg")]
        async with reading(port, device="Left", joints=joints, signals=signals) as (facts, task):
            await until(lambda: task.done() or len(facts) > 1)
            await server.set("position.1", 30.0)
            await until(lambda: values_of(facts).get(("position", mapped)) == 30.0)
            await until(lambda: values_of(facts).get(("declared", "cell.position")) == 30.0)
            assert "it does not let be read: cell.absent: BadNodeIdUnknown" in facts[0].server


def own_certificate(folder):
    made = make(folder / "own.pem", datetime.now(UTC), timedelta(days=2))
    return str(folder / "own.pem"), made


@pytest.mark.slow
def test_security_pins_the_server_and_sends_the_password_encrypted(tmp_path):
    from asyncua import ua
    from asyncua.server.user_managers import User, UserRole

    own, made = own_certificate(tmp_path)
    # The server's key and certificate are of the same form.
    host = make(tmp_path / "server.pem", datetime.now(UTC), timedelta(days=2))
    password = tmp_path / "password"
    password.write_text("open sesame\n")
    password.chmod(0o600)

    class Users:
        def get_user(self, iserver, username=None, password=None, certificate=None, **_):
            # A channel is without a user; the certificate is checked by the channel itself.
            return User(role=UserRole.User) if (username, password) == ("reader", "open sesame") else None

    async def secure(server):
        await server.load_certificate(host.public)
        await server.load_private_key(tmp_path / "server.pem")
        server.set_security_policy(
            [
                ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
                ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
            ]
        )
        server.application_uri = host.uri

    async def scenario():
        async with companion_server(axes=1, security=secure, users=Users()) as server:
            port = server.port
            offers = offers_of(await endpoints_of(f"opc.tcp://127.0.0.1:{port}"))
            assert offers.fingerprints == {host.fingerprint}
            good = {
                "security": "sign_and_encrypt",
                "server_certificate": host.fingerprint,
                "certificate": own,
                "user": "reader",
                "password_file": str(password),
            }
            async with reading(port, **good) as (facts, task):
                await until(lambda: task.done() or len(facts) > 1)
                assert not task.done()
            wrong = await ending(port, **good | {"server_certificate": "0" * 64})
            assert f"has the fingerprint sha256:{host.fingerprint}, but the site file has sha256:000" in wrong
            assert "if they agree write it as server_certificate" in wrong
            password.write_text("guessed")  # keeps its mode
            assert "it refuses the user" in await ending(port, **good)
            password.chmod(0o644)
            assert "others may read it (mode 644): chmod 600" in await ending(port, **good)
            public = str(host.public)
            assert "not a certificate with its private key" in await ending(
                port, **good | {"certificate": public}
            )
            absent = str(tmp_path / "absent.pem")
            assert "no such file" in await ending(port, **good | {"certificate": absent})
            # This server offers no connection without security.
            assert "no connection with the site file's security" in await ending(port)

    run(scenario())
    assert made.fingerprint != host.fingerprint


def test_session_has_no_service_that_writes_or_calls():
    class WriteRequest:
        pass

    with pytest.raises(ReadingError, match="WriteRequest is not sent: the session only reads"):
        ReadOnlyGuard().observe_request(WriteRequest())
    assert not [
        name for name in ALLOWED if name.startswith(("Write", "Call", "HistoryUpdate", "Add", "Delete"))
    ]


def test_reader_names_nothing_that_writes_or_calls():
    forbidden = ("write_", "call_method", "set_value", "set_writable", "add_nodes", "delete_nodes")
    for file in Path(reader.__file__).parent.glob("*.py"):
        tree = ast.parse(file.read_text())
        used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        used |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        writes = {each for each in used if each.startswith(forbidden) or each in ("call", "write_value")}
        assert not writes, file
        asks = {
            node.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Attribute)
            and node.value.attr == "_session"
        }
        assert asks <= {"browse", "browse_next", "read", "create_subscription", "create_monitored_items"}, (
            file
        )


@pytest.mark.slow
def test_gateway_does_not_import_the_library():
    code = "import sys, protocol_gateway.gateway; sys.exit('asyncua' in sys.modules)"
    assert os.spawnv(os.P_WAIT, sys.executable, [sys.executable, "-c", code]) == 0
