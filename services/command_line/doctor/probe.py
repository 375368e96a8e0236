"""`robomesh probe`: shows which protocol a controller's port speaks.

It listens before it sends, and sends at most one question, which the kind of controller of that port names.
A UDP port sends nothing unasked, so it is asked immediately. The kinds of packages follow robomesh's own;
one that cannot be used, or fails, gives a note, and the others are tried.
"""

import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import cache
from typing import Annotated, TypeVar

import typer

from controllers import probing
from controllers.probing import Asked, Found, Probe, ProbeError
from protocol_gateway.configuration.kinds import kind_of, own_kinds, part_of, protocols
from protocol_gateway.seam.errors import GatewaySettingsError
from robomesh.errors import ListenError, RobomeshError
from robomesh.extras import is_missing, missing
from robomesh.listen_address import split_address
from robomesh.texts import one_line
from services.command_line.terminal.options import Json, command_group
from services.command_line.terminal.output import print_json, print_line

app = command_group()


_T = TypeVar("_T")


def probes() -> Mapping[str, Probe]:
    """Return how each protocol is known, those of robomesh first."""
    return {protocol: each for protocol, each in _found().items() if isinstance(each, Probe)}


def _found() -> Mapping[str, Probe | GatewaySettingsError]:
    """Return the probe of each protocol that has one, or the problem with it."""
    found: dict[str, Probe | GatewaySettingsError] = {}
    for protocol in protocols():
        try:
            if (each := part_of(protocol, "probe", Probe)) is not None:
                found[protocol] = each
        except GatewaySettingsError as error:
            found[protocol] = error
    return found


def _schemes(known: Mapping[str, Probe]) -> Mapping[str, None]:
    return dict.fromkeys(each.scheme for each in known.values())


_HELP = f"""Show which protocol a controller's port speaks.

It contacts this port only, listens for 2 s before it sends, and sends nothing but
{", ".join(str(each.sends) for each in probes().values() if each.sends)}. Exit status 1: no protocol that
robomesh reads.
"""


@app.command(help=_HELP)
def probe(
    address: Annotated[
        str,
        typer.Argument(
            metavar="tcp://HOST:PORT",
            help="The port; or "
            + ", ".join(f"{each}://HOST:PORT" for each in _schemes(probes()) if each != "tcp")
            + ".",
        ),
    ],
    as_json: Json = False,
) -> None:
    """Show which protocol a controller's port speaks."""
    for each in _found().values():
        if isinstance(each, GatewaySettingsError):
            _note(str(each))
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
    known = probes()
    scheme, host, port = _split(address, known)
    others = {name: each for name, each in known.items() if each.scheme not in (scheme, "udp")}
    known_there = {name: each for name, each in known.items() if each.scheme == scheme}
    if scheme == "udp":
        return _examine_udp(host, port, known_there)
    if scheme != "tcp":
        if _first(others, lambda each: _knows(each, port))[0]:
            raise ProbeError(f"{address}: this port has another protocol: probe tcp://{host}:{port}")
        _require_packages(known_there)
    try:
        with socket.create_connection((host, port), timeout=probing.ANSWER_S) as connection:
            heard = probing.listen(
                connection,
                probing.LISTEN_S,
                lambda heard: bool(_first(known, lambda each: each.knows(heard))[0]),
            )
            protocol, asked = _asked(port, known_there)
            if asked is not None and not heard:
                with _fails_as(protocol):
                    return probing.ask(connection, asked)
    except TimeoutError:
        raise ProbeError(f"{address}: no answer within {probing.ANSWER_S:g} s") from None
    except OSError as error:
        raise ProbeError(f"{address}: {_reason(error)}") from None
    protocol, examined = _first(known_there, lambda each: each.examine)
    # These servers send nothing before they are asked.
    if examined is not None and not heard:
        with _fails_as(protocol):
            return examined(address)
    return _meaning(heard, port, known)


def _asked(port: int, known: Mapping[str, Probe]) -> tuple[str, Asked | None]:
    """Return the question for a port, of the first kind that knows the port: it may only listen there."""
    protocol, first = _first(known, lambda each: each if _knows(each, port) else None)
    return protocol, first.asks if first and port in first.ports else None


def _knows(each: Probe, port: int) -> bool:
    return port in (*each.ports, *(each.listens or ()))


def _first(known: Mapping[str, Probe], result: Callable[[Probe], _T | None]) -> tuple[str, _T | None]:
    """Return the first protocol with a result, and the result; without one "" and None."""
    for protocol, each in known.items():
        try:
            with _fails_as(protocol):
                if found := result(each):
                    return protocol, found
        except ProbeError as error:
            _note(str(error))
    return "", None


@contextmanager
def _fails_as(protocol: str) -> Iterator[None]:
    """Name a package whose probe fails.

    Raises:
        ProbeError: If it does.
    """
    try:
        yield
    except (RobomeshError, OSError):
        raise
    except Exception as error:
        if protocol in own_kinds():
            raise
        package = kind_of(protocol).distribution
        raise ProbeError(
            f"protocol {protocol!r}: its probe, of the package {package}, fails: {error!r}"
        ) from error


@cache
def _note(problem: str) -> None:
    """Print a problem once."""
    print_line(f"robomesh: {problem}", err=True)


def _require_packages(known: Mapping[str, Probe]) -> None:
    """Look for the packages of kinds.

    Raises:
        ProbeError: If one is not installed.
    """
    for kind in map(kind_of, known):
        for module in kind.packages:
            if is_missing(module):
                raise ProbeError(missing(module, kind.extra, kind.distribution))


def _split(address: str, known: Mapping[str, Probe]) -> tuple[str, str, int]:
    scheme, _, rest = address.partition("://")
    try:
        # A path is not part of HOST:PORT.
        host, port = split_address(rest if scheme in ("tcp", "udp") else rest.partition("/")[0])
    except ListenError:
        port = 0
    if scheme not in _schemes(known) or port == 0:
        raise ProbeError(f"{address!r}: must be tcp://HOST:PORT, as in tcp://10.0.0.7:30004")
    return scheme, host, port


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def _meaning(heard: bytes, port: int, known: Mapping[str, Probe]) -> Found:
    def meaning(each: Probe) -> Found | None:
        found = each.heard(heard) if each.listens is None or port in each.listens else None
        return replace(found, received_bytes=len(heard)) if found else None

    if (first := _first(known, meaning)[1]) is not None:
        return first
    if heard:
        shown = one_line(heard.decode("ascii", "backslashreplace"), probing.LONGEST_SHOWN)
        return Found(text=f"it sends something unknown: {shown}", received_bytes=len(heard))
    return Found(
        text=f"it accepts a connection, and sends nothing within {probing.LISTEN_S:g} s",
        next="a controller of the unit protocol sends its joints by itself",
    )


def _examine_udp(host: str, port: int, known: Mapping[str, Probe]) -> Found:
    protocol, asked = _asked(port, known)
    where = f"udp://{host}:{port}"
    if asked is None:
        ports = " and ".join(str(number) for each in known.values() for number in each.ports)
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
    with _fails_as(protocol):
        return replace(asked.meaning(answer), sent=asked.sent, received_bytes=len(answer))
