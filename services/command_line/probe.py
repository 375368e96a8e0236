"""`robomesh probe`: the protocol that one port of a controller speaks. It contacts that port only.

It listens before it sends, and sends at most one question: the RTDE version to port 30004, the read of the
system's information to UDP port 10040, the first packet of a connection to ports 60008 and 18245. To any
other port it sends nothing. An address that begins with opc.tcp is asked for its endpoints, which needs no
user and no session. A UDP port sends nothing before it is asked, so it is asked immediately.
"""

import re
import socket
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Annotated

import typer

from robomesh.texts import one_line
from services.command_line.options import Json, command_group
from services.command_line.output import print_json, print_line
from services.errors import ServiceError

app = command_group()

_RTDE_PORT, _HSES_PORT = 30004, 10040
# Of FANUC: the Robot Interface, and the option HMI Device (SNPX).
_SNPX_PORTS = (60008, 18245)
# Of Universal Robots; the last three send the same, and take nothing.
_PRIMARY_PORTS = (30001, 30002, 30003, 30011, 30012, 30013)
_RMI_PORT = 16001
_FTP_PORT = 21
_LISTEN_S = 2.0
_ANSWER_S = 2.0
_MOST_BYTES = 1 << 16
_LONGEST_SHOWN = 60
_OPC, _OPC_PORT = "opc.tcp", 4840


class ProbeError(ServiceError):
    """The port cannot be probed."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """Result of a probe.

    Attributes:
        protocol: The site file's `protocol` that reads it; empty: unknown, or not one that robomesh reads.
        text: In a sentence.
        next: What to do with it.
        sent: What was sent, in words.
        received_bytes: Number of received bytes; None: a library received them.
    """

    protocol: str = ""
    text: str
    next: str = ""
    sent: str = "nothing"
    received_bytes: int | None = 0


@app.command()
def probe(
    address: Annotated[
        str,
        typer.Argument(
            metavar="tcp://HOST:PORT",
            help="The port; or udp://HOST:10040 of Yaskawa, opc.tcp://HOST:PORT of OPC UA.",
        ),
    ],
    as_json: Json = False,
) -> None:
    """Show which protocol a controller's port speaks.

    It contacts this port only, listens for 2 s before it sends, and sends nothing but the RTDE version to
    port 30004, the first packet of SNPX, 56 zero bytes, to ports 60008 and 18245, and a read of the system's
    information to UDP port 10040, where it does not listen first. Of an OPC UA server it asks the endpoints,
    and shows the certificate's fingerprint. Exit status 1: no protocol that robomesh reads.
    """

    found = examine(address)
    if as_json:
        print_json({"address": address, **asdict(found)})
    else:
        print_line(f"{address}: {found.text}")
        received = "" if found.received_bytes is None else f"; received: {found.received_bytes} bytes"
        print_line(f"  sent: {found.sent}{received}")
        if found.next:
            print_line(f"  {found.next}")
    if not found.protocol:
        raise typer.Exit(1)


def examine(address: str) -> Found:
    """Contact a port, and return what it shows.

    Raises:
        ProbeError: If the address is none, or nothing can be reached there.
    """
    scheme, host, port = _split(address)
    if scheme == _OPC:
        if port in (*_PRIMARY_PORTS, _RMI_PORT, _RTDE_PORT, *_SNPX_PORTS):
            raise ProbeError(f"{address}: this port has another protocol: probe tcp://{host}:{port}")
        _require_opcua()
    if scheme == "udp":
        if port != _HSES_PORT:
            raise ProbeError(f"{address}: of UDP ports only {_HSES_PORT} is known (Yaskawa's HSES)")
        return _examine_hses(host, port)
    try:
        with socket.create_connection((host, port), timeout=_ANSWER_S) as connection:
            if scheme == "tcp":
                return _examine(connection, port)
            heard = _listen(connection, _LISTEN_S, _is_known)
    except TimeoutError:
        raise ProbeError(f"{address}: no answer within {_ANSWER_S:g} s") from None
    except OSError as error:
        raise ProbeError(f"{address}: {_reason(error)}") from None
    # An OPC UA server sends nothing before it is asked.
    if heard:
        return replace(_recognized(heard, port), received_bytes=len(heard))
    return _examine_opcua(address)


def _split(address: str) -> tuple[str, str, int]:
    from services.errors import ListenError
    from services.site_file.listen_address import split_address

    scheme, _, rest = address.partition("://")
    try:
        # The path of an OPC UA server is not part of HOST:PORT.
        host, port = split_address(rest.partition("/")[0] if scheme == _OPC else rest)
    except ListenError:
        port = 0
    if scheme not in ("tcp", "udp", _OPC) or port == 0:
        raise ProbeError(f"{address!r}: tcp://HOST:PORT is right, as in tcp://10.0.0.7:30004")
    return scheme, host, port


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def _examine(connection: socket.socket, port: int) -> Found:
    heard = _listen(connection, _LISTEN_S, _is_known)
    if port == _RTDE_PORT and not heard:
        return _examine_rtde(connection)
    if port in _SNPX_PORTS and not heard:
        return _examine_snpx(connection)
    return replace(_recognized(heard, port), received_bytes=len(heard))


def _listen(connection: socket.socket, seconds: float, enough: Callable[[bytes], bool]) -> bytes:
    """Return what arrives within a time, or until it is enough."""
    heard = b""
    ends_s = time.monotonic() + seconds
    while (left_s := ends_s - time.monotonic()) > 0 and len(heard) < _MOST_BYTES and not enough(heard):
        connection.settimeout(left_s)
        try:
            chunk = connection.recv(_MOST_BYTES)
        except TimeoutError:
            break
        if not chunk:
            break
        heard += chunk
    return heard


def _is_known(heard: bytes) -> bool:
    return _units(heard)[0] > 1 or (heard.startswith(b"220 ") and heard.endswith(b"\n"))


# ------------------------------------------------------------------- protocols


def _recognized(heard: bytes, port: int) -> Found:
    units, joints, numbers = _units(heard)
    if units:
        known = f"{joints} joints" if joints else "no joint positions yet"
        codes = ", and `codes`, because it sends numbers (docs/controllers.md)" if numbers else ""
        return Found(
            protocol="unit",
            text=f"it sends units of robomesh's own protocol, with {known}",
            next=f"in the site file: this controller, and a model of {joints or 'its'} joints{codes}",
        )
    if port in _PRIMARY_PORTS:
        packages = _primary_packages(heard)
        if packages:
            return Found(
                text=f"it sends {packages} packages of Universal Robots' primary or secondary interface",
                next=f"robomesh reads RTDE: probe tcp://HOST:{_RTDE_PORT}",
            )
        return Found(text="it accepts a connection and sends no package of Universal Robots")
    if port == _RMI_PORT:
        return Found(
            text="it accepts a connection on the port of FANUC's RMI, to which nothing is ever sent here",
            next="RMI takes one client, and is for motion; robomesh reads SNPX, and moves by RMI if the site "
            "file says so (docs/controllers/fanuc.md): probe tcp://HOST:60008",
        )
    if port == _FTP_PORT and heard.startswith(b"220"):
        return _greeting_of_ftp(heard)
    if port == _OPC_PORT and not heard:
        return Found(
            text=f"it accepts a connection, and sends nothing within {_LISTEN_S:g} s",
            next=f"the port is that of OPC UA: probe {_OPC}://HOST:{port}",
        )
    if heard:
        shown = one_line(heard.decode("ascii", "backslashreplace"), _LONGEST_SHOWN)
        return Found(text=f"it sends something unknown: {shown}")
    return Found(
        text=f"it accepts a connection, and sends nothing within {_LISTEN_S:g} s",
        next="a controller of the unit protocol sends its joints by itself",
    )


def _greeting_of_ftp(heard: bytes) -> Found:
    """Return the meaning of an FTP server's greeting; nothing is sent, not even a user's name."""
    greeting = heard.decode("latin-1").splitlines()[0][4:]
    shown = one_line(greeting, _LONGEST_SHOWN)
    fanuc = re.search(r"FANUC|R-30i|\bROBOT FTP\b|(Handling|Arc|Spot|Paint|Dispense|Pallet)Tool", greeting)
    if fanuc is None:
        return Found(text=f"an FTP server: {shown}", next="nothing says that it is a controller of FANUC")
    return Found(
        protocol="fanuc-ftp",
        text=f"an FTP server, by its greeting of a controller of FANUC: {shown}",
        next=f"if tcp://HOST:{_SNPX_PORTS[0]} does not answer (SNPX), in the site file: "
        'protocol = "fanuc-ftp", and [robot.fanuc] with j23; it is slow',
    )


def _units(heard: bytes) -> tuple[int, int, bool]:
    """Return the number of well-formed units, their number of joints, and whether types are numbers."""
    from protocol_gateway.core.records import AbsolutePositions, Unknown
    from protocol_gateway.core.stream import Unit, UnitStream

    # A connection begins anywhere in a unit, so the first one may be a rest.
    units = [each for each in UnitStream().receive(heard) if isinstance(each, Unit)]
    records = [record for unit in units for record in unit.records]
    joints = max((len(each.values) for each in records if isinstance(each, AbsolutePositions)), default=0)
    numbers = any(isinstance(each, Unknown) and each.type.lstrip("-").isdigit() for each in records)
    return len(units), joints, numbers


def _primary_packages(heard: bytes) -> int:
    """Return the number of whole packages of Universal Robots' primary interface at the begin."""
    count, at = 0, 0
    while len(heard) - at >= 5:
        length, kind = int.from_bytes(heard[at : at + 4], "big"), heard[at + 4]
        # 16: the robot's state, 20: a message, 25: a handover, 5: a program state.
        if not 5 <= length <= _MOST_BYTES or kind not in (5, 16, 20, 25):
            return 0
        if at + length > len(heard):
            break
        count, at = count + 1, at + length
    return count


def _examine_rtde(connection: socket.socket) -> Found:
    from protocol_gateway.drivers.universal_robots.packages import Package
    from protocol_gateway.drivers.universal_robots.rtde_messages import (
        ProtocolVersionAnswered,
        RtdeStream,
        request_protocol_version,
    )

    def answered(heard: bytes) -> ProtocolVersionAnswered | None:
        stream = RtdeStream()
        found = (stream.decode(each) for each in stream.receive(heard) if isinstance(each, Package))
        return next((each for each in found if isinstance(each, ProtocolVersionAnswered)), None)

    sent = "the request for RTDE version 2"
    connection.sendall(request_protocol_version(2))
    heard = _listen(connection, _ANSWER_S, lambda heard: answered(heard) is not None)
    answer = answered(heard)
    if answer is None:
        unknown = "answers nothing" if not heard else "answers something unknown"
        return Found(text=f"it {unknown} to a request for RTDE", sent=sent, received_bytes=len(heard))
    version = "version 2" if answer.accepted else "version 1 only"
    return Found(
        protocol="rtde",
        text=f"a controller of Universal Robots: RTDE, {version}",
        next='in the site file: protocol = "rtde", and a model of its six joints',
        sent=sent,
        received_bytes=len(heard),
    )


def _examine_snpx(connection: socket.socket) -> Found:
    from protocol_gateway.drivers.fanuc.srtp import HEADER_BYTES, Answer, AnswerStream, Connect

    sent = "the first packet of SNPX, 56 zero bytes, which asks for nothing"
    connection.sendall(Connect().encode(0))
    heard = _listen(connection, _ANSWER_S, lambda heard: len(heard) >= HEADER_BYTES)
    answers = AnswerStream().receive(heard)
    if not answers or not isinstance(answers[0], Answer) or not answers[0].connected:
        unknown = "answers nothing" if not heard else "answers something unknown"
        return Found(text=f"it {unknown} to the first packet of SNPX", sent=sent, received_bytes=len(heard))
    return Found(
        protocol="snpx",
        text="it speaks SRTP, as controllers of FANUC (SNPX) and PLCs of GE do",
        next='in the site file: protocol = "snpx", and [robot.fanuc] with j23 and assignments',
        sent=sent,
        received_bytes=len(heard),
    )


def _examine_hses(host: str, port: int) -> Found:
    from protocol_gateway.drivers.yaskawa import data, hses

    question = hses.Read(hses.Command.SYSTEM, 11)
    sent = "a read of the system's information (0x89)"
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family[0], socket.SOCK_DGRAM) as endpoint:
            endpoint.settimeout(_ANSWER_S)
            endpoint.connect(family[4])
            endpoint.send(question.encode(1))
            datagram = endpoint.recv(_MOST_BYTES)
    except TimeoutError:
        raise ProbeError(f"udp://{host}:{port}: no answer within {_ANSWER_S:g} s") from None
    except OSError as error:
        raise ProbeError(f"udp://{host}:{port}: {_reason(error)}") from None
    try:
        answer = hses.decode(datagram)
        system = None if answer.status else data.system(answer.data)
    except ValueError as error:
        return Found(text=f"it answers, but not in HSES: {error}", sent=sent, received_bytes=len(datagram))
    if system is None:
        known = f", which refuses the question: {answer.error}"
    else:
        known = f": model {system.model or 'unknown'}, software {system.software or 'unknown'}"
    return Found(
        protocol="hses",
        text=f"a controller of Yaskawa with HSES{known}",
        next='in the site file: protocol = "hses", and [robot.yaskawa] with the pulses of each joint',
        sent=sent,
        received_bytes=len(datagram),
    )


def _require_opcua() -> None:
    from robomesh.extras import is_missing, missing

    if is_missing("asyncua"):
        raise ProbeError(missing("asyncua"))


def _examine_opcua(url: str) -> Found:
    import asyncio
    import logging

    from protocol_gateway.drivers.opcua.reader.problems import ReadingError
    from protocol_gateway.drivers.opcua.reader.security import endpoints_of, offers_of

    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    try:
        offers = offers_of(asyncio.run(endpoints_of(url)))
    except ReadingError as error:
        raise ProbeError(f"{url}: {error}") from None
    known = "; ".join(
        "no security" if name == "None" else f"{name}: {', '.join(policies)}"
        for name, policies in offers.security.items()
    )
    pinned = sorted(offers.fingerprints)
    lines = [f'server_certificate = "{each}"' for each in pinned]
    return Found(
        protocol="opcua",
        text=f"an OPC UA server, {offers.name}; {known or 'no endpoint that robomesh knows'}",
        next='in the site file: protocol = "opcua", and in [robot.opcua] '
        + (
            f"{' or '.join(lines)}, once the controller itself shows the same fingerprint"
            if lines
            else 'security = "none", because it offers no encryption with SHA-256'
        ),
        sent="the request for its endpoints",
        received_bytes=None,
    )
