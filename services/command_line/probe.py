"""`robomesh probe`: shows which protocol a controller's port speaks.

It listens before it sends, and sends at most one question, which the kind of controller of that port names.
A UDP port sends nothing unasked, so it is asked immediately.
"""

import socket
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import cache
from typing import Annotated, cast

import typer

from controllers import probing
from controllers.probing import Found, Probe, ProbeError
from protocol_gateway.kinds import own_kinds
from protocol_gateway.seam.kind import named
from robomesh.errors import ListenError
from robomesh.extras import is_missing, missing
from robomesh.listen_address import split_address
from robomesh.texts import one_line
from services.command_line.options import Json, command_group
from services.command_line.output import print_json, print_line

app = command_group()


@cache
def probes() -> Mapping[str, Probe]:
    """Return how each protocol is known."""
    return {name: cast("Probe", named(kind.probe)) for name, kind in own_kinds().items() if kind.probe}


_HELP = f"""Show which protocol a controller's port speaks.

It contacts this port only, listens for 2 s before it sends, and sends nothing but
{", ".join(each.sends for each in probes().values() if each.sends)}. Exit status 1: no protocol that
robomesh reads.
"""


@app.command(help=_HELP)
def probe(
    address: Annotated[
        str,
        typer.Argument(
            metavar="tcp://HOST:PORT",
            help="The port; or "
            + ", ".join(f"{each.scheme}://HOST:PORT" for each in probes().values() if each.scheme != "tcp")
            + ".",
        ),
    ],
    as_json: Json = False,
) -> None:
    """Show which protocol a controller's port speaks."""
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
    known = [each for each in probes().values() if each.scheme == scheme]
    if scheme == "udp":
        return _examine_udp(host, port, known)
    others = [each for each in probes().values() if each.scheme not in (scheme, "udp")]
    taken = {number for each in others for number in (*each.ports, *(each.listens or ()))}
    if scheme != "tcp" and port in taken:
        raise ProbeError(f"{address}: this port has another protocol: probe tcp://{host}:{port}")
    _require_packages(scheme)
    try:
        with socket.create_connection((host, port), timeout=probing.ANSWER_S) as connection:
            heard = probing.listen(connection, probing.LISTEN_S, _is_known)
            asked = next((each.asks for each in known if port in each.ports), None)
            if asked is not None and not heard:
                return probing.ask(connection, asked)
    except TimeoutError:
        raise ProbeError(f"{address}: no answer within {probing.ANSWER_S:g} s") from None
    except OSError as error:
        raise ProbeError(f"{address}: {_reason(error)}") from None
    examined = next((each.examine for each in known if each.examine), None)
    # These servers send nothing before they are asked.
    if examined is not None and not heard:
        return examined(address)
    return replace(_meaning(heard, port), received_bytes=len(heard))


def _require_packages(scheme: str) -> None:
    """Look for the packages of the kinds with a scheme.

    Raises:
        ProbeError: If one is not installed.
    """
    for name, kind in own_kinds().items():
        for package in kind.packages if name in probes() and probes()[name].scheme == scheme else ():
            if is_missing(package):
                raise ProbeError(missing(package, kind.extra))


def _split(address: str) -> tuple[str, str, int]:
    scheme, _, rest = address.partition("://")
    schemes = {each.scheme for each in probes().values()}
    try:
        # A path is not part of HOST:PORT.
        host, port = split_address(rest if scheme in ("tcp", "udp") else rest.partition("/")[0])
    except ListenError:
        port = 0
    if scheme not in schemes or port == 0:
        raise ProbeError(f"{address!r}: tcp://HOST:PORT is right, as in tcp://10.0.0.7:30004")
    return scheme, host, port


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def _is_known(heard: bytes) -> bool:
    return any(each.knows(heard) for each in probes().values())


def _meaning(heard: bytes, port: int) -> Found:
    found = (each.heard(heard) for each in probes().values() if each.listens is None or port in each.listens)
    if (first := next(filter(None, found), None)) is not None:
        return first
    if heard:
        shown = one_line(heard.decode("ascii", "backslashreplace"), probing.LONGEST_SHOWN)
        return Found(text=f"it sends something unknown: {shown}")
    return Found(
        text=f"it accepts a connection, and sends nothing within {probing.LISTEN_S:g} s",
        next="a controller of the unit protocol sends its joints by itself",
    )


def _examine_udp(host: str, port: int, known: list[Probe]) -> Found:
    asked = next((each.asks for each in known if port in each.ports), None)
    where = f"udp://{host}:{port}"
    if asked is None:
        ports = " and ".join(str(number) for each in known for number in each.ports)
        raise ProbeError(f"{where}: of UDP ports only {ports} is known")
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family[0], socket.SOCK_DGRAM) as endpoint:
            endpoint.settimeout(probing.ANSWER_S)
            endpoint.connect(family[4])
            endpoint.send(asked.question)
            answer = endpoint.recv(probing.MOST_BYTES)
    except TimeoutError:
        raise ProbeError(f"{where}: no answer within {probing.ANSWER_S:g} s") from None
    except OSError as error:
        raise ProbeError(f"{where}: {_reason(error)}") from None
    return replace(asked.meaning(answer), sent=asked.sent, received_bytes=len(answer))
