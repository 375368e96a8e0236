"""`robomesh probe` before simulated controllers, and before servers of others that are none."""

import asyncio
import contextlib
import http.server
import socket
import threading
from dataclasses import replace

import pytest

from controllers import probing
from controllers.probing import ProbeError
from services.command_line.doctor import probe
from services.command_line.doctor.probe import examine, probes
from tests.controllers.fanuc.ftp_site import controller as fanuc_by_ftp
from tests.controllers.fanuc.test_snpx_driver import controller as fanuc
from tests.controllers.opcua.test_opcua_driver import controller as opcua
from tests.controllers.universal_robots.test_rtde_driver import controller as universal_robots
from tests.controllers.yaskawa.test_hses_driver import controller as yaskawa
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import simulator


@contextlib.contextmanager
def server(*, says=b""):
    """Listen on a port; yield it, and all bytes that arrive there."""
    heard = bytearray()

    def serve():
        with contextlib.suppress(OSError), listening.accept()[0] as connection:
            connection.sendall(says)
            while data := connection.recv(4096):
                heard.extend(data)

    with socket.create_server(("127.0.0.1", 0)) as listening:
        serving = threading.Thread(target=serve)
        serving.start()
        yield listening.getsockname()[1], heard
    serving.join(10)


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(probing, "LISTEN_S", 0.5)


def at_ports(monkeypatch, **changed):
    """Let kinds be known at other ports."""
    known = probes()
    ours = {name: replace(each, **changed.get(name, {})) for name, each in known.items()}
    monkeypatch.setattr(probe, "probes", lambda: ours)


def examined(address):
    return asyncio.to_thread(examine, address)


async def test_the_unit_protocol_is_recognized_without_a_byte_sent():
    async with simulator(demo=True) as port:
        found = await examined(f"tcp://127.0.0.1:{port}")
    assert (found.protocol, found.sent) == ("unit", "nothing")
    assert "with 5 joints" in found.text


async def test_a_controller_of_universal_robots_is_recognized_by_its_answer(monkeypatch):
    async with universal_robots() as (rtde, primary):
        at_ports(monkeypatch, rtde={"ports": (rtde,), "listens": (primary,)})
        found = await examined(f"tcp://127.0.0.1:{rtde}")
        assert (found.protocol, found.sent) == ("rtde", "the request for RTDE version 2")
        assert "Universal Robots: RTDE, version 2" in found.text
        found = await examined(f"tcp://127.0.0.1:{primary}")
        assert (found.protocol, found.sent) == ("", "nothing")
        assert "Universal Robots' primary or secondary interface" in found.text


async def test_a_controller_of_yaskawa_is_recognized_by_its_answer(monkeypatch):
    async with yaskawa() as port:
        at_ports(monkeypatch, hses={"ports": (port,)})
        found = await examined(f"udp://127.0.0.1:{port}")
    assert found.protocol == "hses"
    assert "a controller of Yaskawa with HSES: model" in found.text


async def test_a_controller_of_fanuc_is_recognized_by_its_first_answer(monkeypatch):
    async with fanuc() as port:
        at_ports(monkeypatch, snpx={"ports": (port,)})
        found = await examined(f"tcp://127.0.0.1:{port}")
    assert (found.protocol, found.received_bytes) == ("snpx", 56)
    assert "56 zero bytes" in found.sent


async def test_a_controller_that_is_read_by_ftp_is_recognized_by_its_greeting(monkeypatch):
    async with fanuc_by_ftp() as port:
        at_ports(monkeypatch, **{"fanuc-ftp": {"listens": (port,)}})
        found = await examined(f"tcp://127.0.0.1:{port}")
    assert (found.protocol, found.sent) == ("fanuc-ftp", "nothing")
    assert "of a controller of FANUC: R-30iB FTP server ready." in found.text


@pytest.mark.parametrize(
    ("greeting", "protocol"),
    [
        # Of real controllers, as their users publish them.
        (b"220 R-30iB FTP server ready. [HandlingTool V8.20P/06]\r\n", "fanuc-ftp"),
        (b"220 R-30iB FTP server ready. [ArcTool V8.20P/24]\r\n", "fanuc-ftp"),
        (b"220 ROBOT FTP server ready.\r\n", "fanuc-ftp"),
        (b"220 ProFTPD 1.3.5 Server ready.\r\n", ""),
    ],
)
def test_an_ftp_server_is_heard_and_nothing_is_sent(monkeypatch, greeting, protocol):
    with server(says=greeting) as (port, heard):
        at_ports(monkeypatch, **{"fanuc-ftp": {"listens": (port,)}})
        found = examine(f"tcp://127.0.0.1:{port}")
    assert (found.protocol, found.sent, heard) == (protocol, "nothing", b"")
    assert "an FTP server" in found.text


@pytest.mark.slow
async def test_an_opc_ua_server_is_asked_for_its_endpoints_only():
    async with opcua() as port:
        found = await examined(f"opc.tcp://127.0.0.1:{port}")
    assert (found.protocol, found.sent) == ("opcua", "the request for its endpoints")
    assert "robomesh (simulated controller); no security" in found.text
    with pytest.raises(ProbeError, match="Connection refused"):
        await examined(f"opc.tcp://127.0.0.1:{port}")


def test_a_port_that_sends_first_is_not_asked_for_endpoints():
    with server(says=b"SSH-2.0-OpenSSH_9.2\r\n") as (port, heard):
        found = examine(f"opc.tcp://127.0.0.1:{port}")
    assert "sends something unknown: SSH-2.0" in found.text
    assert (found.protocol, found.sent, found.received_bytes, heard) == ("", "nothing", 21, b"")


@pytest.mark.parametrize("port", [30001, 30002, 30003, 30004, 30011, 16001, 60008, 18245])
def test_ports_of_other_protocols_are_not_contacted_for_endpoints(monkeypatch, port):
    monkeypatch.setattr(socket, "create_connection", lambda *given, **named: pytest.fail("contacted"))
    with pytest.raises(ProbeError, match=rf"another protocol: probe tcp://10\.0\.0\.7:{port}"):
        examine(f"opc.tcp://10.0.0.7:{port}")


def test_the_port_of_rmi_is_described_as_it_is_used(monkeypatch):
    with server() as (port, _):
        at_ports(monkeypatch, snpx={"listens": (port,)})
        found = examine(f"tcp://127.0.0.1:{port}")
    assert "moves by RMI if the site file says so" in found.next


@pytest.mark.parametrize(
    ("says", "words"), [(b"", "answers nothing"), (b"\x05" * 60, "sends something unknown")]
)
def test_to_the_ports_of_snpx_nothing_is_sent_but_56_zero_bytes(monkeypatch, says, words):
    monkeypatch.setattr(probing, "ANSWER_S", 0.5)
    with server(says=says) as (port, heard):
        at_ports(monkeypatch, snpx={"ports": (port,)})
        found = examine(f"tcp://127.0.0.1:{port}")
    assert found.protocol == ""
    assert words in found.text
    assert heard == (b"" if says else bytes(56))


@pytest.mark.parametrize("name", ["rtde", "snpx", None])
def test_to_ports_that_move_an_arm_and_to_unknown_ones_nothing_is_sent(monkeypatch, name):
    with server() as (port, heard):
        if name is not None:
            at_ports(monkeypatch, **{name: {"listens": (port,)}})
        found = examine(f"tcp://127.0.0.1:{port}")
    assert (found.protocol, found.sent, heard) == ("", "nothing", b"")


def test_ports_that_move_an_arm_are_those_of_the_manuals():
    known = probes()
    assert {30001, 30002, 30003} <= {*known["rtde"].listens}
    assert (known["snpx"].listens, known["rtde"].ports, known["hses"].ports) == ((16001,), (30004,), (10040,))
    assert known["snpx"].ports == (60008, 18245)


@pytest.mark.parametrize(
    ("says", "words"),
    [
        (b"SSH-2.0-OpenSSH_9.2\r\n", "sends something unknown: SSH-2.0-OpenSSH_9.2"),
        (b"\x00" * 70_000, "sends something unknown"),
        (b"1#ABSOLUTE.DEG*1;2@1#ABSOLUTE.DEG*1;2@", "with 2 joints"),
        (b"1#7001*1;2@1#7001*1;2@", "no joint positions yet"),
        (b"1#ABSOLUTE.DEG*\x1b[2J@", "sends something unknown"),
    ],
)
def test_what_a_port_sends_is_shown_plainly(says, words):
    with server(says=says) as (port, _):
        found = examine(f"tcp://127.0.0.1:{port}")
    assert words in found.text
    assert "\x1b" not in found.text
    assert len(found.text) < 200


def test_a_web_server_is_no_controller(monkeypatch):
    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet) as serving:
        threading.Thread(target=serving.serve_forever).start()
        port = serving.server_address[1]
        try:
            assert "sends nothing within 0.5 s" in examine(f"tcp://127.0.0.1:{port}").text
            at_ports(monkeypatch, rtde={"ports": (port,)})
            monkeypatch.setattr(probing, "ANSWER_S", 0.5)
            assert "to a request for RTDE" in examine(f"tcp://127.0.0.1:{port}").text
        finally:
            serving.shutdown()


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("10.0.0.7:30004", "must be tcp://HOST:PORT"),
        ("tcp://10.0.0.7", "must be tcp://HOST:PORT"),
        ("http://10.0.0.7:80", "must be tcp://HOST:PORT"),
        ("tcp://10.0.0.7:0", "must be tcp://HOST:PORT"),
        ("udp://127.0.0.1:53", "of UDP ports only 10040 is known"),
    ],
)
def test_what_cannot_be_probed_is_named(address, words):
    with pytest.raises(ProbeError, match=words):
        examine(address)


def test_a_silent_udp_port_is_named(monkeypatch):
    monkeypatch.setattr(probing, "ANSWER_S", 0.3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        port = silent.getsockname()[1]
        at_ports(monkeypatch, hses={"ports": (port,)})
        with pytest.raises(ProbeError, match=rf"udp://127\.0\.0\.1:{port}: no answer within 0.3 s"):
            examine(f"udp://127.0.0.1:{port}")


def test_a_closed_port_is_named():
    with pytest.raises(ProbeError, match="Connection refused"):
        examine(f"tcp://127.0.0.1:{free_port()}")
