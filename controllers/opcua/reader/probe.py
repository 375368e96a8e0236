"""How `robomesh probe` knows an OPC UA server: it is asked for its endpoints."""

import asyncio
import logging

from controllers import probing
from controllers.probing import Found, Probe, ProbeError

_SCHEME, _PORT = "opc.tcp", 4840


def _heard(heard: bytes) -> Found | None:
    if heard:
        return None
    return Found(
        text=f"it accepts a connection, and sends nothing within {probing.LISTEN_S:g} s",
        next=f"the port is that of OPC UA: probe {_SCHEME}://HOST:{_PORT}",
    )


def _examine(url: str) -> Found:
    from controllers.opcua.reader.problems import ReadingError
    from controllers.opcua.reader.security import endpoints_of, offers_of

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


OPCUA = Probe(
    scheme=_SCHEME,
    listens=(_PORT,),
    sends=f"the request for its endpoints to {_SCHEME}://HOST:PORT (it shows the certificate's fingerprint)",
    heard=_heard,
    examine=_examine,
)
