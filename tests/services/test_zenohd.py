"""zenohd in place of our router, started as `robomesh router --config-out` says, if it is installed."""

import asyncio
import re
import shutil
import socket
import subprocess
from contextlib import contextmanager

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.wire.session import SessionSettings, open_session
from services import router as service
from services.pki import Folder, site_keys
from tests.conftest import run
from tests.ports import free_port
from tests.site import robomesh, wait_until

SITE = "here"

pytestmark = pytest.mark.skipif(
    shutil.which("zenohd") is None, reason="there is no zenohd on PATH: cargo install zenohd"
)


@contextmanager
def zenohd(settings, folder):
    """Run zenohd with the command line of the printed instructions."""
    advice = service.write_config(settings, folder / "zenohd.json5")
    command = re.search(r"ZENOH_RUNTIME=.* zenohd --config \S+", advice)[0]
    process = subprocess.Popen(
        ["/bin/sh", "-c", f"exec env {command}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        wait_until(lambda: listens(settings.listen[0]), what="zenohd does not listen")
        yield
        assert process.poll() is None, f"zenohd ended with {process.returncode}"
    finally:
        process.kill()
        process.wait()


def listens(endpoint):
    try:
        socket.create_connection(("127.0.0.1", int(endpoint.rpartition(":")[2]))).close()
    except ConnectionRefusedError:
        return False
    return True


def test_late_joiners_are_answered_and_nobody_reads_the_admin_space(tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    mesh = SessionSettings(connect=(endpoint,), wait_s=30.0)

    async def main():
        async with open_session(mesh) as sender, open_session(mesh) as receiver:
            publisher = sender.declare_publisher(SITE, "arm", "joints")
            message = JointStates()
            message.joints.add(name="joint_1", position=0.5)
            publisher.put(message)
            async for sample in receiver.subscribe(f"robomesh/{SITE}/arm/joints"):
                assert sample.message().joints[0].position == 0.5
                break
            assert not await asyncio.to_thread(
                list, receiver.zenoh_session.get("@/*/router/**", timeout=30.0)
            )

    with zenohd(service.Settings(listen=(endpoint,)), tmp_path):
        run(main())


def test_it_keeps_the_rules_that_our_router_keeps(tmp_path):
    folder, endpoint = Folder(tmp_path / "keys"), f"tls/127.0.0.1:{free_port()}"
    site_keys.prepare(folder, SITE, robots=["arm"], border="open", routers=[endpoint])
    settings = service.Settings(
        site=SITE, listen=(endpoint,), tls=folder.tls_of("router"), access=folder.access
    )
    with zenohd(settings, tmp_path):
        matrix = robomesh("doctor", "--security", "--folder", str(folder.path), timeout_s=60.0)
    assert matrix.returncode == 0, matrix.stdout + matrix.stderr
