"""Why a router does not let us in, where that can be found out; and how long our certificate lasts.

Zenoh says only that it could not connect. So, once that has happened, the same handshake is tried again
by Python's own TLS, which says what the other end has against it.
"""

import socket
import ssl
from datetime import UTC, datetime, timedelta
from pathlib import Path

from robomesh.certificate_identity import Identity, read_identity
from robomesh.endpoints import Tls
from robomesh.errors import SessionError

_TIMEOUT_S = 2.0
_SOON = timedelta(days=5)
# What follows the handshake: the other end's word on our certificate, or nothing.
_VERDICT_S = 0.5


def own_certificate(tls: Tls | None, now: datetime | None = None) -> tuple[Identity | None, str | None]:
    """Whose certificate it is, as far as its file says, and a warning that it ends soon.

    Raises:
        SessionError: If it cannot be read, or has expired.
    """
    if tls is None:
        return None, None
    for file in (tls.ca, tls.key):
        read_identity(file)
    identity = read_identity(tls.certificate)
    if identity is None or identity.expires is None:
        return identity, None
    left = identity.expires - (now or datetime.now(UTC))
    when = f"{identity.expires:%Y-%m-%d %H:%M} UTC"
    mend = f"robomesh keys renew {identity.name.partition('.')[0]} at site {identity.site}"
    if left <= timedelta(0):
        raise SessionError(f"{tls.certificate}: the certificate of {identity.name} expired on {when}: {mend}")
    return identity, f"the certificate of {identity.name} expires on {when}: {mend}" if left < _SOON else None


def left_s(file: Path, at_first: datetime) -> float:
    """Until a file's certificate expires [s]: it may have been renewed, and the next link is opened with it.

    Args:
        at_first: When the one expires that was there at first; it counts where the file cannot be read now.
    """
    try:
        identity = read_identity(file)
    except SessionError:
        identity = None
    expires = at_first if identity is None or identity.expires is None else identity.expires
    return (expires - datetime.now(UTC)).total_seconds()


def why(endpoint: str, tls: Tls | None) -> str | None:
    """What a router has against our certificate, or we against its; None: it does not listen, or nothing."""
    protocol, _, rest = endpoint.partition("/")
    host, _, port = rest.partition("?")[0].partition("#")[0].rpartition(":")
    if protocol not in ("tcp", "tls") or not port.isdigit():
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    plain = protocol == "tcp"
    try:
        if tls is not None and not plain:
            context.load_verify_locations(tls.ca)
            context.load_cert_chain(tls.certificate, tls.key)
            context.verify_mode = ssl.CERT_REQUIRED
        with (
            # What takes no TLS may wait for ever for the rest of what it takes for a message.
            socket.create_connection(
                (host.strip("[]"), int(port)), _VERDICT_S if plain else _TIMEOUT_S
            ) as raw,
            context.wrap_socket(raw) as link,
        ):
            if plain:
                return f"{endpoint} takes TLS only: a certificate is needed, with --keys FILE"
            link.settimeout(_VERDICT_S)
            link.recv(1)
    except ssl.SSLCertVerificationError as error:
        assert tls is not None
        return f"{endpoint} shows a certificate that {tls.ca} does not vouch for: {error.verify_message}"
    except ssl.SSLError as error:
        return None if plain else _verdict(endpoint, tls, error)
    except (OSError, OverflowError, UnicodeError):  # no such port, no such name
        pass
    return None


def _verdict(endpoint: str, tls: Tls | None, error: ssl.SSLError) -> str | None:
    reason = (error.reason or "").lower()
    if "alert" not in reason:
        return (
            f"{endpoint} does not speak TLS: tcp/HOST:PORT is for that" if "wrong_version" in reason else None
        )
    alert = reason.rpartition("alert_")[2].replace("_", " ")
    whose = "no certificate" if tls is None else f"the certificate in {tls.certificate}"
    known = {
        "certificate required": "it needs one: --keys FILE",
        "unknown ca": "another site's authority signed it",
        "certificate expired": "it has expired: robomesh keys renew",
        "certificate revoked": "it was revoked",
    }
    return f"refused by {endpoint}: {whose}: {known.get(alert, alert)}"
