"""`import robomesh` with a certificate: what it may read and control, and why a router refuses it."""

import asyncio
import contextlib
import re
import socket
import threading
import time
from datetime import UTC, datetime, timedelta

import pytest
import zenoh

import robomesh
from robomesh.contract.certificate_identity import read_identity
from robomesh.contract.endpoints import router_config
from robomesh.contract.topics import Role
from robomesh.wire.session import Session
from services.pki import Folder, site_keys
from tests.ports import free_port
from tests.site import ONE_ARM, lean, running_file, site_file, wait_until
from tests.site import robomesh as command

pytestmark = pytest.mark.processes

# A hang; a refusal takes some seconds, and a busy machine some more.
HANGS_S = 60.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Yield the keys of a running site: of li, an operator, mo, a monitor, and two that do not count."""
    port, page = free_port(), f"127.0.0.1:{free_port()}"
    path = site_file(
        tmp_path_factory.mktemp("site"), robots=ONE_ARM, router=f"tls/127.0.0.1:{port}", console=page
    )
    keys = Folder(path.parent / "keys")
    for words in (
        ("init", str(path)),
        ("issue", "li", "--role", "operator", "--folder", str(keys.path)),
        ("issue", "mo", "--role", "monitor", "--folder", str(keys.path)),
        ("issue", "gone", "--role", "operator", "--folder", str(keys.path)),
        ("revoke", "gone", "--folder", str(keys.path)),
    ):
        made = command("keys", *words)
        assert made.returncode == 0, made.stderr
    site_keys.issue(keys, "brief", Role.OPERATOR, lifetime=timedelta(seconds=1))
    with running_file(path, f"tls/127.0.0.1:{port}", page, **lean(())):
        yield keys


@pytest.fixture(scope="module")
def router(folder):
    return site_keys.principals_of(folder).routers[0]


@pytest.fixture
def robot(folder):
    """Return a function that returns the arm as a person's program sees it, connected by the bundle alone."""
    opened = []

    def robot_of(name):
        mesh = robomesh.connect(keys=folder.person(name), timeout_s=20.0)
        opened.append(mesh)
        # The site's services start one after the other.
        wait_until(lambda: any(each.last("description") and each.last("lease") for each in mesh.robots()))
        return mesh.robot("arm")

    yield robot_of
    for mesh in opened:
        mesh.close()


def test_a_router_that_has_just_started_may_show_nothing_at_first(folder, router, monkeypatch):
    shown = []
    present = Session.present

    async def nothing_at_first(session, **settings):
        shown.append(len(shown) and await present(session, **settings))
        return shown[-1]

    monkeypatch.setattr(Session, "present", nothing_at_first)
    with robomesh.connect(router, keys=folder.person("mo"), timeout_s=20.0):
        assert len(shown) == 2
        assert shown[1]


def test_an_operators_program_controls_in_the_name_of_its_certificate(robot):
    arm_robot = robot("li")
    assert len(next(arm_robot.joints()).positions) == 5
    with arm_robot.control() as arm:
        assert arm.operator == "li.test"
        arm.home()
        leases = arm_robot.topic("lease")
        wait_until(lambda: next(leases).message.holder == "li.test")
        arm_robot.stop("a trial")
        wait_until(lambda: arm_robot.last("controller").message.stop.by == "li.test")
        arm.reset()


def test_an_operators_program_controls_in_no_other_name(robot):
    with pytest.raises(robomesh.RefusedError, match=r"li\.test.* carries another name") as refused:
        robot("li").control("ops").__enter__()
    assert refused.value.code == "request.no_right"
    assert refused.value.reason.causes[0].code == "right.name"


def test_a_monitors_program_reads_and_does_not_control(robot):
    arm_robot = robot("mo")
    assert len(next(arm_robot.joints()).positions_deg) == 5
    assert arm_robot.forward([0.0] * 5)
    for name in ("", "li.test"):
        with pytest.raises(robomesh.RefusedError, match=r"only .*operator.* may") as refused:
            arm_robot.control(name).__enter__()
        assert refused.value.code == "request.no_right"
        assert refused.value.reason.causes[0].code == "right.role"
    assert not arm_robot.last("lease").message.holder


def test_an_asynchronous_program_reads_with_a_certificate(folder, router):
    async def main():
        async with robomesh.connect_async(router, keys=folder.person("mo"), timeout_s=20.0) as mesh:
            async for state in (await mesh.robot("arm")).joints():
                return len(state.positions)
            return None

    assert asyncio.run(main()) == 5


# ------------------------------------------------------------------- refusals


def refused(router, keys):
    """Return the one line with which a connection is refused."""
    began = time.monotonic()
    with pytest.raises(robomesh.SessionError) as error:
        robomesh.connect(router, keys=keys, timeout_s=1.0)
    assert time.monotonic() - began < HANGS_S
    assert error.value.__suppress_context__ or error.value.__context__ is None
    text = str(error.value)
    assert len(text.splitlines()) == 1
    return text


def parts(bundle):
    """Return the head, the key, the certificate and the authority's certificate of a bundle."""
    text = bundle.read_text()
    head = text.partition("-----BEGIN")[0]
    return head, *re.findall(r"-----BEGIN.*?-----END[^\n]*\n", text, re.DOTALL)


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    """Return the keys of another site, with an operator of the same name."""
    keys = Folder(tmp_path_factory.mktemp("stranger") / "keys")
    site_keys.prepare(keys, "elsewhere", robots=["arm"], border="open", routers=[])
    site_keys.issue(keys, "li", Role.OPERATOR)
    return keys


def test_a_file_that_is_no_bundle_is_refused_at_once(folder, stranger, router, tmp_path, caplog):
    head, key, certificate, ca = parts(folder.person("li"))
    damaged = certificate.replace(certificate[100:140], "A" * 40)
    foreign_key = parts(stranger.person("li"))[1]
    for text, why in (
        (None, "cannot be read: No such file"),
        ("", "holds no certificate and no key"),
        ("hello\n", "holds no certificate and no key"),
        (key + certificate + ca, "names no owner"),
        (re.sub("Expires: .*", "Expires: soon", head) + key + certificate + ca, "names no owner"),
        (re.sub("Expires: .*", "Expires: 2001-01-01", head) + key + certificate + ca, "expired on 2"),
        (head + "-----BEGIN", "a part is missing or damaged"),
        (head + key + damaged + ca, "a part is missing or damaged"),
        (head + certificate + ca, "a part is missing or damaged"),
        (head + foreign_key + certificate + ca, "the key is of another certificate"),
    ):
        file = tmp_path / "bundle.pem"
        if text is not None:
            file.write_text(text)
        # A router that answers is not needed to find it.
        for each in (router, f"tls/127.0.0.1:{free_port()}"):
            found = refused(each, file)
            assert found.startswith(str(file))
            assert why in found
    assert caplog.text == ""


def test_a_certificate_that_the_router_does_not_accept_is_refused_with_the_reason(
    folder, stranger, router, tmp_path, caplog
):
    brief = folder.person("brief")
    wait_until(lambda: read_identity(brief).expires < datetime.now(UTC))
    assert "expired on" in refused(router, brief)
    head, key, certificate, _ = parts(stranger.person("li"))
    ours = parts(folder.person("li"))[3]
    for name, text, why in (
        ("edited", re.sub("Expires: .*", "Expires: 2999-01-01T00:00:00Z", brief.read_text()), "has expired"),
        ("other", stranger.person("li").read_text(), "did not sign"),
        ("mixed", head + key + certificate + ours, "another site's authority signed it"),
        ("gone", folder.person("gone").read_text(), "revoked"),
    ):
        file = tmp_path / f"{name}.pem"
        file.write_text(text)
        found = refused(router, file)
        assert why in found
    assert caplog.text == ""


def test_an_address_that_does_not_fit_the_certificate_is_refused_with_the_reason(folder, router, caplog):
    li = folder.person("li")
    assert "keys=FILE" in refused(router, None)
    assert "keys=FILE" in refused(router.replace("tls/", "tcp/"), None)
    assert "a certificate needs TLS" in refused(router.replace("tls/", "tcp/"), li)
    assert "no router is named" in refused("", li)
    assert "no router at" in refused(f"tls/127.0.0.1:{free_port()}", li)
    plain = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(router_config((plain,))):
        reason = refused(plain.replace("tcp/", "tls/"), li)
        # The latter with OpenSSL 3.5: its first message is longer.
        assert re.search("(does not answer|ends them): name the port of a router with TLS", reason)
    assert caplog.text == ""


def test_a_port_that_ends_a_handshake_is_described_as_one_without_tls(folder):
    def end_connections():
        with contextlib.suppress(OSError):
            while True:
                listening.accept()[0].close()

    with socket.create_server(("127.0.0.1", 0)) as listening:
        serving = threading.Thread(target=end_connections)
        serving.start()
        reason = refused(f"tls/127.0.0.1:{listening.getsockname()[1]}", folder.person("li"))
        listening.shutdown(socket.SHUT_RDWR)
        serving.join(10)
    assert "accepts connections, but ends them: name the port of a router with TLS" in reason


def test_a_router_that_ends_during_the_connection_is_reported_as_such(stranger, monkeypatch):
    endpoint = f"tls/127.0.0.1:{free_port()}"
    router = zenoh.open(router_config((endpoint,), tls=stranger.tls_of("router")))
    present = Session.present

    async def present_without_a_router(session):
        await asyncio.to_thread(router.close)
        return await present(session)

    monkeypatch.setattr(Session, "present", present_without_a_router)
    assert "closed the connection or is restarting" in refused(endpoint, stranger.person("li"))
