"""The drivers that the conformance suite tries, each with its simulated controller."""

import contextlib
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from controllers.universal_robots.settings import MotionSettings, UniversalRobotsSettings
from tests.controllers.fanuc import ftp_site, test_snpx_driver
from tests.controllers.opcua import test_opcua_driver
from tests.controllers.universal_robots import test_rtde_driver
from tests.controllers.yaskawa import test_hses_driver
from tests.protocol_gateway.gateway_site import simulator


@dataclass(frozen=True, kw_only=True)
class Subject:
    """A driver under test.

    Attributes:
        settings: Of the robot.
        start: Runs a simulated controller with a demo or at rest, and with faults; yields its ports, that of
            the site file's `controller` first.
        ports: Names of the other ports, in the order of `start`.
        declared: Asserts that all packets that were sent to a port are among those that the driver declares,
            and returns their number.
        reads: It never commands.
        faults: Those of the simulated controller that the suite tries.
        reports_time: It reports the controller's own clock.
        slow: Its start takes seconds: only the tests whose outcome depends on its process try it.
    """

    name: str
    settings: dict
    start: Callable
    ports: tuple[str, ...] = ()
    declared: dict = field(default_factory=dict)
    datagrams: bool = False
    reads: bool = True
    faults: tuple[str, ...] = ()
    reports_time: bool = False
    slow: bool = False

    def __str__(self):
        return self.name


@contextlib.asynccontextmanager
async def one_port(starting):
    async with starting as port:
        yield (port,)


def nothing(parts):
    assert not b"".join(parts)
    return 0


def greeting_of_rtde(parts):
    """Assert that only the protocol version, the software's version, outputs and start are sent."""
    data, kinds = b"".join(parts), ""
    while data:
        size, kind = struct.unpack_from(">HB", data)
        kinds += chr(kind)
        data = data[size:]
    # Each connection: version, software, outputs (again without the unknown ones), start.
    assert re.fullmatch(r"(V{1,2}v?O{0,2}S?)*", kinds), kinds
    return len(kinds)


def greetings_with_inputs(parts):
    """Assert that inputs are set up, on a connection of their own, but never written."""
    data, kinds = b"".join(parts), ""
    while data:
        size, kind = struct.unpack_from(">HB", data)
        kinds += chr(kind)
        data = data[size:]
    assert set(kinds) <= set("VvOSI"), kinds
    return len(kinds)


def questions_of_the_dashboard(parts):
    lines = b"".join(parts).decode().splitlines()
    assert set(lines) <= {"is in remote control"}
    return len(lines)


def reads_of_hses(parts):
    for each in parts:
        assert (len(each), each[:11], each[12:24]) == (32, b"YERC\x20\0\0\0\x03\x01\0", b"\0\0\0\x0099999999")
        assert (*struct.unpack_from("<H", each, 24), each[29]) in test_hses_driver.READS
    return len(parts)


def reads_of_snpx(parts):
    """Assert that only a session, reads and the client's own assignments are sent."""
    found = test_snpx_driver.packets(b"".join(parts))
    for each in found:
        if each == bytes(56) or each[42:44] == b"\x4f\x01":
            continue
        if each[31] == 0x80:
            assert each[50:54] == b"\x07\x38\0\0"
            assert re.fullmatch(r"CLRASG|SETASG 1\d{4} \d+ \S+ \d+", each[56:].decode())
        else:
            assert (each[31], each[42], each[48:]) == (0xC0, 0x04, bytes(8))
    return len(found)


def reads_of_ftp(parts):
    """Assert that a client logs in, enters the folder, and then only reads the declared files."""
    lines = b"".join(parts).decode().split("\r\n")
    assert lines.pop() == "" or not lines
    for each in lines:
        assert re.fullmatch(
            r"USER anonymous|TYPE I|CWD md:|PASV|RETR (CURPOS|IOSTATE|SFTYSIG)\.DG"
            r"|RETR ERRACT\.LS|RETR (NUMREG|SYSFRAME)\.VA",
            each,
        ), each
    return len(lines)


# Encodings of requests in OPC UA's namespace: endpoints, sessions, browse, read, subscriptions, publish. Not
# among them: 673 (Write) and 712 (Call).
READS_OF_OPC_UA = {428, 461, 467, 473, 527, 533, 631, 751, 787, 826}


def reads_of_opcua(parts):
    """Assert that only these requests are sent, besides opening and closing the channel.

    Returns 0: the reading process sends them, so the gateway counts none.
    """
    data = b"".join(parts)
    while data:
        kind, size = data[:3], struct.unpack_from("<I", data, 4)[0]
        assert kind in (b"HEL", b"OPN", b"MSG", b"CLO"), kind
        if kind == b"MSG":
            encoding, namespace, number = struct.unpack_from("<BBH", data, 24)
            assert (encoding, namespace) == (1, 0)
            assert number in READS_OF_OPC_UA, number
        data = data[size:]
    return 0


SUBJECTS = (
    Subject(
        name="unit",
        settings={"stop_proven": True},
        start=lambda **settings: one_port(simulator(**settings)),
        declared={"": nothing},
        reads=False,
        faults=("garbage", "split", "flood", "burst", "joints", "mute"),
    ),
    Subject(
        name="rtde",
        settings=test_rtde_driver.UR,
        start=test_rtde_driver.controller,
        ports=("primary",),
        declared={"": greeting_of_rtde, "primary": nothing},
        faults=("garbage", "split", "flood", "burst"),
        reports_time=True,
    ),
    # Motion is allowed, but its stop was never proven.
    Subject(
        name="rtde-motion",
        settings={**test_rtde_driver.UR, "options": UniversalRobotsSettings(motion=MotionSettings())},
        start=test_rtde_driver.whole_controller,
        ports=("primary", "scripts", "dashboard"),
        declared={
            "": greetings_with_inputs,
            "primary": nothing,
            "scripts": nothing,
            "dashboard": questions_of_the_dashboard,
        },
        faults=("garbage", "split", "flood", "burst"),
        reports_time=True,
    ),
    Subject(
        name="hses",
        settings=test_hses_driver.YASKAWA,
        start=lambda **settings: one_port(test_hses_driver.controller(**settings)),
        declared={"": reads_of_hses},
        datagrams=True,
        faults=("garbage", "flood", "busy", "loss", "joints", "mute"),
    ),
    # Motion is allowed, but its stop was never proven.
    Subject(
        name="hses-motion",
        settings={
            **test_hses_driver.YASKAWA,
            "options": replace(test_hses_driver.YASKAWA["options"], motion=True),
            "stop_proven": False,
        },
        start=lambda **settings: one_port(test_hses_driver.controller(**settings)),
        declared={"": reads_of_hses},
        datagrams=True,
        faults=("garbage", "flood", "busy", "loss", "joints", "mute"),
    ),
    Subject(
        name="snpx",
        settings=test_snpx_driver.FANUC,
        start=lambda **settings: one_port(test_snpx_driver.controller(**settings)),
        declared={"": reads_of_snpx},
        faults=("garbage", "split", "flood", "busy", "loss", "joints", "mute"),
    ),
    Subject(
        name="fanuc-ftp",
        settings=ftp_site.FANUC_FTP,
        start=lambda **settings: one_port(ftp_site.controller(**settings)),
        declared={"": reads_of_ftp},
        faults=("garbage", "split", "busy", "loss", "joints", "mute"),
    ),
    Subject(
        name="opcua",
        settings=test_opcua_driver.OPC_UA,
        start=lambda **settings: one_port(test_opcua_driver.controller(**settings)),
        declared={"": reads_of_opcua},
        slow=True,
        reports_time=True,
    ),
)
